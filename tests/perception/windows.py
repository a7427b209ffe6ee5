"""Sound cut into windows, as the live loop cuts it."""

import numpy as np

from monochord.core.types import Audio, Floats, Window
from monochord.datasets.hearing import heard
from monochord.datasets.store import Dataset

RATE, SIZE = 44100, 4410


def cut(
    sound: Audio | Floats, hop: int = SIZE, *, size: int = SIZE, rate: int = RATE, first: int = 0
) -> list[Window]:
    """Return the windows of a sound (channels, n) whose first frame has the index `first`."""
    return [
        Window(
            samples=np.ascontiguousarray(sound[:, at : at + size], np.float32),
            start=first + at,
            sample_rate=rate,
        )
        for at in range(0, sound.shape[1] - size + 1, hop)
    ]


def window_of(dataset: Dataset, row: int) -> Window:
    """Return a window of a dataset as a source yields it."""
    ((_, window),) = heard(dataset, [row])
    return window
