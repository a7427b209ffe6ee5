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
from typing import TYPE_CHECKING, Any, TypeAlias

from monochord.capture.sources import SOURCES
from monochord.core.dated import dated_path
from monochord.core.files import write_text
from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.labelled import table
from monochord.live.recording import Recording
from monochord.live.touch_guide import TouchGuide
from monochord.live.tuning import SECONDS, SensorAsTuned, tuned
from monochord.live.update import Update

if TYPE_CHECKING:
    from monochord.perception.training.adaptation import Adaptation

OnProgress: TypeAlias = Callable[..., None]
"""Called with the progress of a computation as text."""


class GuidedStep(ABC):
    """A recording that ends by itself, and its evaluation."""

    recording: Recording

    @property
    def touches(self) -> TouchGuide | None:
        """The guide through the touches that it asks for; None for a step without touches."""
        return None

    @property
    @abstractmethod
    def complete(self) -> bool:
        """Whether the recording is long enough."""

    @abstractmethod
    def state(self) -> dict[str, Any]:
        """Return the next instruction to the user."""

    @abstractmethod
    def compute(self, check: OnProgress) -> None:
        """Compute the result from the closed recording.

        `check` is called now and then, and raises after a cancellation.
        """

    @abstractmethod
    def save(self) -> list[str]:
        """Save the result, and return it as lines."""

    def take(self, update: Update) -> None:
        """Add an update of the run."""
        self.recording.take(update)

    def finish(self) -> bool:
        """End with what is recorded so far; return whether that makes a result."""
        return False

    @abstractmethod
    def close(self) -> None:
        """Complete or remove the recording."""


class GuidedTouches(GuidedStep):
    """A step that leads through touches of known position and force."""

    guide: TouchGuide

    @property
    def touches(self) -> TouchGuide:
        """The guide through the touches."""
        return self.guide

    @property
    def complete(self) -> bool:
        """Whether all touches are done, or the person has finished."""
        return self.guide.complete

    def state(self) -> dict[str, Any]:
        """Return the next touch to make, and the progress of the present one."""
        return self.guide.state()


class TemporaryGuidedStep(GuidedStep):
    """A step whose recording is removed at its end."""

    def __init__(self, signal: Signal, folder: Path) -> None:
        self._scratch = tempfile.TemporaryDirectory(prefix="monochord-page-", ignore_cleanup_errors=True)
        self._folder = folder
        self.recording = Recording(Path(self._scratch.name) / "recorded.mcap", signal)

    def close(self) -> None:
        """Remove the recording."""
        self.recording.close()
        self._scratch.cleanup()


class GuidedTuning(TemporaryGuidedStep):
    """Record the untouched string, and write the tuned sensor."""

    _sensor: SensorAsTuned

    @property
    def complete(self) -> bool:
        """Whether the untouched string has been recorded long enough."""
        return self.recording.seconds >= SECONDS

    def state(self) -> dict[str, Any]:
        """Return how much has been recorded."""
        return {"says": "Let go of the string.", "share": min(self.recording.seconds / SECONDS, 1.0)}

    def compute(self, check: OnProgress) -> None:
        """Tune as ``monochord tune`` does."""
        check()
        source = SOURCES.build("session", {"path": str(self.recording.path)})
        sensor = tuned([source], ["the page's recording"])
        self._sensor = replace(sensor, time=datetime.now(UTC).isoformat(timespec="seconds"))

    def save(self) -> list[str]:
        """Write the sensor's file."""
        path = dated_path("sensor", ".toml", self._folder)
        write_text(path, self._sensor.toml())
        return [*self._sensor.lines(), f"Saved as {path}; use it with --sensor {path}"]


class GuidedCalibration(GuidedTouches, TemporaryGuidedStep):
    """Record touches of known position and force, and adapt the model to them."""

    _adapted: "Adaptation"

    def __init__(self, signal: Signal, folder: Path, length: Metres, model: str, count: int) -> None:
        super().__init__(signal, folder)
        self.guide = TouchGuide(signal, length, count)
        self._model = model

    def take(self, update: Update) -> None:
        """Add an update, and show it to the guide."""
        super().take(update)
        self.guide.take(update, self.recording.seconds)

    def compute(self, check: OnProgress) -> None:
        """Adapt the model as ``monochord calibrate`` does."""
        from monochord.capture.recording.from_files import from_files  # noqa: PLC0415  (not needed until then)
        from monochord.perception.training.calibration import calibrated  # noqa: PLC0415  (likewise)

        folder = Path(self._scratch.name)
        labels, session = folder / "touches.csv", folder / "touches.mcap"
        labels.write_text(table(self.guide.rows), encoding="utf-8")
        from_files(self.recording.path, labels, session)
        check()
        model, out = self._model, folder / "model"
        span = self.guide.range
        self._adapted = calibrated(model, [str(session)], out, sensing_range=span, progress=check)

    def save(self) -> list[str]:
        """Save the adapted model."""
        out = dated_path("calibrated", folder=self._folder)
        self._adapted.model.save(out)
        head = "Errors on held-out touches, by cross-validation:"
        return [head, *self._adapted.lines(), f"Saved as {out}; use it with: monochord live {out}"]
