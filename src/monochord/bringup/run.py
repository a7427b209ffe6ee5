"""Carries out a bring-up step by step, and writes what came of it."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

from monochord.bringup.check import Take
from monochord.bringup.examine import BringUp, examine
from monochord.bringup.page import page
from monochord.bringup.steps import Step
from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.physics.sensors import load_sensor, sensor_design


class Taking(Protocol):
    """Where takes come from: a live source or the virtual sensor."""

    def take(self, step: Step) -> Take:
        """Return the sound of one step."""
        ...


def bring_up(
    sensor: str,
    source: Taking,
    steps: Sequence[Step],
    *,
    after: Callable[[BringUp], None] = lambda _: None,
) -> BringUp:
    """Return the bring-up of a sensor, each step recorded from a source in turn.

    Parameters
    ----------
    sensor
        A preset's name, or a sensor's file.
    source
        Where the sound comes from.
    steps
        What to do, in order.
    after
        Called after each step with the bring-up of the steps so far.

    Raises
    ------
    InputError
        If the sensor is unknown, or the source is not of two channels.
    DeviceError
        If a device is missing or lost.
    """
    design = sensor_design(sensor)
    loaded, takes, result = load_sensor(design), dict[str, Take](), None
    for step in steps:
        takes[step.name] = source.take(step)
        result = examine(design, loaded, dict(takes), time=_now())
        after(result)
    if result is None:
        raise InputError("no step", "one or more")
    return result


def from_recordings(sensor: str, takes: dict[str, Take]) -> BringUp:
    """Return the bring-up of a sensor from recordings of its steps; raises `InputError` as `examine` does."""
    design = sensor_design(sensor)
    return examine(design, load_sensor(design), takes, time=_now())


def write(result: BringUp, out: Path) -> tuple[Path | None, Path]:
    """Write the sensor's file and, beside it, the report; return both paths, None for a file without pitch.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    text, report = result.toml(), out.with_suffix(".html")
    for path, content in ((out, text), (report, page(result))):
        if content is None:
            continue
        try:
            with replacing(path) as part:
                part.write_text(content, encoding="utf-8")
        except OSError as error:
            raise InputError(f"file {path} ({error.strerror})", "a writable path") from error
    return (out if text is not None else None), report


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
