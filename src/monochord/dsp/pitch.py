"""Finds the stiff harmonic series in a short window: candidates with their evidence.

A coarse comb over a grid of f0 and B proposes candidates, a least-squares fit to the spectral peaks refines
them, and their evidence decides. Lines of mains hum are no partials. Windows are analysed independently.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from monochord.core.shapes import sound
from monochord.core.types import Floats
from monochord.core.units import Hertz, Samples
from monochord.dsp import series
from monochord.dsp.mains import hidden, mains_lines, without
from monochord.dsp.spectrum import FLOOR_WIDTH, Analyser

GRID_CENTS = 6.0
"""Relative spacing of the f0 grid."""
MIN_SALIENCE = 1.0
"""Smallest salience of a peak."""
NO_GUESSES: Floats = np.empty((0, 2))


class Series(NamedTuple):
    """One candidate series: f0 in Hz and B with their standard errors, and its evidence.

    `evidence` is the log evidence over clutter in nats.
    """

    frequency: Hertz
    frequency_std: Hertz
    inharmonicity: float
    inharmonicity_std: float
    evidence: float


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
        Weight in nats of the power that a series explains, in the evidence for it.
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
    _comb: series.Comb = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        analyser = Analyser(
            sample_rate=self.sample_rate,
            size=self.size,
            top=self.top,
            floor_width=max(FLOOR_WIDTH, 4.0 * self.lowest),
        )
        object.__setattr__(self, "_analyser", analyser)
        teeth = series.comb(
            self.lowest, self.highest, 2.0 ** (GRID_CENTS / 1200.0), self._view(np.zeros(analyser.bins))
        )
        object.__setattr__(self, "_comb", teeth)

    def find(self, samples: Floats, guesses: Floats = NO_GUESSES) -> list[Series]:
        """Return the candidates in a window (channels, size), best first; empty if there is no peak.

        `guesses` are of f0 in Hz and B (guesses, 2), examined besides those of the comb.
        """
        return [Series(*row) for row in self.rows(samples, guesses).tolist()]

    def rows(self, samples: Floats, guesses: Floats = NO_GUESSES) -> Floats:
        """Return the candidates as rows of `monochord.dsp.series.COLUMNS`; see `find`."""
        analyser = self._analyser
        power = analyser.powers(sound(samples, size=self.size, dtype=np.float64)).mean(axis=0)
        salience = analyser.salience(power)
        peaks = analyser.peaks(power, salience, MIN_SALIENCE)
        hum, others = mains_lines(peaks, analyser.resolution), 0.0
        if hum.any():
            lines, others = peaks.frequency[hum], float(peaks.power[hum].sum())
            salience = hidden(salience, lines, analyser.spacing, analyser.resolution, series.HIDDEN)
            peaks = without(peaks, hum)
        if peaks.frequency.size == 0:
            return np.empty((0, len(series.COLUMNS)))
        view = self._view(salience, others)
        proposed = np.concatenate((guesses, series.propose(self._comb, view)))
        return series.weigh(proposed, (self.lowest, *self.inharmonicity_prior), peaks, view)

    def _view(self, salience: Floats, others: float = 0.0) -> series.View:
        return series.View(
            salience=salience,
            spacing=self._analyser.spacing,
            resolution=self._analyser.resolution,
            bottom=0.5 * self.lowest,
            top=self._analyser.top,
            max_partials=self.partials,
            residual_weight=self.residual_weight,
            others=others,
        )
