"""Recording, guided tuning, guided calibration and guided touches, started from the page.

Commands from several pages arrive in one thread and take effect in order. A second thread opens and closes
files, a third computes results, and neither delays the commands.
"""

import math
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

from monochord.core.dated import dated_path
from monochord.core.types import Signal
from monochord.core.units import Metres, Newtons
from monochord.live.delivery import reason
from monochord.live.guides.labelling import GuidedLabelling
from monochord.live.guides.requests import Calibrate, Cancel, Hold, Label, Record, TouchAct, TouchStep, Tune
from monochord.live.guides.steps import GuidedCalibration, GuidedStep, GuidedTuning
from monochord.live.recording import Recording
from monochord.live.touch_guide import TouchGuide
from monochord.live.update import Update
from monochord.live.web.tasks import Tasks
from monochord.page.commands import Handlers
from monochord.physics.known_touches import in_newtons

MAX_WAITING = 16
"""Most files waiting to be opened or closed, as on a slow disk; further commands are refused."""
Name: TypeAlias = Literal["tuning", "calibration", "labelling"]
Phase: TypeAlias = Literal["opening", "recording", "computing", "saving"]
VERBS: Mapping[Name, str] = {
    "tuning": "Tune",
    "calibration": "Calibrate",
    "labelling": "Label touches",
}
"""Button label of each step."""

DURABLE = ("computing", "labelling")
"""A session that is being completed is not discarded."""
NOTHING: Mapping[str, Any] = MappingProxyType({})


@dataclass(eq=False, slots=True)
class _RequestedRecording:
    """A requested recording; `recording` is set once its file is open."""

    recording: Recording | None = None


@dataclass(eq=False, slots=True)
class _RequestedStep:
    """A requested guided step; `guided` is set once its file is open. A cancelled step keeps its phase."""

    name: Name
    guided: GuidedStep | None = None
    phase: Phase = "opening"


class _Cancelled(Exception):  # noqa: N818  (no error)
    """Raised in a computation that was cancelled."""


class RunTasks(Tasks):
    """The recordings and guided steps of a run: the sink calls `take`, the server everything else.

    A command takes effect at once, or `state` says why not. Files go to `folder`. A calibration adapts
    `model`, empty for none. `described` are options of a labelled session's `Description`, such as its
    sensor.
    """

    def __init__(
        self,
        signal: Signal,
        length: Metres,
        folder: Path,
        model: str,
        described: Mapping[str, Any] = NOTHING,
    ) -> None:
        self._described = described
        self._signal, self._length, self._model = signal, length, model
        self._folder = folder.absolute()
        self._files = ThreadPoolExecutor(1, thread_name_prefix="page-files")
        self._computer = ThreadPoolExecutor(1, thread_name_prefix="page-computer")
        self._lock = threading.Lock()  # of what was asked, never held for long
        self._waiting = 0
        self._closed = False
        self._take: _RequestedRecording | None = None
        self._step: _RequestedStep | None = None
        self._computed: _RequestedStep | None = None
        self._lines: list[str] = []
        self._saved = self._answer = ""

    @property
    def commands(self) -> Handlers:
        """What a page can ask, by type of request."""
        return {
            Record: lambda request: self.record(on=request.on),
            Tune: lambda _: self.tune(),
            Calibrate: lambda request: self.calibrate(request.touches),
            Label: lambda request: self.label(request.touches),
            Hold: self._typed,
            TouchStep: lambda request: self.touch(request.act),
            Cancel: lambda _: self.cancel(),
        }

    def record(self, *, on: bool) -> bool:
        """Start or end a recording; return whether that changed anything."""
        with self._lock:
            take = self._take
            if on is (take is not None) or not self._accepts("Record"):
                return False
            if take is None:
                self._take = begun = _RequestedRecording()
                self._later(lambda: self._begin(begun))
            else:
                self._stop(take)
        return True

    def tune(self) -> bool:
        """Start a tuning."""
        return self._guide("tuning", lambda: GuidedTuning(self._signal, self._folder))

    def calibrate(self, count: int) -> bool:
        """Start a calibration with a number of touches."""
        model, length = self._model, self._length
        make = lambda: GuidedCalibration(self._signal, self._folder, length, model, count)  # noqa: E731
        return bool(model) and self._guide("calibration", make)

    def label(self, count: int) -> bool:
        """Start to record a number of labelled touches."""
        signal, length, described = self._signal, self._length, self._described
        make = lambda: GuidedLabelling(signal, self._folder, length, count, described)  # noqa: E731
        return self._guide("labelling", make)

    def hold(self, position: Metres, force: Newtons) -> bool:
        """Give the present touch's position and force; one that is not heard begins now."""
        return self._guided(lambda guide: guide.hold(position, force))

    def _typed(self, request: Hold) -> bool:
        position, force = (math.nan if each is None else each for each in (request.position, request.force))
        return self.hold(position, in_newtons(force, request.unit))

    def touch(self, act: TouchAct) -> bool:
        """Announce, undo or skip a touch."""
        return self._guided(lambda guide: getattr(guide, act)())

    def _guided(self, act: Callable[[TouchGuide], bool]) -> bool:
        step = self._step
        guide = (
            step.guided.touches if step is not None and step.guided and step.phase == "recording" else None
        )
        return guide is not None and act(guide)

    def cancel(self) -> bool:
        """End a guided step without a result, or discard its result."""
        with self._lock:
            step, self._lines, self._answer = self._step, [], ""
            if step is not None and step.phase == "recording" and step.guided and step.guided.finish():
                return True  # with its next update
            if step is not None and (step.phase == "saving" or (step.phase, step.name) == DURABLE):
                self._answer = "Cancel came too late: the result is saved."
            elif step is not None:
                self._step = None
                if step.phase != "computing":  # else it is closed where it is computed
                    self._later(lambda: self._leave(step))
        return True

    def take(self, update: Update) -> None:
        """Add an update of the run."""
        take, step = self._take, self._step
        if take is not None and (recording := take.recording) is not None:
            recording.take(update)
            if recording.failure:
                with self._lock:
                    self._stop(take)
        if step is not None and (guided := step.guided) is not None and step.phase == "recording":
            guided.take(update)
            if guided.complete or guided.recording.failure:
                with self._lock:
                    if step is self._step and not self._closed:
                        step.phase = "computing"
                        self._computer.submit(self._compute, step, guided)

    def state(self) -> Mapping[str, Any]:
        """Return the state shown on the page."""
        take, step = self._take, self._step
        state: dict[str, Any] = {"calibrates": bool(self._model), "saved": self._saved, "lines": self._lines}
        state["answer"] = self._answer
        if take is not None:
            recording = take.recording
            path, seconds = (str(recording.path), recording.seconds) if recording else ("", 0.0)
            state["recording"] = {"path": path, "seconds": round(seconds, 1)}
        if step is not None:
            state["guided"] = {**self._shown(step), "name": step.name}
        return state

    def close(self) -> None:
        """Complete a recording and running computations, and cancel other steps; no new ones start."""
        with self._lock:
            self._closed = True
            if self._take is not None:
                self._stop(self._take)
            if (step := self._step) is not None and step.phase in ("opening", "recording"):
                self._step = None
                self._later(lambda: self._leave(step))
        self._files.shutdown(wait=True)
        self._computer.shutdown(wait=True)

    def _accepts(self, command: str) -> bool:
        """Return whether files can be opened or closed for a command; if not, the message says so."""
        accepts = self._waiting < MAX_WAITING and not self._closed
        why = "earlier files are still being written. Try again later."
        self._answer = "" if accepts else f"{command} refused: {why}"
        return accepts

    def _later(self, work: Callable[[], None]) -> None:
        """Queue a file to be opened or closed."""

        def done() -> None:
            try:
                work()
            finally:
                with self._lock:
                    self._waiting -= 1

        self._waiting += 1
        self._files.submit(done)

    def _begin(self, take: _RequestedRecording) -> None:
        self._saved = ""
        try:
            take.recording = Recording(dated_path("live", ".mcap", self._folder), self._signal)
        except Exception as error:  # noqa: BLE001  (the page says it, whatever it is)
            with self._lock:
                self._saved = reason(error)
                self._take = None if take is self._take else self._take

    def _stop(self, take: _RequestedRecording) -> None:
        """End a recording, unless already ended."""
        if take is self._take:
            self._take = None
            self._saved = "Completing the file …"
            self._later(lambda: self._end(take.recording))

    def _end(self, recording: Recording | None) -> None:
        if recording is None:  # its file could not be opened, which is said
            return
        recording.close()
        sentence = f"{recording.seconds:.1f} s recorded: {recording.path}"
        self._saved = f"{sentence}; it ended: {recording.failure}" if recording.failure else sentence

    def _guide(self, name: Name, make: Callable[[], GuidedStep]) -> bool:
        with self._lock:
            step = self._step
            if step is None and self._accepts(VERBS[name]):
                self._lines, self._step = [], (begun := _RequestedStep(name))
                self._later(lambda: self._open(begun, make))
                return True
            if step is not None and step.name != name:
                self._answer = f"{VERBS[name]} did not start: a {step.name} is in progress. Cancel it first."
            return False

    def _open(self, step: _RequestedStep, make: Callable[[], GuidedStep]) -> None:
        if step is not self._step:
            return
        try:
            step.guided = make()
            step.phase = "recording"
        except Exception as error:  # noqa: BLE001  (the page says it, whatever it is)
            self._finish(step, [reason(error)])

    def _leave(self, step: _RequestedStep) -> None:
        if step.guided is not None:
            step.guided.close()

    def _shown(self, step: _RequestedStep) -> dict[str, Any]:
        if step.phase == "opening" or step.guided is None:
            return {"says": "Opening a file …"}
        if step.phase == "recording":
            return step.guided.state()
        if self._computed in (None, step):
            return {"says": "Computing …"}
        return {"says": "Waiting for the cancelled computation to stop …"}

    def _compute(self, step: _RequestedStep, guided: GuidedStep) -> None:
        def check(*_: Any) -> None:
            if step is not self._step:
                raise _Cancelled

        self._computed, lines = step, list[str]()
        try:
            guided.recording.close()
            if guided.recording.failure:
                lines = [guided.recording.failure]
            else:
                guided.compute(check)
                with self._lock:
                    check()
                    step.phase = "saving"
                lines = guided.save()
        except _Cancelled:
            pass
        except Exception as error:  # noqa: BLE001  (the page says it, whatever it is)
            lines = [reason(error)]
        finally:
            guided.close()
            self._computed = None
            self._finish(step, lines)

    def _finish(self, step: _RequestedStep, lines: list[str]) -> None:
        with self._lock:
            if step is self._step:
                self._lines, self._step = lines, None
