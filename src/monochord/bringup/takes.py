"""Where the sound of each step comes from: a folder of recordings, a live source, or the virtual sensor."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import TypeAlias

import numpy as np

from monochord.bringup.check import Take
from monochord.bringup.rehearsal import rehearse
from monochord.bringup.steps import LOOPBACK, Step
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.physics.twin import Sensor

SUFFIXES = ".wav", ".flac"
PLAYED: Seconds = 0.05
"""Length in s of the pieces in which a simulated step is played."""
OnAudio: TypeAlias = Callable[[Audio, int], None]
"""Gets sound as it comes, (2, n), with its sample rate."""


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


def ignore_audio(samples: Audio, sample_rate: int) -> None:
    """Pass over sound."""


def record(source: Source, seconds: float, name: str, *, on_audio: OnAudio = ignore_audio) -> Take:
    """Return the sound of a source over some seconds, or until it ends; `on_audio` gets each block.

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
            on_audio(block.samples, signal.sample_rate)
            frames += block.samples.shape[1]
            if frames + dropped >= wanted:
                break
        paced, simulated = stream.paced, stream.simulated
    if not blocks:
        raise InputError(f"{name} without sound", "1 s or more")
    samples = np.concatenate(blocks, axis=1)
    elapsed = end - begin if paced and frames >= signal.sample_rate else None
    return Take(
        samples=samples,
        sample_rate=signal.sample_rate,
        source=name,
        elapsed=elapsed,
        dropped=dropped,
        simulated=simulated,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """A live source, opened anew for each step; `on_audio` gets its sound as it comes."""

    source: Source
    name: str
    on_audio: OnAudio = ignore_audio

    def take(self, step: Step) -> Take:
        """Record one step."""
        return record(self.source, step.seconds, self.name, on_audio=self.on_audio)

    def listen(self, ended: Event) -> None:
        """Pass on the audio until an event; raises `DeviceError` for a device that is missing or lost."""
        with self.source.open() as stream:
            Thread(target=lambda: (ended.wait(), stream.close()), daemon=True).start()
            for block in stream:
                if ended.is_set():
                    return
                self.on_audio(block.samples, stream.signal.sample_rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class Virtual:
    """The virtual sensor, on which every step carries itself out.

    `on_audio` gets the sound of a step in real time; without it a step takes no time.
    """

    sensor: Sensor
    seed: int = 0
    sample_rate: int = 44100
    on_audio: OnAudio | None = None

    def take(self, step: Step) -> Take:
        """Simulate one step."""
        samples = rehearse(self.sensor, step.name, step.seconds, seed=self.seed, sample_rate=self.sample_rate)
        if self.on_audio:
            size = round(PLAYED * self.sample_rate)
            for start in range(0, samples.shape[1], size):
                self.on_audio(samples[:, start : start + size], self.sample_rate)
                time.sleep(PLAYED)
        return Take(samples=samples, sample_rate=self.sample_rate, source="twin", simulated=True)

    def listen(self, ended: Event) -> None:
        """Return at once: there is no sound between the steps."""
