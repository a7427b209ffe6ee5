"""The reader: from the spectra of a stream's windows to where something touches, and what is odd."""

from dataclasses import dataclass
from typing import NamedTuple

from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds
from monochord.perception.reader.cells import spectrum_cells
from monochord.perception.reader.gaps import measure_gaps
from monochord.perception.reader.measures import PLACE, measure, measured_again, touch_near
from monochord.perception.reader.memory import Memory, bundled_memory, recall
from monochord.perception.reader.network import (
    KINDS,
    POSITIONS,
    MemoryNetwork,
    ReaderNetwork,
    activations,
    bundled_network,
    memory_inputs,
)
from monochord.perception.spectrum import Spectrum, SpectrumAnalyser

RIGHT_WITHIN = 0.025
"""Largest error over the length of a place that counts as right: 5 mm of the design's string."""


class SpectrumReading(NamedTuple):
    """The reading of a window and those before it.

    `measures` are those of `measures.COLUMNS`, `touched` the log odds that something touches, `certainty` the
    probability that something does within `RIGHT_WITHIN` of the place, `kinds` the logit of each of `KINDS`,
    `gaps` the sound between the lines of this window, `outputs` those of `memory.OUTPUTS`, and `summary` what
    all are read from.
    """

    measures: Floats
    touched: float
    certainty: float
    kinds: Floats
    gaps: Floats
    outputs: Floats
    summary: Audio


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """Reads spectra of an analyser's windows; `network` and `memory` are the package's by default."""

    analyser: SpectrumAnalyser
    network: ReaderNetwork
    memory: MemoryNetwork

    @classmethod
    def of(cls, analyser: SpectrumAnalyser) -> "Reader":
        """Return the reader of an analyser's spectra, with the networks of the package."""
        return cls(analyser=analyser, network=bundled_network(), memory=bundled_memory())

    def alone(self, spectrum: Spectrum) -> tuple[Floats, Audio, Floats]:
        """Return what a window alone tells: its measures, and the network's hidden layer and outputs."""
        hidden, outputs = activations(spectrum_cells(self.analyser, spectrum), self.network)
        return measure(outputs[: -len(KINDS)], POSITIONS, *spectrum, self._pitch), hidden, outputs

    def inputs(self, spectrum: Spectrum) -> tuple[Audio, Audio, Floats, Floats]:
        """Return what a window gives the memory (`memory_inputs`), its measures and sound between lines."""
        measures, hidden, outputs = self.alone(spectrum)
        gaps = measure_gaps(spectrum.transform, spectrum.power, self.analyser.bin_spacing)
        told = memory_inputs(hidden, outputs[: -len(KINDS)], outputs[-len(KINDS) :], measures, gaps)
        return *told, measures, gaps

    def read(self, memory: Memory, spectrum: Spectrum, time: Seconds) -> tuple[Memory, SpectrumReading]:
        """Return the memory after a window that starts at a time in s, and the window's reading.

        What the window alone tells enters the memory; then that pair of lines is measured which is nearest to
        the place that both tell.
        """
        inputs, density, measures, gaps = self.inputs(spectrum)
        memory, both = recall(memory, inputs, density, time, self.memory)
        measures = measured_again(measures, both.logits, POSITIONS, *spectrum[1:], self._pitch)
        near = touch_near(both.logits, POSITIONS, measures[PLACE], RIGHT_WITHIN)
        return memory, SpectrumReading(measures, *near, both.kinds, gaps, both.outputs, both.summary)

    @property
    def _pitch(self) -> tuple[float, float, float]:
        return self.analyser.bin_spacing, self.analyser.nominal, self.analyser.bending
