"""What the reader tells of a window and those before it: position, pitch, levels, faults, force and slip."""

from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.perception.features.base import Extractor, Feature, RecurrentExtractor
from monochord.perception.heads.base import CERTAINTY
from monochord.perception.reader.gaps import COLUMNS as GAPS
from monochord.perception.reader.measures import COLUMNS as MEASURES
from monochord.perception.reader.memory import SUMMARY, TICK, Memory, no_memory
from monochord.perception.reader.network import KINDS, OUTPUTS
from monochord.perception.reader.reader import Reader
from monochord.perception.spectrum import Spectrum, SpectrumAnalyser

COLUMNS = (
    *MEASURES,
    "touched",
    CERTAINTY,
    *(f"kind {kind}" for kind in KINDS),
    *GAPS,
    *(f"touch {output}" for output in OUTPUTS),
    *(f"memory {number}" for number in range(1, SUMMARY + 1)),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading(Feature):
    """What the reader tells: one network on both microphones' spectra, and a memory of the windows before.

    Columns: those of `monochord.perception.reader.measures.measure`; the log odds of a touch, and the
    probability that the position is right; the logit of each kind of window, ordinary or with a fault; the
    sound between the lines of `monochord.perception.reader.gaps`, which a sliding touch makes on any build;
    force and slip; and a summary of the memory. All are relative to the string's own pitch and length. The
    bundled model uses this feature.

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


class _Extractor(RecurrentExtractor):
    def __init__(self, reader: Reader) -> None:
        self._reader = reader

    @property
    def analyser(self) -> SpectrumAnalyser:
        return self._reader.analyser

    @property
    def columns(self) -> tuple[str, ...]:
        return COLUMNS

    @property
    def tick(self) -> Seconds:
        return TICK

    def begin(self) -> Memory:
        return no_memory()

    def step(self, memory: Memory, spectrum: Spectrum, time: Seconds) -> tuple[Memory, Audio]:
        memory, told = self._reader.read(memory, spectrum, time)
        touch = told.touched, told.certainty
        parts = told.measures, touch, told.kinds, told.gaps.ravel(), told.outputs, told.summary
        return memory, np.concatenate(parts, dtype=np.float32, casting="same_kind")
