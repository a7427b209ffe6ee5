"""Guides a person with a ruler and a kitchen scale through touches of known position and force.

One touch after the other is proposed, heard in the sound or announced by a key, and gets its measured
position and force. The command ``monochord sessions label`` and the page show the same guide.
"""

import math
import threading
from collections.abc import Callable, Iterable
from functools import wraps
from statistics import fmean, median
from typing import Any, Concatenate, Literal, NamedTuple, ParamSpec, TypeAlias, TypeVar

import numpy as np

from monochord.core.types import Signal
from monochord.core.units import Metres, Newtons, Seconds
from monochord.live.update import Update
from monochord.physics.known_touches import TouchEstimates, beside_nodes, why_impossible

UNTOUCHED: Seconds = 2.0
"""Duration of untouched sound before the first touch, in s: features are relative to it."""
REST: Seconds = 1.0
"""Duration of untouched sound between two touches, in s."""
GUARD: Seconds = 0.4
"""Time without a label on either side of a change of contact, in s: a contact is heard up to 0.2 s late."""
UNHEARD = 3.0
"""How much longer `REST` and `GUARD` are where contact is not heard, and a person says it."""
SETTLE: Seconds = 0.3
"""Time from a heard touch to its label, in s: a hand takes as long to press."""
HOLD: Seconds = 1.2
"""Duration of a labelled touch, in s."""
STILL: Metres = 1e-3
"""Largest motion of a held touch, in m."""
PLACES, FORCES = (0.2, 0.8), (0.4, 1.6)
"""Ranges of proposed touches: shares of the length where no sensing range is known, and force in N."""
MARGIN = 0.05
"""Share of the sensing range at each end without proposed touches: hands are not that precise."""
TICK: Seconds = 1e-6
"""Rounding of times, in s."""
Phase: TypeAlias = Literal["rest", "press", "hold", "label"]
"""Let go; press; hold still; say position and force."""


S = TypeVar("S")
T = TypeVar("T")
P = ParamSpec("P")


def locked(method: Callable[Concatenate[S, P], T]) -> Callable[Concatenate[S, P], T]:
    """Let one thread at a time into the methods of an object."""

    @wraps(method)
    def one_at_a_time(self: S, *arguments: P.args, **options: P.kwargs) -> T:
        with self._lock:  # pyright: ignore[reportAttributeAccessIssue]
            return method(self, *arguments, **options)

    return one_at_a_time


class LabelRow(NamedTuple):
    """Labels of a part of a recording: from begin to end in s, position, force, and contact (0 or 1).

    Position and force are NaN where they are not known.
    """

    begin: Seconds
    end: Seconds
    position: Metres = math.nan
    force: Newtons = math.nan
    contact: float = 1.0


class _LabelledTouch(NamedTuple):
    """A labelled touch with the model's estimates of position, its standard error, and force."""

    row: LabelRow
    estimated: tuple[float, float, float]


class TouchGuide:
    """The touches of a recording, one after the other; its time is the recording's, in s.

    The signal's string limits what is possible, its sensing range what is proposed. A simulated string states
    position and force itself, once a touch is held still. A labelled touch lasts for `hold`, and `forces` is
    the range of proposed forces. A run and its commands may be in different threads.

    Examples
    --------
    >>> guide = TouchGuide(Signal(sample_rate=44100, channels=2, sensing_range=(0.05, 0.15)), 0.2, 3)
    >>> position, force = guide.proposed
    >>> round(position, 3), round(force, 2), guide.phase
    (0.103, 0.76, 'rest')
    """

    def __init__(
        self,
        signal: Signal,
        length: Metres,
        count: int,
        *,
        hold: Seconds = HOLD,
        forces: tuple[Newtons, Newtons] = FORCES,
    ) -> None:
        self.count, self.hold_seconds, self.range = count, hold, signal.sensing_range
        self.phase: Phase = "rest"
        self.refusal = self.doubt = ""
        self.states_truth = False
        self._string, self._length, self._forces = signal.string, length, forces
        self._now: Seconds = 0.0
        self._rests: list[LabelRow] = []
        self._touches: list[_LabelledTouch] = []
        self._skipped = 0
        self._since: Seconds = 0.0  # of the untouched string, or of the labelled part
        self._end: Seconds = math.nan  # of the labelled part
        self._contact: bool | None = None  # as heard, None where it is not
        self._by_key = False  # this touch, or the untouched string after it, is announced and not heard
        self._known: tuple[Metres, Newtons] | None = None
        self._windows: list[tuple[Metres, Newtons]] = []  # of a string that states its truth
        self._estimates: list[tuple[float, float, float]] = []
        self._finished = False
        self._lock = threading.RLock()

    @property
    def touches(self) -> list[LabelRow]:
        """The labelled touches, in order."""
        return [touch.row for touch in self._touches]

    @property
    def rows(self) -> list[LabelRow]:
        """Everything that is labelled, in order of time: touches, and parts without a touch."""
        return sorted([*self._rests, *self.touches])

    @property
    def complete(self) -> bool:
        """Whether all touches are labelled, or the person has finished."""
        return self._finished or len(self._touches) >= self.count

    @property
    def proposed(self) -> tuple[Metres, Newtons]:
        """Position and force of the touch to make, spread evenly for any number of touches; no nodes."""
        number = len(self._touches) + self._skipped
        low, high = self.range or (0.0, self._length)
        first, last = PLACES if self.range is None else (MARGIN, 1.0 - MARGIN)
        along, hard = (0.5 + 0.618034 * number) % 1.0, (0.3 + 0.381966 * number) % 1.0
        place = low + (first + (last - first) * along) * (high - low)
        place = beside_nodes(place, self._length)
        return place, self._forces[0] + (self._forces[1] - self._forces[0]) * hard

    @property
    def remaining(self) -> Seconds:
        """Time until the string may be touched, or until the touch has been held long enough, in s."""
        due = {"rest": self._rest, "hold": self.hold_seconds}.get(self.phase, 0.0)
        return max(self._since + due - self._now, 0.0)

    @property
    def lacks_label(self) -> bool:
        """Whether the present touch waits for position and force, or will."""
        return not self.states_truth and self._known is None and self.phase in ("press", "hold", "label")

    @locked
    def take(self, update: Update, now: Seconds) -> None:
        """Add the update of the window that ends at a time of the recording."""
        self._now = now
        self.states_truth = self.states_truth or bool(update.truth)
        if self.states_truth:
            self._contact = None if (truth := update.truth.get("contact")) is None else truth == 1.0
        else:
            self._contact = None if self._by_key else update.decided.get("contact")
        silent = update.decided.get("contact") is False
        if self.complete:
            return
        if self.phase == "rest":
            self._resting(silent=silent)
        elif self.phase == "press" and self._contact:
            self._begin_hold(now if self.states_truth else now + SETTLE)
        elif self.phase == "hold":
            self._holding(update)

    @locked
    def hold(self, position: Metres, force: Newtons) -> bool:
        """Give the present touch's position and force; NaN for one that was not measured.

        A touch that is not heard begins now. Returns whether that was possible; `refusal` may say why
        not.
        """
        if not self.lacks_label or self.complete:
            return False
        self.refusal = self._why_not(position, force)
        if self.refusal:
            return False
        self._known = (position, force)
        if self.phase == "press":
            self.announce()
        elif self.phase == "label":
            self._label()
        return True

    @locked
    def announce(self) -> bool:
        """Say by a key what is not heard: the string is let go, the touch is held, or it ends.

        Returns whether that was possible.
        """
        if self.complete or self.states_truth or self.phase == "label":
            return False
        if self.phase == "rest":
            if self._by_key or not self._contact:
                return False
            self._by_key, self._contact, self._since = True, None, self._now
        elif self.phase == "press":
            self._by_key = True
            self._begin_hold(self._now)
        elif self._now - self._since < SETTLE:
            return False
        else:
            self._end_hold(self._now)
        return True

    @locked
    def undo(self) -> bool:
        """Discard the present touch, or else the last labelled one; it is proposed again."""
        if self.complete:
            return False
        if self.phase not in ("hold", "label"):
            if not self._touches:
                return False
            self._touches.pop()
            self._doubt()
        self.refusal = ""
        self._begin_rest()
        return True

    @locked
    def skip(self) -> bool:
        """Propose another touch."""
        if self.phase not in ("rest", "press") or self.complete:
            return False
        self._skipped += 1
        return True

    def finish(self) -> None:
        """End with the touches so far."""
        self._finished = True

    @locked
    def state(self) -> dict[str, Any]:
        """Return the next instruction, the touch to make and the progress of the present one."""
        position, force = self.proposed
        state: dict[str, Any] = {
            "of": self.count, "count": len(self._touches), "typed": not self.states_truth,
            "phase": self.phase, "says": self.says(f"{1e3 * position:.0f} mm", f"{force:.1f} N"),
            "doubt": self.doubt, "lacks": self.lacks_label,
        }  # fmt: skip
        if self._is_first and self.phase == "rest":
            return state | {"share": 1.0 - self.remaining / self._rest}
        share = {"hold": 1.0 - self.remaining / self.hold_seconds, "label": 1.0}.get(self.phase, 0.0)
        return state | {"share": min(share, 1.0), "position": position, "force": force}

    def says(self, place: str, force: str) -> str:
        """Return the next instruction, with the proposed place and force as text."""
        if self.phase == "rest":
            next_ = "" if self._is_first else f" Next: {place} with {force}."
            says = f"Let go of the string.{next_}"
        elif self.phase == "label":
            says = "Recorded. Read ruler and scale, let go, and type both."
        elif self.phase == "hold" and (self._windows or not self.states_truth):
            says = "Hold still."
        else:
            says = f"Press near {place} with about {force}, and hold still."
        return f"{self.refusal} {says}".strip()

    @property
    def _is_first(self) -> bool:
        return not (self._touches or self._rests)

    @property
    def _rest(self) -> Seconds:
        return UNTOUCHED if self._is_first else REST * self._slower

    @property
    def _slower(self) -> float:
        """How much longer a person needs to say what is not heard."""
        return UNHEARD if self._contact is None else 1.0

    def _begin_rest(self) -> None:
        self.phase, self._since = "rest", self._now
        self._known, self._windows, self._estimates = None, [], []

    def _resting(self, *, silent: bool) -> None:
        if self._contact:
            self._since = self._now
        elif self._now - self._since >= self._rest - TICK:
            # What is heard counts again, unless it is a touch where there is none.
            self.phase, self._by_key = "press", self._by_key and not silent

    def _begin_hold(self, begin: Seconds) -> None:
        """Label the untouched part before a touch, and await the touch's begin."""
        first = self._since + (GUARD * self._slower if self._since > 0.0 else 0.0)
        if self._now - GUARD > first:
            self._rests.append(LabelRow(first, self._now - GUARD, contact=0.0))
        self.phase, self._since = "hold", begin
        self._windows, self._estimates = [], []
        self.refusal = ""

    def _holding(self, update: Update) -> None:
        if self._contact is False:
            self._begin_rest()
            self.refusal = "" if self.states_truth else "That touch was too short."
        elif self.states_truth and not self._is_still(update):
            return
        elif self._now > self._since:
            self._estimates.append(_estimates(update))
            if self._now - self._since >= self.hold_seconds - TICK:
                self._end_hold(self._now)

    def _is_still(self, update: Update) -> bool:
        """Return whether a touch of known truth is held still and in range; if not, its label begins anew."""
        truth = update.truth
        if truth.get("slip") != 0.0 or not {"position", "force"} <= {*truth}:
            self._windows = []
            return False
        position = truth["position"]
        self.refusal = self._outside_range("This") if self._is_outside(position) else ""
        if self.refusal:
            self._windows = []
            return False
        if not self._windows or abs(position - self._windows[0][0]) > STILL:
            self._windows, self._since = [], self._now - update.window.duration
        self._windows.append((position, truth["force"]))
        return True

    def _end_hold(self, end: Seconds) -> None:
        self.phase, self._end = "label", end
        if self.states_truth:
            position, force = (fmean(values) for values in zip(*self._windows, strict=True))
            self._known = (position, force)
        if self._known:
            self._label()

    def _label(self) -> None:
        assert self._known is not None
        columns = zip(*self._estimates, strict=True) if self._estimates else ((), (), ())
        position, std, force = map(_median, columns)
        row = LabelRow(self._since, self._end, *self._known)
        self._touches.append(_LabelledTouch(row, (position, std, force)))
        self._doubt()
        self.refusal = ""
        self._begin_rest()

    def _doubt(self) -> None:
        """Set why `calibrate` would refuse the labels so far, as a sentence; empty where it would not."""
        columns = np.array([(*touch.row[2:4], *touch.estimated) for touch in self._touches]).reshape(-1, 5).T
        wrong = why_impossible(columns[0], columns[1], self._string, TouchEstimates(*columns[2:]))
        self.doubt = _sentence(f"check the labels, {wrong.given}: {wrong.remedy}") if wrong else ""

    def _why_not(self, position: Metres, force: Newtons) -> str:
        """Return why a touch of this position and force is impossible, empty where it is possible."""
        if math.isnan(position) and math.isnan(force):
            return "Give a position, a force, or both."
        wrong = why_impossible(np.array([position]), np.array([force]), self._string)
        if wrong is not None:
            return _sentence(f"{wrong.given} is impossible, expected {wrong.expected}: {wrong.remedy}")
        if not (math.isnan(position) or 0.0 < position < self._length):
            return f"{1e3 * position:g} mm is not on the string, which is {1e3 * self._length:g} mm long."
        return self._outside_range(f"{1e3 * position:g} mm") if self._is_outside(position) else ""

    def _is_outside(self, position: Metres) -> bool:
        if self.range is None or math.isnan(position):
            return False
        return not self.range[0] <= round(position, 6) <= self.range[1]  # a label may be off by its 32 bits

    def _outside_range(self, what: str) -> str:
        low, high = (f"{1e3 * end:g}" for end in self.range or (0.0, self._length))
        return f"{what} is outside the sensing range, {low} to {high} mm."


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith("?") else ".")


def _estimates(update: Update) -> tuple[float, float, float]:
    """Return a window's estimates: position, its standard error and force; NaN where it abstains."""
    estimates = update.prediction.estimates
    position, force = estimates.get("position"), estimates.get("force")
    valid = position is not None and position.valid
    return (
        position.value if valid and position else math.nan,
        position.std if valid and position else math.nan,
        force.value if force is not None and force.valid else math.nan,
    )


def _median(values: Iterable[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return median(known) if known else math.nan
