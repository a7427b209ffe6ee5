"""Three hundred numbers on the harmonics of both segments and of the whole string."""

from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Samples
from monochord.perception.features._ear import Ear, Heard
from monochord.perception.features._harmonics import (
    GROWTH,
    HARMONICS,
    LEVEL,
    LIKENESS,
    SIDE,
    harmonics,
    wholes,
)
from monochord.perception.features._tones import COLUMNS as TONES
from monochord.perception.features._tones import LEAST_FORCE, as_if, given, tones
from monochord.perception.features.base import Extractor, Feature

PLACES = 24
"""Points on the string at which position is told by how near it is."""
OF_A_HARMONIC = ("level", "offset", "side", "growth")
OF_A_CHANNEL = (
    "level",
    "rumble 20 Hz",
    "rumble 150 Hz",
    "gaps 500 Hz",
    "gaps 2 kHz",
    "gaps 6 kHz",
    "gaps 12 kHz",
    "flatness",
    "rise",
    "unrest",
    "fundamental",
)
OF_BOTH = (
    "place",
    "open",
    "rest",
    "mode 1",
    "mode 2",
    "lead",
    "contact",
    "score",
    "left over",
    "share 1",
    "share 2",
)
SERIES = ("segment 1", "segment 2", "string")
KEPT = slice(1, 3)
"""Harmonics whose timbre is told beside combination tones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FftHarmonic(Feature):
    """Harmonics in 300 numbers: 75 each of microphone 1, of microphone 2, their difference and their ratio.

    Recipe. The plain transform of the whole window, about its mean, gives spectra under a Hann taper and,
    from three bins, the exact frequency and growth of a line (`features._lines`). The strongest
    lines are read as modes of two segments, whichever modes the drivers hold, or as partials of the untouched
    string (`features._reading`). Three series of harmonics follow: n = 1 to 8 of the segment at
    microphone 1, of the segment at microphone 2, and of the whole string, at their stiff partials, or at
    multiples of what a driver holds where n is one. A harmonic is the strongest bin within 1.5 bins and 0.4 %
    of its place. Of it are told:

    - level: log10 of its power, not below 1e-7 of the channel's;
    - offset: how far it lies from its place, in thousandths, within 5;
    - side: log10 of the power 3 to 8 bins beside it, over its own;
    - growth: of its amplitude in 1/s, within 30; a decay is negative.

    Offset and growth are told times p / (p + 3 q), with q the power of its sidebands, as noise has neither.

    - **mic 1**, **mic 2** (75 each): the four of 8 harmonics of the microphone's own segment and of 8
      partials of the string, first 16 harmonics in all; and 11 of the channel: log10 of its mean square; of
      its power from 20 to 150 Hz and from 150 to 500 Hz, where only sliding and handling sound; mean log10
      of power from 0.5, 2, 6, 12 kHz on, which is that of the gaps between the lines; flatness from 4 to 15
      kHz; rise from the first half to the second; unrest, the deviation over ten stretches; the own
      segment's fundamental in octaves over the string's.
    - **difference** (75): microphone 1 less microphone 2, in the logarithm, at the same places: level and
      side of 24 harmonics of three series, growth of 16 of the segments; and the 11 of the channel.
    - **ratio** (75): of amplitudes, how alike both microphones hear each of 24 harmonics, 2 Re(A B*) /
      (A A* + B B*), which is 1 where they hear the same and -1 where one hears it upside down; of 16
      harmonics of the segments the level over the loudest of its series. Of frequencies, place = f2 / (f1 +
      f2) = x / L as of a clamp, told once as such and once by how near it is to 24 points along the string
      (1 at the point, 0 at the next). And 10 more of both: the open frequency f1 f2 / (f1 + f2), and the
      untouched string's as its partials tell it, in thousandths over the nominal one; the modes read; the
      reading's lead over the best other place, and over the untouched string; its score; the share of lines
      it leaves over; the shares of the two lines' power that microphone 1 hears.

    With `tones`, 12 numbers on combination tones of both lines (`features._tones`) stand in the
    ratio group, in place of the timbre of all but the second and the third harmonic. They tell how far the
    object gives way, which the frequencies alone mix up with the tension.

    Parameters
    ----------
    tones
        Whether combination tones are told.
    own
        With `tones`: share of its own end's force that a microphone hears, above a half.
    gain
        With `tones`: full scale a newton of a microphone. Both are the prototype's design by default.

    Notes
    -----
    Sources: a split string's frequencies, Yi, Xing, Manchester and Fazeli, Sound of Touch; stiff partials,
    Fletcher (1964); frequency and growth of a line, Auger and Flandrin (1995). The rest is our own.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = FftHarmonic().prepare(signal, 4410)
    >>> extract(np.zeros((1, 2, 4410), np.float32)).shape, extract.columns[0]
    ((1, 300), 'mic 1 own 1 level')
    """

    tones: bool = False
    own: float = 0.85
    gain: float = 2.0

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor, compiled, for two channels of a known string."""
        if not (0.5 < self.own <= 1.0 and 0.0 < self.gain < np.inf):
            given = f"own {self.own:g}, gain {self.gain:g}"
            raise InputError(given, "own above 0.5 and up to 1, a gain above 0")
        extractor = _Extractor(Ear.of(signal, size), self)
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(Extractor):
    def __init__(self, ear: Ear, options: FftHarmonic) -> None:
        self._ear, self._options = ear, options
        self._columns = tuple(_columns(tones=options.tones))
        self._told = np.flatnonzero([name.startswith("ratio tone ") for name in self._columns])

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    def __call__(self, windows: Audio) -> Audio:
        rows = np.empty((len(windows), len(self._columns)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            row[:] = self._row(self._ear.hear(window))
        return rows

    def _row(self, heard: Heard) -> Floats:
        ear = self._ear
        each = harmonics(heard.plain, heard.power, self._places(heard), ear.spacing)
        whole = wholes(heard.samples, heard.power, ear.spacing)
        touched = heard.reading.position > 0.0
        place = heard.reading.position / ear.length
        octaves = -np.log2((place, 1.0 - place)) if touched else np.zeros(2)
        channel = np.concatenate((whole, octaves[:, np.newaxis]), axis=1)
        own = np.stack((each[0, 0], each[1, 1]))
        mics = np.stack((own, each[:, 2]), axis=1)[..., :LIKENESS].reshape(2, -1)
        difference = (
            each[0, ..., LEVEL] - each[1, ..., LEVEL],
            each[0, ..., SIDE] - each[1, ..., SIDE],
            each[0, :2, :, GROWTH] - each[1, :2, :, GROWTH],
        )
        timbre = own[..., LEVEL] - own[..., LEVEL].max(axis=1, keepdims=True)
        shown = timbre[:, KEPT] if self._options.tones else timbre
        points = np.arange(PLACES) / (PLACES - 1.0)
        near = np.maximum(1.0 - (PLACES - 1.0) * np.abs(place - points), 0.0) * touched
        return np.concatenate(
            (
                mics[0],
                channel[0],
                mics[1],
                channel[1],
                *(values.ravel() for values in difference),
                channel[0] - channel[1],
                each[0, ..., LIKENESS].ravel(),
                shown.ravel(),
                self._tones(heard) if self._options.tones else np.zeros(0),
                near,
                self._both(heard),
            )
        )

    def as_if(self, rows: Audio, force: Floats, share: Floats) -> Audio:
        """Return rows as they would be if objects gave way by other amounts: tones and frequency follow."""
        if not self._options.tones:
            return super().as_if(rows, force, share)
        found, ear = rows.copy(), self._ear
        touched = np.flatnonzero(force > 0.0)
        told, pressed, by = rows[touched][:, self._told], force[touched], share[touched]
        longer = given(told, pressed) * np.maximum(pressed, LEAST_FORCE) ** (-1.0 / 3.0) * (by - 1.0)
        # A thousandth of a metre of each of two segments, in thousandths of the length.
        found[touched, self._columns.index("ratio open")] -= (2.0 * longer / ear.length).astype(np.float32)
        found[touched[:, np.newaxis], self._told] = as_if(told, pressed, by)
        return found

    def _tones(self, heard: Heard) -> Floats:
        ear, reading, options = self._ear, heard.reading, self._options
        held = (reading.line_1, reading.line_2, reading.position)
        string = (ear.length, ear.nominal, ear.beta, ear.string.tension)
        ears = (options.own, options.gain)
        return tones(heard.plain, heard.power, ear.size, ear.spacing, held, string, ears)

    def _places(self, heard: Heard) -> Floats:
        """Return where the harmonics of the three series are looked for, (3, `HARMONICS`) in Hz."""
        ear, reading = self._ear, heard.reading
        places = np.zeros((3, HARMONICS))
        if reading.position > 0.0:
            first = (reading.position, reading.line_1, int(reading.mode_1))
            second = (ear.length - reading.position, reading.line_2, int(reading.mode_2))
            for row, (side, line, mode) in zip(places, (first, second), strict=False):
                row[:] = ear.partials(reading.open_frequency * ear.length / side, side, HARMONICS)
                multiples = row[mode - 1 :: mode]
                multiples[:] = line * np.arange(1.0, multiples.size + 1.0)
        places[2] = ear.partials(reading.rest_frequency or ear.nominal, ear.length, HARMONICS)
        return places

    def _both(self, heard: Heard) -> tuple[float, ...]:
        told, ear = heard.reading, self._ear
        return (
            told.position / ear.length,
            ear.per_mille(told.open_frequency),
            ear.per_mille(told.rest_frequency),
            told.mode_1,
            told.mode_2,
            told.score - told.rival,
            told.score - told.untouched,
            told.score,
            told.left_over,
            told.share_1,
            told.share_2,
        )


def _columns(*, tones: bool) -> list[str]:
    numbers = range(1, HARMONICS + 1)
    both = [f"{series} {n}" for series in SERIES for n in numbers]
    names: list[str] = []
    for mic in ("mic 1", "mic 2"):
        each = [
            f"{series} {n} {what}" for series in ("own", "string") for n in numbers for what in OF_A_HARMONIC
        ]
        names += [f"{mic} {what}" for what in (*each, *OF_A_CHANNEL)]
    difference = [f"{one} level" for one in both] + [f"{one} side" for one in both]
    difference += [f"{one} growth" for one in both[: 2 * HARMONICS]]
    ratio = [f"{one} likeness" for one in both]
    shown = range(HARMONICS)[KEPT] if tones else range(HARMONICS)
    ratio += [f"{series} {n + 1} timbre" for series in SERIES[:2] for n in shown]
    ratio += [f"tone {what}" for what in TONES] if tones else []
    ratio += [f"near {point}" for point in range(1, PLACES + 1)]
    names += [f"difference {what}" for what in (*difference, *OF_A_CHANNEL)]
    return names + [f"ratio {what}" for what in (*ratio, *OF_BOTH)]
