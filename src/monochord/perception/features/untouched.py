"""What an untouched string tells of itself: its partials, hence its tension, and what the drivers hold."""

from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio, Signal
from monochord.core.units import Hertz, Samples
from monochord.perception.features._ear import Ear, Heard
from monochord.perception.features._harmonics import LEVEL, OFFSET, SIDE, harmonics
from monochord.perception.features.base import Extractor, Feature

PARTIALS = 6
CLEAR = -0.5
"""A partial is heard where log10 of its sidebands' power over its own is below this,"""
FAINT = 3.0
"""and its power within so many decades of the loudest one's."""
COLUMNS = (
    "open",
    "tension",
    "spread",
    "held 1",
    "held 2",
    "level 1",
    "level 2",
    "score",
    *(f"partial {n} offset" for n in range(1, PARTIALS + 1)),
    *(f"partial {n} level" for n in range(1, PARTIALS + 1)),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Untouched(Feature):
    """The numbers of an untouched window by which a later touch is read: force hides in tension that drifts.

    Columns: the open frequency in thousandths over the nominal one and the tension in N that it means, T =
    mu (2 L f)^2; how far the partials that are heard disagree on it, in thousandths; the number of the
    loudest partial at each microphone, which its driver holds; log10 of each microphone's mean square; the
    score of the reading that the string is untouched; of partials 1 to 6 what each says of the open
    frequency, in thousandths over the nominal one, and log10 of its power over the loudest one's.

    The open frequency is told by the lowest partial that is heard: a driver that holds a high one pulls it
    by a thousandth or two. A partial that is not heard says what the others say, so that a mean over
    windows is not drawn to anything. Rows of touched windows mean nothing.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = Untouched().prepare(signal, 4410)
    >>> tone = 0.1 * np.sin(2.0 * np.pi * 1005.0 * np.arange(4410) / 44100.0)
    >>> row = extract(np.stack((tone, tone))[np.newaxis].astype(np.float32))[0]
    >>> round(float(row[extract.columns.index("tension")]), 1)
    64.3
    """

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor, compiled, for two channels of a known string."""
        extractor = _Extractor(Ear.of(signal, size))
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(Extractor):
    def __init__(self, ear: Ear) -> None:
        self._ear = ear

    @property
    def columns(self) -> tuple[str, ...]:
        return COLUMNS

    def __call__(self, windows: Audio) -> Audio:
        rows = np.empty((len(windows), len(COLUMNS)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            row[:] = self._row(self._ear.hear(window))
        return rows

    def _row(self, heard: Heard) -> tuple[float, ...]:
        ear = self._ear
        rest = heard.reading.rest_frequency or ear.nominal
        places = ear.partials(rest, ear.length, PARTIALS)[np.newaxis]
        each = harmonics(heard.plain, heard.power, places, ear.spacing)[:, 0]
        loud = each[..., LEVEL].mean(axis=0)
        level = np.maximum(loud - loud.max(), -FAINT)
        is_heard = (each[..., SIDE].mean(axis=0) < CLEAR) & (level > -FAINT)
        told = ear.per_mille(rest) + each[..., OFFSET].mean(axis=0)
        lowest = int(is_heard.argmax())
        own = float(told[lowest]) if is_heard.any() else ear.per_mille(rest)
        told = np.where(is_heard, told, own)
        return (
            own,
            self._tension(ear.nominal * (1.0 + 0.001 * own)),
            float(np.abs(told - own).max()),
            *(each[:, :, LEVEL].argmax(axis=1) + 1.0).tolist(),
            *np.log10(np.mean(heard.samples**2, axis=1) + 1e-13).tolist(),
            heard.reading.untouched,
            *told.tolist(),
            *level.tolist(),
        )

    def _tension(self, frequency: Hertz) -> float:
        string = self._ear.string
        return string.linear_density * (2.0 * string.length * frequency) ** 2
