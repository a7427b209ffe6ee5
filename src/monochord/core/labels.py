"""The label rules: from labels at times to the labels of a window.

A label holds from its time until the next one's, at most for `Rules.hold`; after that, values are unknown.
All shares are of time, so labels at any rate, regular or not, give the same result. For a window [begin,
end):

- **known**: labels must cover `known` of it, or every label of it is NaN.
- **contact** is 1 if it is touched for `touched` of its known time or more, 0 for `untouched` or less, and
  NaN between. Such a window holds the onset or the end of a touch: either label would teach an arbitrary
  threshold.
- **transition** is 1 where contact is NaN for that reason, else 0. Transitions stay in the dataset, for
  events and latency.
- **position**, **force** and the parts of the sliding velocity (**slip_across**, **slip_along**) are means
  over the touched time, where contact is 1. If the touch covers 90 %, at most a tenth of the window has no
  contact, and so no position. **force_std** is the deviation of the force within: how far one number can
  stand for the window.
- **slip** is 1 where contact is 1 and the touch slides for `sliding` of the touched time or more, 0 for
  `still` or less, and NaN between. Sliding is audible even in part of a window, so 50 % counts; a shorter
  slide is neither. Without contact, slip is undefined and NaN.
- **any other column** is its mean over the known time.

During the alignment taps, the drivers are off: windows that overlap this time have NaN in every label and
**calibrating** 1 (see `monochord.datasets.build`).
"""

from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, Share
from monochord.core.types import Flags, Floats, Truth
from monochord.core.units import Seconds

LabelColumns: TypeAlias = dict[str, Floats]
TOUCH_COLUMNS = ("position", "force", "slip_across", "slip_along", "slip_velocity")
"""Columns that are defined only during contact."""
SHARE_TOLERANCE = 1e-9
"""Tolerance for a share to meet a rule: shares are sums of rounded times."""
SETTLED = 1.0 - 1e-6
"""Smallest label ``settled``, a share of the window, from which its sound counts as settled."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LabelTrack:
    """Ground truth at times (n,) in s, one column (n,) per quantity; NaN where unknown."""

    time: Floats
    columns: dict[str, Floats]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules(Checked):
    """Shares of a window's time that decide its labels; see the module for each."""

    touched: Share = 0.9
    untouched: Share = 0.1
    sliding: Share = 0.5
    still: Share = 0.1
    known: Annotated[float, Meta(gt=0.0, le=1.0)] = 0.9
    hold: Annotated[Seconds, Meta(gt=0.0)] = 0.2

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        for low, high in (("untouched", "touched"), ("still", "sliding")):
            if getattr(self, low) >= getattr(self, high):
                given = f"label rule {low} {getattr(self, low):g}, {high} {getattr(self, high):g}"
                raise InputError(given, f"{low} below {high}")


RULES = Rules()


def window_labels(track: LabelTrack, begin: Floats, end: Floats, rules: Rules = RULES) -> LabelColumns:
    """Return the labels of windows, by the rules of this module, each (n,), NaN where not valid.

    `begin` and `end` (n,) are on the clock of `track`, in s; its column ``contact`` is 0 or 1, NaN where
    unknown. The result has ``contact``, ``transition``, ``position``, ``force``, ``force_std``, ``slip`` and
    the other columns of `track`. `InputError` refuses a track without ``contact``, or whose times go back.

    Examples
    --------
    >>> time = np.arange(0.0, 0.4, 0.01)
    >>> touched = (time >= 0.155).astype(float)
    >>> track = LabelTrack(time=time, columns={"contact": touched, "force": 2.0 * touched})
    >>> labels = window_labels(track, np.array([0.0, 0.1, 0.2]), np.array([0.1, 0.2, 0.3]))
    >>> labels["contact"].tolist(), labels["transition"].tolist(), labels["force"].tolist()
    ([0.0, nan, 1.0], [0.0, 1.0, 0.0], [nan, nan, 2.0])
    """
    if "contact" not in track.columns:
        given = f"labels with the columns {', '.join(track.columns) or 'none'}"
        raise InputError(given, "a column contact", "use --labels measured if force and pose were recorded")
    contact = track.columns["contact"]
    touching = contact >= 0.5
    others = [name for name in track.columns if name not in {"contact", "slip"}]
    rows: dict[str, tuple[Floats, bool]] = {  # values (m,), and whether only those during a touch count
        "contact": (np.where(np.isnan(contact), np.nan, touching), False),
        **{name: (track.columns[name], name in TOUCH_COLUMNS) for name in others},
    }
    if "slip" in track.columns:
        slip = track.columns["slip"]
        rows["slip"] = (np.where(np.isnan(slip), np.nan, slip >= 0.5), True)
    if "force" in track.columns:
        force = track.columns["force"]
        finite = np.isfinite(force)
        middle = np.where(finite, force, 0.0).sum() / max(finite.sum(), 1)  # keeps the squares small
        rows["force - middle"] = (force - middle, True)
        rows["its square"] = ((force - middle) ** 2, True)
    values, of_touch = zip(*rows.values(), strict=True)
    means = _TimeMeans(track.time, begin, end, rules).of(np.stack(values), np.array(of_touch), touching)
    mean = dict(zip(rows, means, strict=True))
    decided = _decide(mean["contact"], rules.touched, rules.untouched)
    in_contact = decided == 1.0
    transition = np.where(np.isnan(mean["contact"]), np.nan, np.isnan(decided))
    labels: LabelColumns = {"contact": decided, "transition": transition}
    unknown = np.full(len(begin), np.nan)
    for name in dict.fromkeys((*TOUCH_COLUMNS[:2], "slip", *track.columns)):
        if name == "contact":
            continue
        column = mean.get(name, unknown)
        if name == "slip":
            column = _decide(column, rules.sliding, rules.still)
        labels[name] = np.where(in_contact, column, np.nan) if name in (*TOUCH_COLUMNS, "slip") else column
    labels["force_std"] = unknown
    if "force" in track.columns:
        variance = mean["its square"] - mean["force - middle"] ** 2
        labels["force_std"] = np.where(in_contact, np.sqrt(np.maximum(variance, 0.0)), np.nan)
    return labels


def one_window_labels(track: LabelTrack, begin: Seconds, end: Seconds, rules: Rules = RULES) -> Truth:
    """Return the known labels of one window, by the same rules: the truth for a live window.

    Without a column ``contact``, the track has no touch labels; its other columns count.

    `begin` and `end` are on the clock of `track`, in s. Only the labels around the window are read, except at
    the end of the track; `InputError` refuses times that go back there.

    Examples
    --------
    >>> track = LabelTrack(time=np.arange(0.0, 1.0, 0.01), columns={"contact": np.ones(100)})
    >>> one_window_labels(track, 0.2, 0.3)
    {'contact': 1.0, 'transition': 0.0}
    """
    time = track.time
    if not time.size or begin >= time[-1] + rules.hold or end <= time[0]:
        return {}
    first, last = np.searchsorted(time, [begin, end])
    # The label before still holds, and the one after ends the last; how long the track's last one holds
    # follows from all of it.
    rows = slice(max(first - 1, 0), last + 1) if last < time.size else slice(None)
    unknown = {"contact": np.full(time[rows].size, np.nan)}
    near = LabelTrack(time=time[rows], columns=unknown | {n: c[rows] for n, c in track.columns.items()})
    labels = window_labels(near, np.array([begin]), np.array([end]), rules)
    return {name: float(value[0]) for name, value in labels.items() if not np.isnan(value[0])}


def _decide(share: Floats, high: float, low: float) -> Floats:
    """Return 1 for shares (n,) of `high` or more, 0 for `low` or less, NaN between."""
    uncertain = np.where(share <= low + SHARE_TOLERANCE, 0.0, np.nan)
    return np.where(share >= high - SHARE_TOLERANCE, 1.0, uncertain)


class _TimeMeans:
    """Means over the windows' time, of values that hold from one time to the next."""

    def __init__(self, time: Floats, begin: Floats, end: Floats, rules: Rules) -> None:
        distance = np.diff(time)
        if (distance < 0.0).any():
            raise InputError("labels whose times go back", "times in order")
        last = float(np.median(distance)) if distance.size else rules.hold
        self._durations = np.minimum(np.append(distance, last)[: time.size], rules.hold)
        self._time, self._begin, self._end, self._rules = time, begin, end, rules

    def of(self, values: Floats, of_touch: Flags, touching: Flags) -> Floats:
        """Return the means (rows, n) of values (rows, m).

        Rows `of_touch` count over the times `touching` (m,) only.

        A mean is NaN where less than the share `known` of its time has a value.
        """
        known = np.isfinite(values)
        known[of_touch] &= touching
        time = self._integrals(known)
        touched = self._integrals(touching[None])
        due = np.where(of_touch[:, None], touched, self._end - self._begin)
        enough = (time >= self._rules.known * due - SHARE_TOLERANCE) & (time > SHARE_TOLERANCE)
        area = self._integrals(np.where(known, values, 0.0))
        return np.where(enough, area / np.where(enough, time, 1.0), np.nan)

    def _integrals(self, heights: Floats | Flags) -> Floats:
        """Return the integrals over the windows, (rows, n), of step functions with heights (rows, m)."""
        ends = self._time + self._durations
        if len(self._begin) == 1:  # a dot product: quick enough for who labels every window live
            overlap = np.minimum(ends, self._end) - np.maximum(self._time, self._begin)
            return heights.astype(np.float64) @ np.maximum(overlap, 0.0)[:, None]
        integrals = np.zeros((len(heights), len(self._begin)))
        if not self._time.size:
            return integrals
        knots = np.stack([self._time, ends], axis=1).ravel()
        rises = np.zeros(knots.size)
        for row, height in enumerate(heights):
            rises[1::2] = height * self._durations
            area = np.cumsum(rises)
            integrals[row] = np.interp(self._end, knots, area) - np.interp(self._begin, knots, area)
        return integrals
