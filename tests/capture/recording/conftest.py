"""Jobs of a paced sound and of a simulated force sensor, both real to the recorder."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.instruments.base import Instrument
from monochord.capture.recording import RecordingJob
from monochord.capture.sources import SOURCES
from monochord.lab.net_ft_device import NetFtDevice, NetFtSettings

RATE = 44100
MakeJob = Callable[..., RecordingJob]
Force = Callable[..., tuple[NetFtDevice, Instrument]]


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    """Two seconds of two microphones: noise, the second at half the level."""
    samples = np.random.default_rng(0).uniform(-0.5, 0.5, (2 * RATE, 2)).astype(np.float32)
    path = tmp_path / "sound.wav"
    soundfile.write(path, samples * [1.0, 0.5], RATE, subtype="FLOAT")
    return path


@pytest.fixture
def make_job(tmp_path: Path, sound: Path) -> MakeJob:
    """Return what makes a job of the sound, over and over at the pace of real time unless asked otherwise."""

    def make(path: Path | None = None, *, name: str = "take.mcap", **more: Any) -> RecordingJob:
        options = {"path": str(path or sound), "speed": 1.0, "repeat": 0, **more.pop("source", {})}
        return RecordingJob(path=tmp_path / name, source=SOURCES.build("wav", options), **more)

    return make


@pytest.fixture
def force() -> Iterator[Force]:
    """Return what starts a force sensor that feels a ramp, and gives the instrument that reads it."""
    devices: list[NetFtDevice] = []

    def start(rate: float = 1000.0, **settings: Any) -> tuple[NetFtDevice, Instrument]:
        ramp = np.outer(np.arange(100_000), [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0])
        device = NetFtDevice(ramp, NetFtSettings(rate=rate, **settings))
        devices.append(device)
        options = {"address": device.address, "http_port": device.http_port}
        return device, INSTRUMENTS.build("net_ft", options)

    yield start
    for device in devices:
        device.close()
