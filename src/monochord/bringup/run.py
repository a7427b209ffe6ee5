"""Carries out a bring-up step by step, and writes what came of it."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

from monochord.bringup.check import Take
from monochord.bringup.examine import BringUp, examine
from monochord.bringup.page import page
from monochord.bringup.steps import Step
from monochord.core.errors import InputError, MonochordError
from monochord.core.files import usable_path, write_text
from monochord.physics.sensors import load_sensor, sensor_design

RECORD, SKIP, END = "record", "skip", "end"
"""What can be chosen before a step; the name of a step repeats that one first."""


class TakeSource(Protocol):
    """Where takes come from: a live source or the virtual sensor."""

    def take(self, step: Step) -> Take:
        """Return the sound of one step."""
        ...


class Guide:
    """Leads through the steps of a bring-up: this one records each in turn, others ask a person."""

    def choose(self, step: Step | None, result: BringUp | None) -> str:  # noqa: ARG002
        """Return `RECORD`, `SKIP`, `END` or a step's name; `step` is the next one, None after the last."""
        return RECORD if step else END

    def show(self, result: BringUp) -> None:
        """Take the bring-up of the steps so far, after each."""

    def failed(self, step: Step, error: MonochordError) -> None:  # noqa: ARG002
        """Take the error of a step; the step is asked again if this returns."""
        raise error


def bring_up(sensor: str, source: TakeSource, steps: Sequence[Step], guide: Guide | None = None) -> BringUp:
    """Return the bring-up of a sensor, its steps recorded from a source as a guide chooses.

    Parameters
    ----------
    sensor
        A preset's name, or a sensor's file.
    source
        Where the sound comes from.
    steps
        What to do, in order.
    guide
        What leads through the steps; by default each is recorded in turn.

    Raises
    ------
    InputError
        If the sensor is unknown, the source is not of two channels, or no step was recorded.
    DeviceError
        If a device is missing or lost.
    """
    design, guide = sensor_design(sensor), guide or Guide()
    loaded, takes, result = load_sensor(design), dict[str, Take](), None
    named, waiting = {step.name: step for step in steps}, list(steps)
    while True:
        step = waiting[0] if waiting else None
        choice = guide.choose(step, result)
        if choice in named:
            waiting = [named[choice], *(each for each in waiting if each.name != choice)]
            continue
        if step is None or choice == END:
            break
        if choice == RECORD:
            try:
                with_this = takes | {step.name: source.take(step)}
                result = examine(design, loaded, with_this, time=_now())
            except MonochordError as error:
                guide.failed(step, error)
                continue
            takes = with_this
            guide.show(result)
        waiting.pop(0)
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
        with usable_path(f"file {path}", "a writable path"):
            write_text(path, content)
    return (out if text is not None else None), report


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
