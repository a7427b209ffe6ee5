"""Pitch errors of a short window relative to the physical limit, the Cramer-Rao bound.

Makes what `docs/design/reader-of-modes.md` says of its error, in some two minutes: ``python -m
studies.pitch_bound``.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from studies._command import measure

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.dsp import PitchFinder
from monochord.physics.theory import series_bound, stiff_partials

PARTIALS = np.arange(1.0, 11.0)
STIFFNESS = 1.0e-4
RATE = 44100
GROSS_ERROR: Hertz = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound(Benchmark):
    """Error of f0 on synthetic stiff strings in white noise, relative to the smallest possible error.

    Ten partials with amplitudes falling as 1/n, random fundamentals between 100 and 300 Hz, unknown B. The
    ratio of the error to the stated standard error is given too: 1 is correct.

    Parameters
    ----------
    ratios
        Signal-to-noise ratios of the whole sound, in dB.
    windows
        Number of windows for each ratio.
    window
        Length of a window in s.
    seed
        Random seed of notes, phases and noise.
    """

    ratios: tuple[float, ...] = (30.0, 20.0, 10.0, 0.0)
    windows: int = 300
    window: Seconds = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        if self.windows < 1:
            raise InputError(f"{self.windows} windows", "1 or more")
        if not 0.05 <= self.window <= 60.0:
            raise InputError(f"window {self.window:g} s", "0.05 to 60 s")

    def run(self) -> Iterator[Row]:
        """Measure every ratio."""
        size = round(self.window * RATE)
        finder = PitchFinder(sample_rate=RATE, size=size, lowest=80.0, highest=400.0)
        for ratio in self.ratios:
            rng = np.random.default_rng(self.seed)
            errors = np.array([self._one(finder, rng, ratio) for _ in range(self.windows)])
            error, claimed, least = errors[np.abs(errors[:, 0]) < GROSS_ERROR].T
            yield Row(name=f"{ratio:g} dB: gross errors", value=float(self.windows - error.size), unit="1")
            yield Row(
                name=f"{ratio:g} dB: error of f0",
                value=_rms(error),
                unit="Hz",
                baseline="Cramer-Rao bound",
                baseline_value=_rms(least),
            )
            yield Row(name=f"{ratio:g} dB: error over claim", value=_rms(error / claimed), unit="1")

    def _one(self, finder: PitchFinder, rng: np.random.Generator, ratio: float) -> tuple[float, float, float]:
        """Return error, stated standard error and bound of one window, in Hz; a miss is infinite."""
        f0 = float(rng.uniform(100.0, 300.0))
        time = np.arange(finder.size) / RATE
        phase = rng.uniform(0.0, 2.0 * np.pi, PARTIALS.size)
        partials = np.sin(
            2.0 * np.pi * np.outer(stiff_partials(f0, STIFFNESS, PARTIALS), time) + phase[:, None]
        )
        sound = (partials / PARTIALS[:, None]).sum(axis=0)
        noise = sound.std() * 10.0 ** (-ratio / 20.0)
        pitches = finder.find((sound + noise * rng.standard_normal(finder.size))[np.newaxis])
        bound = series_bound(
            f0, PARTIALS, 0.5 / PARTIALS**2 / noise**2, duration=finder.size / RATE, sample_rate=float(RATE),
            inharmonicity=STIFFNESS, known_inharmonicity=False,
        )  # fmt: skip
        if not pitches:
            return np.inf, 1.0, bound
        return pitches[0].frequency - f0, pitches[0].frequency_std, bound


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    measure(Bound)
