"""Three hundred measures of the harmonics of both segments and of the whole string."""

from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio, Signal
from monochord.core.units import Samples
from monochord.perception.features._harmonics import (
    HARMONICS,
    expected_harmonics,
    measure_channels,
    measure_harmonics,
    of_microphones,
)
from monochord.perception.features.base import Extractor, Feature, SpectrumExtractor
from monochord.perception.reader.measures import COLUMNS as MEASURES
from monochord.perception.reader.measures import LINES, POSITION, UNTOUCHED
from monochord.perception.reader.reader import Reader
from monochord.perception.spectrum import Spectrum, SpectrumAnalyser

POINTS = 24
"""Points along the string; the position is encoded by its distance from each."""
HARMONIC_COLUMNS = ("level", "offset", "side", "growth")
CHANNEL_COLUMNS = (
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
READING_COLUMNS = (
    "place",
    "open",
    "rest",
    "mode 1",
    "mode 2",
    "mass",
    "untouched",
    "rival",
    "agreement",
    "share 1",
    "share 2",
)
READ = np.array([MEASURES.index(name) for name in READING_COLUMNS[1:9]])
LEVELS = np.array([MEASURES.index(f"level {line}") for line in LINES])
LOG_HALF = float(np.log(0.5))
"""Logarithm of the probability of no touch from which a window counts as untouched."""
SERIES = ("segment 1", "segment 2", "string")


@dataclass(frozen=True, slots=True, kw_only=True)
class FftHarmonic(Feature):
    """300 measures of harmonics: 75 each for microphone 1, microphone 2, their difference and their ratio.

    The Fourier transform of the whole window, mean removed, gives spectra with a Hann taper. Three bins give
    the exact frequency and growth rate of a line. The reader (`monochord.perception.reader`) tells both
    segments' lines and modes, whichever modes the drivers sustain, or the partials of the untouched string.

    Three series of harmonics follow, n = 1 to 8 each: the segment at microphone 1, the segment at microphone
    2, and the whole string. Harmonics are expected at the stiff partials; if n is a multiple of the mode of a
    segment's driven line, at the corresponding multiple of this line. A harmonic is the strongest bin within
    1.5 bins and 0.4 % of its expected frequency. Its measures are:

    - level: log10 of its power, at least 1e-7 of the channel's power;
    - offset: deviation from the expected frequency in thousandths, limited to 5;
    - side: log10 of the power 3 to 8 bins to either side, relative to its own;
    - growth: growth rate of its amplitude in 1/s, limited to 30; negative for decay.

    Offset and growth are multiplied by p / (p + 3 q), where p is the harmonic's power and q the power of its
    sidebands. So both vanish for noise. The four groups are:

    - **mic 1**, **mic 2** (75 each). Level, offset, side and growth of 16 harmonics: 8 of the segment at this
      microphone and 8 partials of the string. Then 11 measures of the channel: log10 of its mean square;
      log10 of its power from 20 to 150 Hz and from 150 to 500 Hz, where only sliding and handling sound; mean
      log10 of the power in the bands between 0.5, 2, 6, 12 and 20 kHz, which measures the gaps between the
      lines; spectral flatness from 4 to 15 kHz; rise, the change of log10 of the mean square from the first
      half of the window to the second; unrest, the standard deviation of this level over ten parts of the
      window; the fundamental of this microphone's segment, in octaves above the string's.
    - **difference** (75). Microphone 1 minus microphone 2, in logarithms: level and side of the 24 harmonics
      of all series, growth of the 16 harmonics of the segments, and the 11 measures of the channel.
    - **ratio** (75). Amplitudes: the likeness of each of the 24 harmonics at both microphones, 2 Re(A B*) /
      (A A* + B B*), which is 1 for equal signals and -1 for inverted ones; and the level of the 16 harmonics
      of the segments relative to the loudest of their series (timbre). Frequencies: place = f2 / (f1 + f2) =
      x / L for a clamp, and its encoding by 24 points along the string (1 at the point, 0 at the next). The
      other 10: the open frequency f1 f2 / (f1 + f2) and the untouched string's frequency from its partials,
      both in thousandths above nominal; both modes; the probability of the place, of no touch (as logarithm)
      and of the best other place; the share of lines that agree on the untouched string; and the share of
      each line's power at microphone 1.

    The paper's feature has 300 columns as well.

    Notes
    -----
    Sources: frequencies of a split string, Yi, Xing, Manchester and Fazeli, Sound of Touch; stiff partials,
    Fletcher (1964); frequency and growth of a line, Auger and Flandrin (1995). The other measures are
    Monochord's own.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = FftHarmonic().prepare(signal, 4410)
    >>> extract(np.zeros((1, 2, 4410), np.float32)).shape, extract.columns[0]
    ((1, 300), 'mic 1 own 1 level')
    """

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor, compiled, for two channels of a known string."""
        extractor = _Extractor(Reader.of(SpectrumAnalyser.of(signal, size)))
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(SpectrumExtractor):
    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._columns = tuple(_columns())

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    @property
    def analyser(self) -> SpectrumAnalyser:
        return self._reader.analyser

    def row(self, spectrum: Spectrum) -> Audio:
        spacing = self._reader.analyser.bin_spacing
        measures, _, _ = self._reader.alone(spectrum)
        touched = measures[UNTOUCHED] < LOG_HALF
        place = float(measures[POSITION]) if touched else 0.0
        partials = expected_harmonics(self._reader.analyser, measures, touched=touched)
        each = measure_harmonics(spectrum.transform, spectrum.power, partials, spacing)
        whole = measure_channels(spectrum.samples, spectrum.power, spacing)
        columns, timbre = of_microphones(each, whole, place)
        near = np.zeros(POINTS)
        if touched:
            at = place * (POINTS - 1)
            point = min(int(at), POINTS - 2)
            near[point], near[point + 1] = point + 1 - at, at - point
        # Of each line, its power at microphone 1 over that at both.
        shares = 1.0 / (1.0 + 10.0 ** (measures[LEVELS[1::2]] - measures[LEVELS[::2]]))
        reading = (place, *measures[READ], *shares)
        whole_row = (columns, timbre.ravel(), near, reading)
        return np.concatenate(whole_row, dtype=np.float32, casting="same_kind")


def _columns() -> list[str]:
    numbers = range(1, HARMONICS + 1)
    series = [f"{name} {n}" for name in SERIES for n in numbers]
    harmonics = [
        f"{name} {n} {what}" for name in ("own", "string") for n in numbers for what in HARMONIC_COLUMNS
    ]
    microphone = [*harmonics, *CHANNEL_COLUMNS]
    difference = [f"{one} level" for one in series] + [f"{one} side" for one in series]
    difference += [f"{one} growth" for one in series[: 2 * HARMONICS]]
    ratio = [f"{one} likeness" for one in series]
    ratio += [f"{name} {n} timbre" for name in SERIES[:2] for n in numbers]
    ratio += [f"near {point}" for point in range(1, POINTS + 1)]
    groups = {
        "mic 1": microphone,
        "mic 2": microphone,
        "difference": [*difference, *CHANNEL_COLUMNS],
        "ratio": [*ratio, *READING_COLUMNS],
    }
    return [f"{group} {name}" for group, names in groups.items() for name in names]
