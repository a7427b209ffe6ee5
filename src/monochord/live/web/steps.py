"""Guided tuning and calibration, step by step, for the page.

Both record a session and pass it to the functions of ``monochord tune`` and ``monochord calibrate``. Files
are named here: nothing sent by a page becomes part of a path.
"""

import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from monochord.capture.sources import SOURCES
from monochord.core.dated import dated_path
from monochord.core.files import replacing
from monochord.core.types import Signal
from monochord.core.units import Metres, Newtons, Seconds
from monochord.live.sinks.base import Update
from monochord.live.tuning import SECONDS, SensorAsTuned, tuned
from monochord.live.web.recording import Recording
from monochord.physics.known_touches import why_impossible

if TYPE_CHECKING:
    from monochord.perception.training.adaptation import Adaptation

UNTOUCHED: Seconds = 2.0
"""Duration of untouched sound before the first touch, in s: features are relative to it."""
HOLD: Seconds = 1.2
"""Duration of a labelled touch, in s."""
STILL: Metres = 1e-3
"""Largest motion of a held touch, in m."""
PLACES, FORCES = (0.2, 0.8), (0.4, 1.6)
"""Ranges of proposed touches: shares of the length where no sensing range is known, and force in N."""
MARGIN = 0.05
"""Share of the sensing range at each end without proposed touches: hands are not that precise."""
Check: TypeAlias = Callable[..., None]
"""Called with the progress of a computation as text."""
Row: TypeAlias = tuple[Seconds, Seconds, Metres, Newtons]
"""A labelled touch: begin and end in the session, position, force."""


class Guided(ABC):
    """A recording that ends by itself, and its evaluation."""

    def __init__(self, signal: Signal, folder: Path) -> None:
        self._scratch = tempfile.TemporaryDirectory(prefix="monochord-page-", ignore_cleanup_errors=True)
        self._folder = folder
        self.recording = Recording(Path(self._scratch.name) / "recorded.mcap", signal)

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether the recording is long enough."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Return the next instruction to the user."""

    @abstractmethod
    def compute(self, check: Check) -> None:
        """Compute the result from the closed recording.

        `check` is called now and then, and raises after a cancellation.
        """

    @abstractmethod
    def save(self) -> list[str]:
        """Save the result, and return it as lines."""

    def take(self, update: Update) -> None:
        """Add an update of the run."""
        self.recording.take(update)

    def close(self) -> None:
        """Remove the recording."""
        self.recording.close()
        self._scratch.cleanup()


class Tuning(Guided):
    """Record the untouched string, and write the tuned sensor."""

    _sensor: SensorAsTuned

    @property
    def complete(self) -> bool:
        """Whether the untouched string has been recorded long enough."""
        return self.recording.seconds >= SECONDS

    def state(self) -> dict[str, Any]:
        """Return how much has been recorded."""
        return {"says": "Let go of the string.", "share": min(self.recording.seconds / SECONDS, 1.0)}

    def compute(self, check: Check) -> None:
        """Tune as ``monochord tune`` does."""
        check()
        source = SOURCES.build("session", {"path": str(self.recording.path)})
        sensor = tuned([source], ["the page's recording"])
        self._sensor = replace(sensor, time=datetime.now(UTC).isoformat(timespec="seconds"))

    def save(self) -> list[str]:
        """Write the sensor's file."""
        path = dated_path("sensor", ".toml", self._folder)
        with replacing(path) as part:
            part.write_text(self._sensor.toml(), encoding="utf-8")
        return [*self._sensor.lines(), f"Saved as {path}; use it with --sensor {path}"]


class Calibration(Guided):
    """Record touches of known position and force, and adapt the model to them.

    A simulated string provides both once a touch is held still. Otherwise the user types them.
    """

    _adapted: "Adaptation"

    def __init__(self, signal: Signal, folder: Path, length: Metres, model: str, count: int) -> None:
        super().__init__(signal, folder)
        self._length, self._model, self._count = length, model, count
        self._string, self._refusal = signal.string, ""
        self.rows: list[Row] = []
        self._touch_windows: list[Row] = []  # windows of the present touch, of a string that states its truth
        self._known: Row | None = None  # the present touch as it was typed
        self._free = self._states_truth = self._outside = False
        self._range = signal.sensing_range

    @property
    def complete(self) -> bool:
        """Whether all touches are done."""
        return len(self.rows) >= self._count

    def hold(self, position: Metres, force: Newtons) -> bool:
        """Record a touch from now on with this position and force; return whether that was possible."""
        begin = self.recording.seconds
        if self._states_truth or self._known or begin < UNTOUCHED or self.complete:
            return False
        self._refusal = self._why_not(position, force)
        if self._refusal:
            return False
        self._known = (begin, begin + HOLD, position, force)
        return True

    def _why_not(self, position: Metres, force: Newtons) -> str:
        """Return why a touch of this position and force is impossible, empty where it is possible."""
        wrong = why_impossible(np.array([position]), np.array([force]), self._string)
        if wrong:
            return f"{wrong.given} is impossible: expected {wrong.expected}."
        if not 0.0 < position < self._length:
            return f"{1e3 * position:g} mm is not on the string, which is {1e3 * self._length:g} mm long."
        return self._outside_range(f"{1e3 * position:g} mm") if self._is_outside(position) else ""

    def take(self, update: Update) -> None:
        """Add an update, and note a touch that was held long enough."""
        super().take(update)
        now = self.recording.seconds
        self._states_truth = self._states_truth or bool(update.truth)
        if now < UNTOUCHED or self.complete:
            return
        if self._states_truth:
            self._watch(update, now)
        elif self._known is not None and now >= self._known[1]:
            self.rows.append(self._known)
            self._known = None

    def _watch(self, update: Update, now: Seconds) -> None:
        truth = update.truth
        if truth.get("contact") != 1.0 or truth.get("slip") != 0.0 or not {"position", "force"} <= {*truth}:
            self._touch_windows, self._outside = [], False
            self._free = self._free or truth.get("contact") == 0.0
            return
        self._outside = self._is_outside(truth["position"])
        if self._outside:
            self._touch_windows = []
            return
        if not self._free:
            return
        self._touch_windows.append((now - update.window.duration, now, truth["position"], truth["force"]))
        begin, _, position, _ = self._touch_windows[0]
        if abs(truth["position"] - position) > STILL:
            self._touch_windows = self._touch_windows[-1:]
        elif now - begin >= HOLD:
            place, force = (fmean(row[k] for row in self._touch_windows) for k in (2, 3))
            self.rows.append((begin, now, place, force))
            self._touch_windows, self._free = [], False  # the next one follows a release

    def _is_outside(self, position: Metres) -> bool:
        rounded = round(position, 6)  # a label at an end may be off by its 32 bits
        return self._range is not None and not self._range[0] <= rounded <= self._range[1]

    def _outside_range(self, what: str) -> str:
        low, high = (f"{1e3 * end:g}" for end in self._range or (0.0, self._length))
        return f"{what} is outside the sensing range, {low} to {high} mm."

    def _proposed(self, number: int) -> tuple[Metres, Newtons]:
        """Return the position and force of a proposed touch.

        Both are spread evenly for any number of touches.
        """
        low, high = self._range or (0.0, self._length)
        first, last = PLACES if self._range is None else (MARGIN, 1.0 - MARGIN)
        along, hard = (0.5 + 0.618034 * number) % 1.0, (0.3 + 0.381966 * number) % 1.0
        place = low + (first + (last - first) * along) * (high - low)
        return place, FORCES[0] + (FORCES[1] - FORCES[0]) * hard

    def state(self) -> dict[str, Any]:
        """Return the next touch to make, and the progress of the present one."""
        now, count = self.recording.seconds, len(self.rows)
        state: dict[str, Any] = {"of": self._count, "count": count, "typed": not self._states_truth}
        if now < UNTOUCHED:
            return state | {"says": "Let go of the string.", "share": now / UNTOUCHED}
        present = self._known or next(iter(self._touch_windows), None)
        duration = now - present[0] if present else 0.0
        position, force = self._proposed(count)
        if self._states_truth and not self._free and count:
            says = "Let go of the string."
        elif duration:
            says = "Hold still."
        else:
            says = f"Press near {1e3 * position:.0f} mm with about {force:.1f} N, and hold still."
            refusal = self._outside_range("This") if self._outside else self._refusal
            says = f"{refusal} {says}".strip()
        return state | {
            "says": says,
            "share": min(duration / HOLD, 1.0),
            "position": position,
            "force": force,
        }

    def compute(self, check: Check) -> None:
        """Adapt the model as ``monochord calibrate`` does."""
        from monochord.capture.recording.from_files import from_files  # noqa: PLC0415  (not needed until then)
        from monochord.perception.training.calibration import calibrated  # noqa: PLC0415  (likewise)

        folder = Path(self._scratch.name)
        table, session = folder / "touches.csv", folder / "touches.mcap"
        rows = [",".join(f"{value:.6f}" for value in row) for row in self.rows]
        table.write_text("\n".join(["begin,end,position,force", *rows]), encoding="utf-8")
        from_files(self.recording.path, table, session)
        check()
        model, out = self._model, folder / "model"
        self._adapted = calibrated(model, [str(session)], out, sensing_range=self._range, progress=check)

    def save(self) -> list[str]:
        """Save the adapted model."""
        from monochord.perception.model import save  # noqa: PLC0415  (as above)

        out = dated_path("calibrated", folder=self._folder)
        save(self._adapted.model, out)
        head = "Errors on held-out touches, by cross-validation:"
        return [head, *self._adapted.lines(), f"Saved as {out}; use it with: monochord live {out}"]
