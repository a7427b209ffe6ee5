"""Signal processing: pure functions, arrays in, arrays out."""

from monochord.dsp.music import loop
from monochord.dsp.noise import NOISES, pink
from monochord.dsp.pitch import PitchFinder

__all__ = [
    "NOISES",
    "PitchFinder",
    "loop",
    "pink",
]
