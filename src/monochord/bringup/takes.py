"""Where the sound of each step comes from: a folder of recordings, a live source, or the virtual sensor."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from monochord.bringup.check import Take
from monochord.bringup.rehearsal import rehearse
from monochord.bringup.steps import LOOPBACK, Step
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.physics.twin import Sensor

SUFFIXES = ".wav", ".flac"


def recordings(folder: Path, steps: tuple[Step, ...]) -> dict[str, Take]:
    """Return the takes of a folder: one wav or flac file for each step, named after it, where it is there.

    Raises
    ------
    InputError
        If the folder does not exist, holds no such file, or a file cannot be read.
    """
    if not folder.is_dir():
        raise InputError(f"folder '{folder}'", "an existing folder with one recording for each step")
    takes: dict[str, Take] = {}
    names = [step.name for step in steps] + [LOOPBACK]
    for name in dict.fromkeys([*names, "drift"]):
        files = [folder / f"{name}{suffix}" for suffix in SUFFIXES if (folder / f"{name}{suffix}").is_file()]
        if files:
            takes[name] = record(SOURCES.build("wav", {"path": str(files[0])}), float("inf"), str(files[0]))
    if not takes:
        allowed = ", ".join(f"{name}.wav" for name in names)
        raise InputError(f"folder '{folder}' without a recording of a step", allowed)
    return takes


def record(source: Source, seconds: float, name: str, *, started: Callable[[], None] = lambda: None) -> Take:
    """Return the sound of a source over some seconds, or until it ends; `started` is called once it is open.

    Raises
    ------
    InputError
        If the source has other than two channels, or ends without sound.
    DeviceError
        If a device is missing or lost.
    """
    blocks: list[np.ndarray] = []
    with source.open() as stream:
        signal = stream.signal
        if signal.channels != 2:
            raise InputError(f"{name} with {signal.channels} channel(s)", "2: one for each microphone")
        started()
        wanted, frames, dropped = seconds * signal.sample_rate, 0, 0
        begin = end = time.monotonic()
        for block in stream:
            end = time.monotonic()
            if block.adc_time is not None:  # a busy reader is late, the converter is not
                end = block.adc_time + block.samples.shape[1] / signal.sample_rate
            if not blocks:
                begin = end - block.samples.shape[1] / signal.sample_rate
            else:
                dropped += block.dropped
            blocks.append(block.samples)
            frames += block.samples.shape[1]
            if frames + dropped >= wanted:
                break
        paced = stream.paced
    if not blocks:
        raise InputError(f"{name} without sound", "1 s or more")
    samples = np.concatenate(blocks, axis=1)
    elapsed = end - begin if paced and frames >= signal.sample_rate else None
    return Take(
        samples=samples, sample_rate=signal.sample_rate, source=name, elapsed=elapsed, dropped=dropped
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """A live source, opened anew for each step; `prompt` is called before, `started` once it records."""

    source: Source
    name: str
    prompt: Callable[[Step], None] = lambda _: None
    started: Callable[[], None] = field(default=lambda: None)

    def take(self, step: Step) -> Take:
        """Record one step."""
        self.prompt(step)
        return record(self.source, step.seconds, self.name, started=self.started)


@dataclass(frozen=True, slots=True, kw_only=True)
class Virtual:
    """The virtual sensor, on which every step carries itself out."""

    sensor: Sensor
    seed: int = 0
    sample_rate: int = 44100

    def take(self, step: Step) -> Take:
        """Simulate one step."""
        samples = rehearse(self.sensor, step.name, step.seconds, seed=self.seed, sample_rate=self.sample_rate)
        return Take(samples=samples, sample_rate=self.sample_rate, source="twin")
