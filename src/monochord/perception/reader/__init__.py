"""Reads a window's spectrum: where along the string something touches, and what is odd."""

from monochord.perception.reader.cells import CELLS, CHANNELS, spectrum_cells
from monochord.perception.reader.gaps import BANDS, measure_gaps
from monochord.perception.reader.measures import COLUMNS, measure
from monochord.perception.reader.memory import Memory, MemoryNetwork, no_memory
from monochord.perception.reader.network import DILATIONS, FILE, KINDS, POSITIONS, STRIDES, Network
from monochord.perception.reader.reader import Reader, Reading
from monochord.perception.spectrum import SpectrumAnalyser

__all__ = [
    "BANDS",
    "CELLS",
    "CHANNELS",
    "COLUMNS",
    "DILATIONS",
    "FILE",
    "KINDS",
    "POSITIONS",
    "STRIDES",
    "Memory",
    "MemoryNetwork",
    "Network",
    "Reader",
    "Reading",
    "SpectrumAnalyser",
    "measure",
    "measure_gaps",
    "no_memory",
    "spectrum_cells",
]
