"""What is begun from the page besides touches: a recording, and tuning and calibration step by step.

Both steps record, and hand the session to the functions of ``monochord tune`` and ``monochord calibrate``.
Files are named here: nothing that a page sends is part of a path.
"""

import tempfile
import threading
from abc import ABC, abstractmethod
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from statistics import fmean
from typing import Any, TypeAlias

import numpy as np

from monochord.capture.sources import SOURCES
from monochord.core.dated import dated_path
from monochord.core.errors import MonochordError
from monochord.core.files import replacing
from monochord.core.types import Signal
from monochord.core.units import Metres, Newtons, Seconds
from monochord.live.delivery import reason
from monochord.live.sinks.base import Moment
from monochord.live.tuning import SECONDS, tuned
from monochord.live.web.recording import Recording
from monochord.physics.known_touches import why_impossible

UNTOUCHED: Seconds = 2.0
"""How much of the untouched string is recorded before the first touch: features are relative to it."""
HOLD: Seconds = 1.2
"""How long a known touch is recorded."""
STILL: Metres = 1e-3
"""A touch that moves by more than this is not held."""
PLACES, FORCES = (0.2, 0.8), (0.4, 1.6)
"""Ranges of the touches that are proposed: shares of the length where no sensing range is known, and N."""
MARGIN = 0.05
"""Share of the sensing range at each end in which no touch is proposed: nobody presses to the millimetre."""
Row: TypeAlias = tuple[Seconds, Seconds, Metres, Newtons]
"""A known touch: begin and end in the session, position, force."""


class Guided(ABC):
    """A recording that ends by itself, and what is done with it."""

    def __init__(self, signal: Signal, folder: Path) -> None:
        self._scratch = tempfile.TemporaryDirectory(prefix="monochord-page-", ignore_cleanup_errors=True)
        self._folder = folder
        self.recording = Recording(Path(self._scratch.name) / "recorded.mcap", signal)

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether enough is recorded."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Return what a person is to do now."""

    @abstractmethod
    def result(self) -> list[str]:
        """Compute, save, and return the result as lines; the recording is closed."""

    def take(self, moment: Moment) -> None:
        """Take a moment of the run."""
        self.recording.take(moment)

    def close(self) -> None:
        """Remove the recording."""
        self.recording.close()
        self._scratch.cleanup()


class Tuning(Guided):
    """Listen to the untouched string, and write the sensor as tuned."""

    @property
    def complete(self) -> bool:
        """Whether the untouched string was recorded for long enough."""
        return self.recording.seconds >= SECONDS

    def state(self) -> dict[str, Any]:
        """Return how much was recorded."""
        return {"says": "Let go of the string.", "share": min(self.recording.seconds / SECONDS, 1.0)}

    def result(self) -> list[str]:
        """Write a file as ``monochord tune`` does."""
        source = SOURCES.build("session", {"path": str(self.recording.path)})
        path = dated_path("sensor", ".toml", self._folder)
        sensor = tuned([source], ["the page's recording"])
        sensor = replace(sensor, time=datetime.now(UTC).isoformat(timespec="seconds"))
        with replacing(path) as part:
            part.write_text(sensor.toml(), encoding="utf-8")
        return [*sensor.lines(), f"Written to {path}; use it by --sensor {path}"]


class Calibration(Guided):
    """Record touches of known position and force, and adapt the model to them.

    A simulated string states both by itself, once a touch is held still. Otherwise a person types them.
    """

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
        """Whether all touches were made."""
        return len(self.rows) >= self._count

    def hold(self, position: Metres, force: Newtons) -> bool:
        """Take a touch from now on as one of this position and force; return whether that could be done."""
        begin = self.recording.seconds
        if self._states_truth or self._known or begin < UNTOUCHED or self.complete:
            return False
        wrong = why_impossible(np.array([position]), np.array([force]), self._string)
        self._refusal = f"{wrong.given} cannot be: allowed is {wrong.allowed}." if wrong else ""
        if wrong or not 0.0 < position < self._length or self._is_outside(position):
            return False
        self._known = (begin, begin + HOLD, position, force)
        return True

    def take(self, moment: Moment) -> None:
        """Take a moment, and note a touch that was held long enough."""
        super().take(moment)
        now = self.recording.seconds
        self._states_truth = self._states_truth or bool(moment.truth)
        if now < UNTOUCHED or self.complete:
            return
        if self._states_truth:
            self._watch(moment, now)
        elif self._known is not None and now >= self._known[1]:
            self.rows.append(self._known)
            self._known = None

    def _watch(self, moment: Moment, now: Seconds) -> None:
        truth = moment.truth
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
        self._touch_windows.append((now - moment.window.duration, now, truth["position"], truth["force"]))
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

    def _proposed(self, number: int) -> tuple[Metres, Newtons]:
        """Return the position and force of a touch: however many there are, both are spread evenly."""
        low, high = self._range or (0.0, self._length)
        first, last = PLACES if self._range is None else (MARGIN, 1.0 - MARGIN)
        along, hard = (0.5 + 0.618034 * number) % 1.0, (0.3 + 0.381966 * number) % 1.0
        place = low + (first + (last - first) * along) * (high - low)
        return place, FORCES[0] + (FORCES[1] - FORCES[0]) * hard

    def state(self) -> dict[str, Any]:
        """Return which touch is to be made, and how far it is held."""
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
            if self._outside and self._range is not None:
                low, high = (f"{1e3 * end:g}" for end in self._range)
                says = f"This is outside the sensing range, {low} to {high} mm. {says}"
            says = f"{self._refusal} {says}".strip()
        return state | {
            "says": says,
            "share": min(duration / HOLD, 1.0),
            "position": position,
            "force": force,
        }

    def result(self) -> list[str]:
        """Save a model as ``monochord calibrate`` does."""
        from monochord.capture.recording.from_files import from_files  # noqa: PLC0415  (not needed until then)
        from monochord.perception.training.calibration import calibrated  # noqa: PLC0415  (likewise)

        folder = Path(self._scratch.name)
        table, session = folder / "touches.csv", folder / "touches.mcap"
        rows = [",".join(f"{value:.6f}" for value in row) for row in self.rows]
        table.write_text("\n".join(["begin,end,position,force", *rows]), encoding="utf-8")
        from_files(self.recording.path, table, session)
        out = dated_path("calibrated", folder=self._folder)
        result = calibrated(self._model, [str(session)], out, sensing_range=self._range)
        head = "Errors of touches that were left out, by cross-validation:"
        return [head, *result.lines(), f"Saved as {out}; use it by: monochord live {out}"]


class Bench:
    """What the pages of one run began: `take` is called by the sink, all else by the server.

    Parameters
    ----------
    signal, length
        What the source says of its audio, and the string's length.
    folder
        Where files are made.
    model
        The model that a calibration adapts; empty where none answers.
    """

    def __init__(self, signal: Signal, length: Metres, folder: Path, model: str) -> None:
        self._signal, self._length, self._model = signal, length, model
        self._folder = folder.absolute()
        self._desk = ThreadPoolExecutor(1, thread_name_prefix="page")  # for what may take a while
        self._busy = threading.Lock()
        self._recording: Recording | None = None
        self._guided: Guided | None = None
        self._computing = False
        self._lines: list[str] = []
        self._saved = ""

    def record(self, *, on: bool) -> bool:
        """Begin a recording, or end it; return whether there was anything to do."""
        if on is (self._recording is not None):
            return False
        return self._later(self._begin if on else self._end)

    def tune(self) -> bool:
        """Begin to tune."""
        return self._guide(lambda: Tuning(self._signal, self._folder))

    def calibrate(self, count: int) -> bool:
        """Begin to calibrate by so many touches."""
        model, length = self._model, self._length
        make = lambda: Calibration(self._signal, self._folder, length, model, count)  # noqa: E731
        return bool(model) and self._guide(make)

    def hold(self, position: Metres, force: Newtons) -> bool:
        """Take a touch from now on as one of this position and force."""
        return isinstance(self._guided, Calibration) and self._guided.hold(position, force)

    def cancel(self) -> bool:
        """End a guided step without a result, or put its result away."""
        self._lines = []
        guided = self._guided
        if guided is None or self._computing or not self._later(guided.close):
            return guided is None
        self._guided = None
        return True

    def take(self, moment: Moment) -> None:
        """Take a moment of the run."""
        recording, guided = self._recording, self._guided
        if recording is not None:
            recording.take(moment)
            if recording.failure:
                self._later(self._end)
        if guided is not None and not self._computing:
            guided.take(moment)
            if guided.complete or guided.recording.failure:
                self._computing = True
                self._desk.submit(self._compute, guided)

    def state(self) -> Mapping[str, Any]:
        """Return what the page shows of it."""
        recording, guided = self._recording, self._guided
        state: dict[str, Any] = {"calibrates": bool(self._model), "saved": self._saved, "lines": self._lines}
        if recording is not None:
            state["recording"] = {"path": str(recording.path), "seconds": round(recording.seconds, 1)}
        if guided is not None:
            state["guided"] = {"says": "Computing …"} if self._computing else guided.state()
            state["guided"]["name"] = type(guided).__name__.lower()
        return state

    def close(self) -> None:
        """Complete a recording, and leave what is not done; nothing is begun after that."""
        self._busy.acquire()
        self._desk.submit(self._end)
        self._desk.shutdown(wait=True)
        if self._guided is not None:
            self._guided.close()

    def _later(self, work: Any) -> bool:
        """Have something done at the desk, unless it is occupied."""
        if not self._busy.acquire(blocking=False):
            return False

        def done() -> None:
            try:
                work()
            except (MonochordError, OSError) as error:
                self._saved = reason(error)
            finally:
                self._busy.release()

        self._desk.submit(done)
        return True

    def _begin(self) -> None:
        self._saved = ""
        self._recording = Recording(dated_path("live", ".mcap", self._folder), self._signal)

    def _end(self) -> None:
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.close()
        sentence = f"{recording.seconds:.1f} s recorded: {recording.path}"
        self._saved = f"{sentence}; it ended: {recording.failure}" if recording.failure else sentence

    def _guide(self, make: Any) -> bool:
        def begin() -> None:
            self._lines, self._guided = [], make()

        return self._guided is None and self._later(begin)

    def _compute(self, guided: Guided) -> None:
        try:
            guided.recording.close()
            self._lines = [guided.recording.failure] if guided.recording.failure else guided.result()
        except (MonochordError, OSError) as error:
            self._lines = [reason(error)]
        finally:
            self._guided, self._computing = None, False
            guided.close()
