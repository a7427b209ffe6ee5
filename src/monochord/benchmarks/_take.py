"""A synthetic recording for benchmarks: a plucked stiff string, pressed down."""

from pathlib import Path

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.physics.strings import StringPreset
from monochord.physics.theory import inharmonicity, stiff_partials

PLUCKS: Seconds = 2.0  # from one to the next
PARTIALS = np.arange(1.0, 13.0)


def write_take(path: Path, preset: StringPreset, seconds: Seconds, sample_rate: int) -> None:
    """Write a recording of the preset, pressed at two fifths of its length, as a float wav file."""
    import soundfile  # noqa: PLC0415

    soundfile.write(path, _pressed(preset, seconds, sample_rate), sample_rate, subtype="FLOAT")


def _pressed(preset: StringPreset, seconds: Seconds, sample_rate: int) -> Audio:
    """Return the sound of the far segment, plucked every two seconds, with slight noise."""
    length = 0.6 * preset.string.length
    frequencies = stiff_partials(
        preset.open_frequency * preset.string.length / length,
        inharmonicity(preset.string, length),
        PARTIALS,
    )
    t = np.arange(round(seconds * sample_rate)) / sample_rate
    since = t % PLUCKS
    take = 1e-4 * np.random.default_rng(1).standard_normal(t.size)
    for n, frequency in zip(PARTIALS, frequencies, strict=True):
        take += 0.2 / n * np.exp(-n * since) * np.sin(2.0 * np.pi * frequency * t)
    return take.astype(np.float32)
