"""Finds the stiff harmonic series in a short window: candidates with their evidence.

A coarse comb over a grid of f0 and B proposes candidates, a least-squares fit to the spectral peaks refines
them, and their evidence decides. Windows are analysed independently.
"""

from dataclasses import dataclass, field

import numpy as np

from monochord.core.shapes import sound
from monochord.core.types import Floats
from monochord.core.units import Hertz, Samples
from monochord.dsp import series
from monochord.dsp.spectrum import FLOOR_WIDTH, Analyser

GRID_CENTS = 4.0
"""Relative spacing of the f0 grid."""
MIN_SALIENCE = 1.0
"""Smallest salience of a peak."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One candidate series: f0 in Hz and B with their standard errors, and its evidence.

    `claims` holds each spectral peak's share of the total power if the peak lies on a partial, else zero.
    `evidence` is the log evidence over clutter in nats.
    """

    frequency: Hertz
    frequency_std: Hertz
    inharmonicity: float
    inharmonicity_std: float
    evidence: float
    claims: Floats = field(repr=False, compare=False)

    def beside(self, other: "Series") -> float:
        """Return the share of the total power that this series explains and the other does not."""
        return float(self.claims[other.claims == 0.0].sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class PitchFinder:
    """Finds stiff harmonic series with f0 in [lowest, highest], in windows of one size.

    Series outside that range are also reported if related to one inside, such as its lower octave.

    Parameters
    ----------
    sample_rate, size
        Sample rate in Hz, and window length in frames.
    lowest, highest
        Range of f0 in Hz.
    top
        Highest analysed frequency, in Hz.
    partials
        Largest number of partials.
    residual_weight
        See `monochord.dsp.series.series_evidence`.
    inharmonicity_prior
        Mean and standard deviation of B at `lowest`; both scale with (f0 / lowest)^2, as on a shortened
        string.

    Examples
    --------
    >>> time = np.arange(4410) / 44100
    >>> tone = sum(np.sin(2 * np.pi * 220 * n * time) / n for n in range(1, 9))
    >>> finder = PitchFinder(sample_rate=44100, size=4410, lowest=80.0, highest=800.0)
    >>> candidates = finder.find(tone[np.newaxis])
    >>> round(candidates[0].frequency, 1)
    220.0
    """

    sample_rate: int
    size: Samples
    lowest: Hertz
    highest: Hertz
    top: Hertz = 6000.0
    partials: int = 40
    residual_weight: float = 8.0
    inharmonicity_prior: tuple[float, float] = (5e-5, 2e-4)
    _analyser: Analyser = field(init=False, repr=False, compare=False)
    _grid: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        step = 2.0 ** (GRID_CENTS / 1200.0)
        count = int(np.log(self.highest / self.lowest) / np.log(step)) + 2
        analyser = Analyser(
            sample_rate=self.sample_rate,
            size=self.size,
            top=self.top,
            floor_width=max(FLOOR_WIDTH, 4.0 * self.lowest),
        )
        object.__setattr__(self, "_analyser", analyser)
        object.__setattr__(self, "_grid", self.lowest * step ** np.arange(-1.0, count))

    def find(self, samples: Floats) -> list[Series]:
        """Return the candidates in a window (channels, size), best first; empty if there is no peak."""
        analyser = self._analyser
        power = analyser.powers(sound(samples, size=self.size, dtype=np.float64)).mean(axis=0)
        salience = analyser.salience(power)
        peaks = analyser.peaks(power, salience, MIN_SALIENCE)
        if peaks.frequency.size == 0:
            return []
        view = series.View(
            salience=salience,
            spacing=analyser.spacing,
            resolution=analyser.resolution,
            bottom=0.5 * self.lowest,
            top=analyser.top,
            max_partials=self.partials,
            residual_weight=self.residual_weight,
        )
        rows, claims = series.search(self._grid, self.inharmonicity_prior, peaks, view)
        return [
            Series(**dict(zip(series.COLUMNS, row, strict=True)), claims=claim)
            for row, claim in zip(rows.tolist(), claims, strict=True)
        ]
