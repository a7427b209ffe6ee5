"""What the reader tells of a window: position, pitch, levels, the sound between the lines, and faults."""

from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio, Signal
from monochord.core.units import Samples
from monochord.perception.features.base import Extractor, Feature, SpectrumExtractor
from monochord.perception.reader.gaps import COLUMNS as GAPS
from monochord.perception.reader.gaps import measure_gaps
from monochord.perception.reader.measures import COLUMNS as MEASURES
from monochord.perception.reader.network import KINDS
from monochord.perception.reader.reader import Reader
from monochord.perception.spectrum import Spectrum, SpectrumAnalyser

COLUMNS = (*MEASURES, *(f"kind {kind}" for kind in KINDS), *GAPS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading(Feature):
    """The measures of the reader: one network on both microphones' spectra, and the nearest pair of lines.

    Columns: those of `monochord.perception.reader.measures.measure`; the logit of each kind of window,
    ordinary or with a fault; and the sound between the lines of `monochord.perception.reader.gaps`, which a
    sliding touch makes on any build. All are relative to the string's own pitch and length. The bundled model
    uses this feature.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = Reading().prepare(signal, 4410)
    >>> extract(np.zeros((1, 2, 4410), np.float32)).shape[1] == len(extract.columns)
    True
    """

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the compiled extractor for two channels of a known string."""
        extractor = _Extractor(Reader.of(SpectrumAnalyser.of(signal, size)))
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(SpectrumExtractor):
    def __init__(self, reader: Reader) -> None:
        self._reader = reader

    @property
    def analyser(self) -> SpectrumAnalyser:
        return self._reader.analyser

    @property
    def columns(self) -> tuple[str, ...]:
        return COLUMNS

    def row(self, spectrum: Spectrum) -> Audio:
        measures, kinds = self._reader.read(spectrum)
        gaps = measure_gaps(spectrum.transform, spectrum.power, self._reader.analyser.bin_spacing)
        return np.concatenate((measures, kinds, gaps.ravel()), dtype=np.float32, casting="same_kind")
