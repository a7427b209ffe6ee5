"""Signal processing: pure functions, arrays in, arrays out."""

from monochord.dsp.mel import MEL_RATE, MelSound, frame_indices, mel_filters
from monochord.dsp.music import loop
from monochord.dsp.noise import NOISES, mixed, noise_loop, pink
from monochord.dsp.pitch import PitchFinder

__all__ = [
    "MEL_RATE",
    "NOISES",
    "MelSound",
    "PitchFinder",
    "frame_indices",
    "loop",
    "mel_filters",
    "mixed",
    "noise_loop",
    "pink",
]
