"""Which stiff harmonic series sounds in a short window: candidates with their evidence.

A coarse comb over a grid of f0 and B proposes, a least-squares fit to the spectral peaks refines, and the
evidence of each refined series decides. Nothing is carried from window to window.
"""

from dataclasses import dataclass, field

import numpy as np

from monochord.dsp import series, spectrum
from monochord.types import Floats
from monochord.units import Hertz

GRID_CENTS = 4.0
GRID_STIFFNESS = (0.0, 1e-4, 2.5e-4, 5e-4)
RELATIVES = (1 / 3, 1 / 2, 2 / 3, 3 / 2, 2.0, 3.0)
"""Series that share many partials with a candidate and must be weighed against it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One candidate: f0 in Hz with its standard error, B, and the log evidence over clutter in nats."""

    frequency: Hertz
    frequency_std: Hertz
    stiffness: float
    evidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PitchFinder:
    """Finds stiff harmonic series whose f0 lies in [lowest, highest] in windows of one size.

    Parameters
    ----------
    sample_rate, size
        Frames a second, and frames a window.
    lowest, highest
        Range of f0 in Hz.
    top
        Highest frequency looked at, Hz.
    partials
        Largest number of partials.
    residual_weight
        See `monochord.dsp.series.series_evidence`.

    Examples
    --------
    >>> time = np.arange(4410) / 44100
    >>> tone = sum(np.sin(2 * np.pi * 220 * n * time) / n for n in range(1, 9))
    >>> found = PitchFinder(sample_rate=44100, size=4410, lowest=80.0, highest=800.0).find(tone[np.newaxis])
    >>> round(found[0].frequency, 1)
    220.0
    """

    sample_rate: int
    size: int
    lowest: Hertz
    highest: Hertz
    top: Hertz = 6000.0
    partials: int = 40
    residual_weight: float = 8.0
    stiffness_prior: tuple[float, float] = (5e-5, 2e-4)
    _taper: Floats = field(init=False, repr=False, compare=False)
    _grid: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        step = 2.0 ** (GRID_CENTS / 1200.0)
        count = int(np.log(self.highest / self.lowest) / np.log(step)) + 2
        object.__setattr__(self, "_taper", np.hanning(self.size + 1)[:-1])
        object.__setattr__(self, "_grid", self.lowest * step ** np.arange(-1.0, count))
        object.__setattr__(self, "top", min(self.top, 0.45 * self.sample_rate))

    def find(self, samples: Floats) -> list[Series]:
        """Return the candidates in a window (channels, size), best first; empty if there is no peak."""
        padded = 1 << int(np.ceil(np.log2(3.0 * self.size)))
        spacing = self.sample_rate / padded
        bins = int(1.05 * self.top / spacing)
        power = spectrum.power_spectrum(samples, self._taper, padded)[:bins]
        block = max(int(max(500.0, 4.0 * self.lowest) / spacing), 8)
        salience = np.log1p(power / spectrum.noise_floor(power, block))
        frequency, height, stands = spectrum.find_peaks(
            power, salience, spacing, self.size / self.sample_rate, 1.0
        )
        if frequency.size == 0:
            return []
        rank = np.empty(frequency.size)
        rank[np.argsort(-height)] = np.arange(1.0, frequency.size + 1.0)
        rows = series.search(
            self._grid, np.array(GRID_STIFFNESS), np.array(RELATIVES), frequency, height, rank, stands,
            salience, spacing, self.top, self.partials, self.residual_weight, self.stiffness_prior,
        )  # fmt: skip
        order = np.argsort(-rows[:, 3])
        return [
            Series(frequency=r[0], frequency_std=r[1], stiffness=r[2], evidence=r[3])
            for r in rows[order].tolist()
        ]
