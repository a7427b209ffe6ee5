"""The reader: from the spectrum of a window to where something touches, and what is odd."""

from dataclasses import dataclass
from typing import NamedTuple

from monochord.core.types import Floats
from monochord.perception.reader.cells import spectrum_cells
from monochord.perception.reader.measures import measure
from monochord.perception.reader.network import KINDS, POSITIONS, Network, bundled_network, logits
from monochord.perception.spectrum import Spectrum, SpectrumAnalyser


class Reading(NamedTuple):
    """The reading of a window: its measures, see `measures.COLUMNS`, and the logit of each of `KINDS`."""

    measures: Floats
    kinds: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """Reads spectra of an analyser's windows; `network` is the package's by default."""

    analyser: SpectrumAnalyser
    network: Network

    @classmethod
    def of(cls, analyser: SpectrumAnalyser, network: Network | None = None) -> "Reader":
        """Return the reader of an analyser's spectra."""
        return cls(analyser=analyser, network=network or bundled_network())

    def read(self, spectrum: Spectrum) -> Reading:
        """Return the reading of a window."""
        own = self.analyser
        outputs = logits(spectrum_cells(own, spectrum), self.network)
        split = len(outputs) - len(KINDS)
        pitch = own.bin_spacing, own.nominal, own.bending
        measures = measure(outputs[:split], POSITIONS, *spectrum, pitch)
        return Reading(measures, outputs[split:])
