"""A session's windows in turn, as a live loop hears them: between two rows of a dataset, too."""

from collections.abc import Iterable, Iterator

import numpy as np

from monochord.core.types import Audio, Window
from monochord.core.units import Seconds
from monochord.datasets.store import Dataset


def heard(
    dataset: Dataset, rows: Iterable[int], tick: Seconds | None = None, audio: Audio | None = None
) -> Iterator[tuple[int, Window]]:
    """Yield row and window of each of some rows of one session, in rising order; samples are copies.

    What remembers has learned from windows every `tick` s, and a dataset may have far fewer. So with a row
    that follows the row before it, the windows at the multiples of `tick` between both come first; only the
    last window of a row is its own, which starts at ``dataset.start[row]``. They are left out where both
    rows do not cover them, or one has lost samples or numbers. `audio` (2, n) stands for the session's sound.

    Examples
    --------
    Of a dataset with a window every 0.1 s, ``heard(dataset, [0, 1], 0.02)`` yields rows 0, 1, 1, 1, 1, 1.
    """
    manifest, before, was_usable = dataset.manifest, -1, False
    size, rate = manifest.window, manifest.sample_rate
    for row in rows:
        sound = dataset.audio(int(dataset.session[row])) if audio is None else audio
        last, start, starts = int(dataset.start[before]), int(dataset.start[row]), list[int]()
        usable = not (dataset.has_gap[row] or dataset.not_finite[row])
        follows = before == row - 1 and start - last <= size
        if tick is not None and follows and usable and was_usable:
            numbers = range(int(last / (tick * rate)), int(start / (tick * rate)) + 1)
            between = (round(number * tick * rate) for number in numbers)
            starts = [at for at in between if last < at < start]
        for at in (*starts, start):
            samples = np.array(sound[:, at : at + size], np.float32)
            yield row, Window(samples=samples, start=at, sample_rate=rate, has_gap=bool(dataset.has_gap[row]))
        before, was_usable = row, usable
