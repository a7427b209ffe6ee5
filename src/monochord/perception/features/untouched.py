"""The untouched string: its partials, the tension they imply, and the modes that the drivers sustain."""

from dataclasses import dataclass

import numpy as np

from monochord.core.shapes import batch
from monochord.core.types import Audio, Signal
from monochord.core.units import Hertz, Samples
from monochord.perception.closed_form.spectrum import Spectrum, SpectrumAnalyser
from monochord.perception.features._gaps import COLUMNS as GAP_COLUMNS
from monochord.perception.features._gaps import measure_gaps
from monochord.perception.features._harmonics import LEVEL, OFFSET, SIDE, measure_harmonics
from monochord.perception.features.base import Extractor, Feature

PARTIALS = 6
MAX_SIDE = -0.5
"""Largest ratio of sideband power to line power, as log10, of an audible partial."""
MAX_DECADES = 3.0
"""Decades of power below the loudest partial within which a partial is audible."""
COLUMNS = (
    "open",
    "tension",
    "spread",
    "held 1",
    "held 2",
    "level 1",
    "level 2",
    "score",
    *(f"partial {n} offset" for n in range(1, PARTIALS + 1)),
    *(f"partial {n} level" for n in range(1, PARTIALS + 1)),
)
GAPS = tuple(f"untouched {name}" for name in GAP_COLUMNS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Untouched(Feature):
    """Measures of the untouched string: the reference for later touches, because tension drifts.

    Columns:

    - `open`: the open frequency f in thousandths above nominal; `tension` T = mu (2 L f)^2 in N;
    - `spread`: the largest disagreement between audible partials on the open frequency, in thousandths;
    - `held 1`, `held 2`: the number of the loudest partial at each microphone, which its driver sustains;
    - `level 1`, `level 2`: log10 of each microphone's mean square;
    - `score` of the reading that the string is untouched;
    - for partials 1 to 6: the open frequency from this partial alone, in thousandths above nominal, and log10
      of its power relative to the loudest partial.

    If the string is not tuned as its design states, the tension is scaled to the design's tuning.

    The lowest audible partial gives the open frequency, because a driver that sustains a high partial shifts
    that partial by one or two thousandths. An inaudible partial repeats the value of the lowest audible one,
    so a mean over windows is unbiased. Rows of touched windows are meaningless.

    `gaps` adds 84 columns of the sound between the lines, as in `fft_harmonic`. They measure the noise floor
    of the microphones and their surroundings; a sliding touch is detected above it.

    Parameters
    ----------
    gaps
        Add columns of the sound between the lines.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = Untouched().prepare(signal, 4410)
    >>> tone = 0.1 * np.sin(2.0 * np.pi * 1005.0 * np.arange(4410) / 44100.0)
    >>> row = extract(np.stack((tone, tone))[np.newaxis].astype(np.float32))[0]
    >>> round(float(row[extract.columns.index("tension")]), 1)
    64.3
    >>> len(Untouched(gaps=True).prepare(signal, 4410).columns) - len(extract.columns)
    84
    """

    gaps: bool = False

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the compiled extractor for two channels of a known string."""
        extractor = _Extractor(SpectrumAnalyser.of(signal, size), signal.tension_scale, gaps=self.gaps)
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(Extractor):
    def __init__(self, analyser: SpectrumAnalyser, tension_scale: float, *, gaps: bool) -> None:
        self._analyser, self._tension_scale, self._gaps = analyser, tension_scale, gaps

    @property
    def columns(self) -> tuple[str, ...]:
        return (*COLUMNS, *GAPS) if self._gaps else COLUMNS

    def __call__(self, windows: Audio) -> Audio:
        windows = batch(windows, 2, self._analyser.size)
        rows = np.empty((len(windows), len(self.columns)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            spectrum = self._analyser.analyse(window)
            row[: len(COLUMNS)] = self._row(spectrum)
            if self._gaps:
                spacing = self._analyser.bin_spacing
                row[len(COLUMNS) :] = measure_gaps(spectrum.transform, spectrum.power, spacing).ravel()
        return rows

    def _row(self, spectrum: Spectrum) -> tuple[float, ...]:
        analyser = self._analyser
        rest = spectrum.reading.untouched_frequency or analyser.nominal
        partials = analyser.partials(rest, analyser.length, PARTIALS)[np.newaxis]
        measured = measure_harmonics(spectrum.transform, spectrum.power, partials, analyser.bin_spacing)[:, 0]
        loudness = measured[..., LEVEL].mean(axis=0)
        level = np.maximum(loudness - loudness.max(), -MAX_DECADES)
        audible = (measured[..., SIDE].mean(axis=0) < MAX_SIDE) & (level > -MAX_DECADES)
        offset = analyser.per_mille(rest) + measured[..., OFFSET].mean(axis=0)
        own = float(offset[int(audible.argmax())]) if audible.any() else analyser.per_mille(rest)
        offset = np.where(audible, offset, own)
        return (
            own,
            self._tension(analyser.nominal * (1.0 + 0.001 * own)),
            float(np.abs(offset - own).max()),
            *(measured[:, :, LEVEL].argmax(axis=1) + 1.0).tolist(),
            *np.log10(np.mean(spectrum.samples**2, axis=1) + 1e-13).tolist(),
            spectrum.reading.untouched_score,
            *offset.tolist(),
            *level.tolist(),
        )

    def _tension(self, frequency: Hertz) -> float:
        string = self._analyser.string
        return string.linear_density * (2.0 * string.length * frequency) ** 2 * self._tension_scale
