"""The label rules: from what is true at times to what is true of a window.

A label holds from its time until the next one's, but `Rules.hold` at most; after that nothing is known. All
shares are of time, so labels at any rate, even or not, give the same answer. For a window [begin, end):

- **known**: labels must cover `known` of it, or every label of it is NaN.
- **contact** is 1 if it is touched for `touched` of its known time or more, 0 for `untouched` or less, and
  NaN between. Such a window holds the onset or the end of a touch: calling it either would teach a
  threshold of our choosing.
- **transition** is 1 where contact is NaN for that reason, else 0. Transitions stay in the dataset, for
  events and latency.
- **position**, **force** and the parts of the sliding velocity (**slip_across**, **slip_along**) are means
  over the touched time, where contact is 1. A touch that covers 90 % has at most a tenth of the window
  beside it, and that tenth has no position. **force_std** is the deviation of the force within: how far one
  number can stand for the window.
- **slip** is 1 where contact is 1 and the touch slides for `sliding` of the touched time or more, 0 for
  `still` or less, and NaN between. Sliding is heard even in part of a window, so 50 % counts; a shorter
  slide is neither. Without contact slip is NaN: nothing is there to slide.
- **any other column** is its mean over the known time.

While the taps that align the clocks are played, the drivers are off: windows that reach into that have
every label NaN and **calibrating** 1 (see `monochord.datasets.build`).
"""

from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.sessions.tracks import LabelTrack

Columns = dict[str, Floats]
OF_A_TOUCH = ("position", "force", "slip_across", "slip_along", "slip_velocity")
"""Columns that mean something only while something touches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Shares of a window's time that decide its labels; the module tells what each means."""

    touched: float = 0.9
    untouched: float = 0.1
    sliding: float = 0.5
    still: float = 0.1
    known: float = 0.9
    hold: Seconds = 0.2

    def __post_init__(self) -> None:
        for low, high, name in (
            (self.untouched, self.touched, "untouched and touched"),
            (self.still, self.sliding, "still and sliding"),
        ):
            if not 0.0 <= low < high <= 1.0:
                raise InputError(
                    f"label rule {name} {low:g}, {high:g}", "shares of 0 to 1, the first smaller"
                )
        if not (0.0 < self.known <= 1.0 and self.hold > 0.0):
            raise InputError(
                f"label rule known {self.known:g}, hold {self.hold:g} s", "above 0; known up to 1"
            )


RULES = Rules()


def window_labels(truth: LabelTrack, begin: Floats, end: Floats, rules: Rules = RULES) -> Columns:
    """Return the labels of windows, by the rules of this module.

    Parameters
    ----------
    truth
        What is true at times, with a column ``contact`` (0 or 1, NaN where that is not known).
    begin, end
        Times of the windows (n,), on the clock of `truth`, in s.
    rules
        The shares that decide.

    Returns
    -------
    Columns
        ``contact``, ``transition``, ``position``, ``force``, ``force_std``, ``slip`` and whatever else
        `truth` has, each (n,), NaN where not valid.

    Raises
    ------
    InputError
        If `truth` has no column ``contact``.

    Examples
    --------
    >>> time = np.arange(0.0, 0.4, 0.01)
    >>> touched = (time >= 0.155).astype(float)
    >>> truth = LabelTrack(time=time, columns={"contact": touched, "force": 2.0 * touched})
    >>> labels = window_labels(truth, np.array([0.0, 0.1, 0.2]), np.array([0.1, 0.2, 0.3]))
    >>> labels["contact"].tolist(), labels["transition"].tolist(), labels["force"].tolist()
    ([0.0, nan, 1.0], [0.0, 1.0, 0.0], [nan, nan, 2.0])
    """
    if "contact" not in truth.columns:
        given = f"labels with the columns {', '.join(truth.columns) or 'none'}"
        raise InputError(
            given, "a column contact", "take --labels measured where force and pose were recorded"
        )
    steps = _Steps(truth.time, begin, end, rules)
    contact = truth.columns["contact"]
    touched = np.where(contact >= 0.5, 1.0, 0.0)
    _, share = steps.mean(np.where(np.isnan(contact), np.nan, touched))
    decided = _decided(share, rules.touched, rules.untouched)
    is_touch = decided == 1.0
    labels: Columns = {
        "contact": decided,
        "transition": np.where(np.isnan(share), np.nan, np.isnan(decided).astype(np.float64)),
    }
    blank = np.full(len(begin), np.nan)
    touching = np.where(touched > 0.0, 1.0, np.nan)
    for column in dict.fromkeys((*OF_A_TOUCH[:2], "slip", *truth.columns)):
        values = truth.columns.get(column)
        if column == "contact":
            continue
        if values is None:
            labels[column] = blank
        elif column == "slip":
            sliding = np.where(np.isnan(values), np.nan, (values >= 0.5).astype(np.float64))
            _, part = steps.mean(sliding, touching)
            slip = _decided(part, rules.sliding, rules.still)
            labels[column] = np.where(is_touch, slip, np.nan)
        elif column in OF_A_TOUCH:
            _, mean = steps.mean(values, touching)
            labels[column] = np.where(is_touch, mean, np.nan)
        else:
            _, labels[column] = steps.mean(values)
    labels["force_std"] = blank
    if "force" in truth.columns:
        force = truth.columns["force"]
        middle = float(np.nanmean(force)) if np.isfinite(force).any() else 0.0  # keeps the squares small
        _, mean = steps.mean(force - middle, touching)
        _, square = steps.mean((force - middle) ** 2, touching)
        spread = np.sqrt(np.maximum(square - mean**2, 0.0))
        labels["force_std"] = np.where(is_touch, spread, np.nan)
    return labels


def _decided(share: Floats, most: float, least: float) -> Floats:
    """Return 1 for shares (n,) of `most` or more, 0 for `least` or less, NaN between; to a billionth."""
    return np.select([share >= most - 1e-9, share <= least + 1e-9], [1.0, 0.0], np.nan)


class _Steps:
    """Means over windows of what holds from one time to the next."""

    def __init__(self, time: Floats, begin: Floats, end: Floats, rules: Rules) -> None:
        distance = np.diff(time)
        if (distance < 0.0).any():
            raise InputError("labels whose times go back", "times in order")
        last = float(np.median(distance)) if distance.size else rules.hold
        self._lasts = np.minimum(np.append(distance, last)[: time.size], rules.hold)
        self._knots = np.stack([time, time + self._lasts], axis=1).ravel()
        self._begin, self._end, self._rules = begin, end, rules

    def mean(self, values: Floats, among: Floats | None = None) -> tuple[Floats, Floats]:
        """Return for how long values (m,) are known in each window, and their mean there.

        With `among`, only where that is not NaN. The mean is NaN where less than `known` of the time that
        counts is known.
        """
        counts = np.ones(values.shape) if among is None else np.isfinite(among).astype(np.float64)
        known = counts * np.isfinite(values)
        time = self._integral(known)
        due = self._end - self._begin if among is None else self._integral(counts)
        enough = (time >= self._rules.known * due - 1e-9) & (time > 1e-9)
        area = self._integral(np.where(known > 0.0, values, 0.0))
        return time, np.where(enough, area / np.where(enough, time, 1.0), np.nan)

    def _integral(self, heights: Floats) -> Floats:
        if not self._knots.size:
            return np.zeros(self._begin.shape)
        rises = np.zeros(self._knots.size)
        rises[1::2] = heights * self._lasts
        area = np.cumsum(rises)
        return np.interp(self._end, self._knots, area) - np.interp(self._begin, self._knots, area)
