"""Reads a window's spectrum: where along the string something touches, and what is odd."""

from monochord.perception.reader.cells import CELLS, CHANNELS, spectrum_cells
from monochord.perception.reader.gaps import BANDS, measure_gaps
from monochord.perception.reader.measures import COLUMNS, measure
from monochord.perception.reader.memory import Memory, no_memory
from monochord.perception.reader.network import (
    BASIS,
    FILE,
    FIRST,
    KINDS,
    PARTIALS,
    POSITIONS,
    STRIDE,
    MemoryNetwork,
    ReaderNetwork,
    segments,
)
from monochord.perception.reader.reader import Reader, SpectrumReading
from monochord.perception.spectrum import SpectrumAnalyser

__all__ = [
    "BANDS",
    "BASIS",
    "CELLS",
    "CHANNELS",
    "COLUMNS",
    "FILE",
    "FIRST",
    "KINDS",
    "PARTIALS",
    "POSITIONS",
    "STRIDE",
    "Memory",
    "MemoryNetwork",
    "Reader",
    "ReaderNetwork",
    "SpectrumAnalyser",
    "SpectrumReading",
    "measure",
    "measure_gaps",
    "no_memory",
    "segments",
    "spectrum_cells",
]
