"""Signal processing: pure functions, arrays in, arrays out."""

from monochord.dsp.music import loop
from monochord.dsp.noise import NOISES, mixed, noise_loop, pink
from monochord.dsp.pitch import PitchFinder

__all__ = [
    "NOISES",
    "PitchFinder",
    "loop",
    "mixed",
    "noise_loop",
    "pink",
]
