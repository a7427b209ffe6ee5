"""Sound of a touched string as stiff segments sing it, each held at a mode by its driver."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Audio, Signal, StringParams
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency, segment_inharmonicity, stiff_partials

RATE = 44100
STRING = load_string("prototype").string
Sing = Callable[..., Audio]


@pytest.fixture
def signal() -> Signal:
    """Two channels of the prototype's string."""
    return Signal(sample_rate=RATE, channels=2, string=STRING)


@pytest.fixture
def sing() -> Sing:
    """Return the function from a touch, or none, to a window (2, size) of which each end hears both sides."""
    return _sing


def _sing(
    position: float | None = None,
    modes: tuple[int, int] = (1, 1),
    *,
    tension: float = STRING.tension,
    size: int = 4410,
    partials: int = 1,
    decay: float = 0.0,
    loud: float = 0.2,
    crosstalk: float = 0.3,
) -> Audio:
    """Each side sounds at `partials` multiples of what its driver holds; untouched, both hold one string."""
    string = replace(STRING, tension=tension)
    time = np.arange(size) / RATE
    sides = (string.length,) * 2 if position is None else (position, string.length - position)
    tones: list[np.ndarray] = []
    for side, mode in zip(sides, modes, strict=True):
        line = _held(string, side, mode)
        sines = [np.sin(2.0 * np.pi * n * line * time + n) / n for n in range(1, partials + 1)]
        tones.append(loud * np.exp(-decay * time) * np.sum(sines, axis=0))
    both = np.stack(tones)
    if position is None:
        both = np.repeat(both.mean(axis=0, keepdims=True), 2, axis=0)
    hiss = 1e-6 * np.random.default_rng(3).standard_normal(both.shape)
    return (both + crosstalk * both[::-1] * (position is not None) + hiss).astype(np.float32)


def _held(string: StringParams, side: float, mode: int) -> float:
    fundamental = open_frequency(string) * string.length / side
    return stiff_partials(fundamental, segment_inharmonicity(string, side), float(mode))
