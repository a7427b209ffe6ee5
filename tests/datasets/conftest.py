"""Small sessions and datasets: noise for sound, so that no two are alike, and touches of a second each."""

import shutil
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.types import Block
from monochord.datasets.build import BuildOptions, build_dataset
from monochord.datasets.store import Dataset, open_dataset
from monochord.sessions import Description, SessionClock, SessionWriter

RATE = 8000
SECONDS = 12.0
Write = Callable[..., Path]
Make = Callable[..., Dataset]


def sound(seed: int, seconds: float = SECONDS) -> np.ndarray:
    """Two channels of noise."""
    return 0.1 * np.random.default_rng(seed).normal(size=(2, round(seconds * RATE))).astype(np.float32)


def touches(seconds: float = SECONDS) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """A second of touch in every two, from 1 s on; it slides in the last half of every other touch."""
    time = np.arange(round(seconds * 100)) / 100
    touched = (time % 2.0 >= 1.0).astype(float)
    nan = np.where(touched > 0.0, 0.0, np.nan)
    return time, {
        "contact": touched,
        "position": 0.05 + 0.01 * np.floor(time / 2.0) + nan,
        "force": 0.5 + 0.1 * np.floor(time / 2.0) + nan,
        "slip": (time % 4.0 >= 3.5).astype(float) + nan,
    }


def write_session(
    home: Path,
    name: str,
    samples: np.ndarray | None = None,
    *,
    folder: str = "sessions",
    labels: Mapping[str, np.ndarray] | None = None,
    lost: tuple[int, int] = (0, 0),
    driven: tuple[float, float] | None = None,
    **description: Any,
) -> Path:
    """Write a session and return its file; `driven` is when its drivers come on and go off, in s."""
    samples = sound(sum(name.encode()) + len(name)) if samples is None else samples
    (home / folder).mkdir(exist_ok=True)
    path = home / folder / f"{name}.mcap"
    described = Description(name=name, sample_rate=RATE, **description)
    time, usual = touches(samples.shape[1] / RATE)
    with SessionWriter(path, described, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        for first, stop in ((0, lost[0]), (lost[1], samples.shape[1])):
            if stop > first:
                dropped = lost[1] - lost[0] if first else 0
                part = samples[:, first:stop]
                writer.audio(Block(samples=part, start=first, dropped=dropped, adc_time=first / RATE))
        writer.labels(time, usual if labels is None else labels)
        for at, state in zip(driven or (), ("on", "off"), strict=False):
            writer.event(at, "drivers", state)
    return path


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return what writes a session."""
    return partial(write_session, tmp_path)


def made(home: Path, sessions: Mapping[str, Mapping[str, Any]], **options: Any) -> Dataset:
    """Build a dataset of sessions, given as keywords of `write_session` by name."""
    files = [write_session(home, name, **options) for name, options in sessions.items()]
    number = sum(path.name.startswith("dataset") for path in home.iterdir())
    return build_dataset(files, home / f"dataset{number}", BuildOptions(**options))


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Return what builds a dataset of sessions in this test's folder."""
    return partial(made, tmp_path)


@pytest.fixture(scope="session")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Two sessions, of an object and a day each, to be read alone."""
    sessions = {"one": {"object": "wood", "day": 1}, "two": {"object": "steel", "day": 2}}
    return made(tmp_path_factory.mktemp("pair"), sessions)


@pytest.fixture
def own(pair: Dataset, tmp_path: Path) -> Dataset:
    """A copy of `pair` that a test may damage."""
    return open_dataset(shutil.copytree(pair.path, tmp_path / "own"))


@pytest.fixture(scope="session")
def several(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Ten sessions of three objects on five days, to be read alone."""
    bodies = ["plastic"] * 6 + ["wood"] * 2 + ["metal"] * 2
    about = [
        {"object": body, "material": body, "day": number % 5, "build": number % 4}
        for number, body in enumerate(bodies)
    ]
    return made(tmp_path_factory.mktemp("several"), {f"take{n}": each for n, each in enumerate(about)})
