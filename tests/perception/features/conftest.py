"""Sound of a touched string: stiff segments, each sustained at a mode by its driver."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES
from monochord.physics.strings import load_string
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials

RATE = 44100
STRING = load_string("prototype").string
Sing = Callable[..., Audio]
Row = Callable[..., dict[str, float]]


@pytest.fixture
def signal() -> Signal:
    """Two channels of the prototype's string."""
    return Signal(sample_rate=RATE, channels=2, string=STRING)


@pytest.fixture
def row(signal: Signal) -> Row:
    """Return the function from a feature and a window (2, size) to its row by column."""

    def extracted(feature: str, window: Audio, **options: object) -> dict[str, float]:
        extract = FEATURES.build(feature, options).prepare(signal, window.shape[1])
        return dict(zip(extract.columns, extract(window[np.newaxis])[0].tolist(), strict=True))

    return extracted


@pytest.fixture
def sing() -> Sing:
    """Return the function from a touch, or none, to a window (2, size); each end picks up both segments."""
    return _sing


def _sing(
    position: float | None = None,
    modes: tuple[int, int] = (1, 1),
    *,
    tension: float = STRING.tension,
    size: int = 4410,
    partials: int = 1,
    decay: float = 0.0,
    crosstalk: float = 0.3,
) -> Audio:
    """Each segment sounds at `partials` multiples of its sustained mode; untouched, both are the string."""
    string = replace(STRING, tension=tension)
    time = np.arange(size) / RATE
    segments = (string.length,) * 2 if position is None else (position, string.length - position)
    tones: list[np.ndarray] = []
    for length, mode in zip(segments, modes, strict=True):
        fundamental = open_frequency(string) * string.length / length
        line = stiff_partials(fundamental, inharmonicity(string, length), float(mode))
        sines = [np.sin(2.0 * np.pi * n * line * time + n) / n for n in range(1, partials + 1)]
        tones.append(0.2 * np.exp(-decay * time) * np.sum(sines, axis=0))
    both = np.stack(tones)
    if position is None:
        both = np.repeat(both.mean(axis=0, keepdims=True), 2, axis=0)
    noise = 1e-6 * np.random.default_rng(3).standard_normal(both.shape)
    return (both + crosstalk * both[::-1] * (position is not None) + noise).astype(np.float32)
