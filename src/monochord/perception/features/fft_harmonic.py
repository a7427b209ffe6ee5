"""Three hundred measures of the harmonics of both segments and of the whole string."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.ranges import Positive
from monochord.core.shapes import batch
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Samples
from monochord.perception.closed_form.spectrum import Spectrum, SpectrumAnalyser
from monochord.perception.features._combination_tones import COLUMNS as TONES
from monochord.perception.features._combination_tones import (
    MIN_FORCE,
    Microphones,
    combination_tones,
    lengthening,
    with_compliance,
)
from monochord.perception.features._gaps import COLUMNS as GAPS
from monochord.perception.features._gaps import measure_gaps
from monochord.perception.features._glides import COLUMNS as GLIDES
from monochord.perception.features._glides import measure_glides
from monochord.perception.features._harmonics import (
    HARMONICS,
    expected_harmonics,
    lines_near,
    measure_channels,
    measure_harmonics,
    of_microphones,
)
from monochord.perception.features.base import Extractor, Feature, SupportsCompliance

POINTS = 24
"""Points along the string that encode the position by its distance from each."""
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
    "lead",
    "contact",
    "score",
    "left over",
    "share 1",
    "share 2",
)
SEEN_COLUMNS = ("seen place", "seen lead")
SERIES = ("segment 1", "segment 2", "string")
TIMBRE_WITH_TONES = slice(1, 3)
"""Harmonics whose timbre is a column beside combination tones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FftHarmonic(Feature):
    """Harmonics in 300 numbers: 75 each of microphone 1, of microphone 2, their difference and their ratio.

    Recipe. The plain transform of the whole window, about its mean, gives spectra under a Hann taper and,
    from three bins, the exact frequency and growth of a line. The strongest lines are read as modes of two
    segments, whichever modes the drivers sustain, or as partials of the untouched string
    (`monochord.perception.closed_form`: physics, with modes chosen by networks trained on simulated builds).
    Three series of harmonics follow: n = 1 to 8 of the segment at microphone 1, of the segment at microphone
    2, and of the whole string, at their stiff partials, or at multiples of the line that a driver sustains
    where n is one. A harmonic is the strongest bin within 1.5 bins and 0.4 % of its expected frequency. Its
    measures are:

    - level: log10 of its power, not below 1e-7 of the channel's;
    - offset: how far it lies from the expected frequency, in thousandths, within 5;
    - side: log10 of the power 3 to 8 bins beside it, over its own;
    - growth: of its amplitude in 1/s, within 30; a decay is negative.

    Offset and growth are multiplied by p / (p + 3 q), q being the power of its sidebands: noise has neither.

    - **mic 1**, **mic 2** (75 each): the four of 8 harmonics of the microphone's own segment and of 8
      partials of the string, first 16 harmonics in all; and 11 of the channel: log10 of its mean square; of
      its power from 20 to 150 Hz and from 150 to 500 Hz, where only sliding and handling sound; mean log10
      of power from 0.5, 2, 6, 12 kHz on, which is that of the gaps between the lines; flatness from 4 to 15
      kHz; rise from the first half to the second; unrest, the deviation over ten stretches; the own
      segment's fundamental in octaves over the string's.
    - **difference** (75): microphone 1 less microphone 2, in the logarithm, at the same harmonics: level and
      side of 24 harmonics of three series, growth of 16 of the segments; and the 11 of the channel.
    - **ratio** (75): of amplitudes, how alike each of 24 harmonics is at both microphones, 2 Re(A B*) /
      (A A* + B B*), which is 1 where they are equal and -1 where one is the other upside down; of 16
      harmonics of the segments the level over the loudest of its series. Of frequencies, place = f2 / (f1 +
      f2) = x / L as of a clamp, once as such and once by its distance from 24 points along the string
      (1 at the point, 0 at the next). And 10 more of both: the open frequency f1 f2 / (f1 + f2), and the
      untouched string's by its partials, in thousandths over the nominal one; the modes read; the place's
      lead, the logarithm of its odds; the lead over the untouched string; the score; the share of lines that
      the reading leaves unexplained (`left over`); the shares of the two lines' power at microphone 1.

    With `tones`, 12 measures of combination tones of both lines stand in the ratio group, in place of the
    timbre of all but the second and the third harmonic. They depend on the object's compliance, which the
    frequencies alone confound with the tension; training can vary it (`SupportsCompliance`).

    With `gaps`, 84 more columns follow the 300: sound between the lines, which sliding and rubbing make on
    any build. In each of 28 bands of equal ratio from 20 Hz to 16 kHz, of the nearest three bins or more:
    log10 of each microphone's density, the median power of the band's bins in full scale^2 / Hz (of noise,
    its mean density); and likeness, 2 Re(A B*) / (A A* + B B*), of its bins without lines, those whose
    powers together are at most both medians together.

    With `seen`, two more columns are the place that a network sees in the spectra themselves, whichever
    lines are read, and the logarithm of its odds (`monochord.perception.closed_form.place_density`).

    With `glides`, the last six columns say how fast the lines glide within the window: those of each segment,
    how far its harmonics differ in that, the speed of the place at which the segments glide apart, and the
    glide of the pitch that both share. Each is asinh of its magnitude; a touch at rest has none.

    The 300 are as many as the paper has. The bundled model `demo` uses all options: 392 columns.

    Parameters
    ----------
    tones
        Whether there are columns of combination tones.
    gaps
        Whether there are columns of the sound between the lines.
    seen
        Whether there are columns of the place seen in the spectra.
    glides
        Whether there are columns of lines that glide.
    own
        With `tones`: share of its own end's force in a microphone's signal, above a half.
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
    >>> extract = FftHarmonic(gaps=True).prepare(signal, 4410)
    >>> extract(np.zeros((1, 2, 4410), np.float32)).shape, extract.columns[-1]
    ((1, 384), 'gaps likeness band 28')
    >>> FftHarmonic(seen=True).prepare(signal, 4410).columns[-2:]
    ('seen place', 'seen lead')
    >>> FftHarmonic(glides=True).prepare(signal, 4410).columns[-1]
    'glide pitch'
    """

    tones: bool = False
    gaps: bool = False
    seen: bool = False
    glides: bool = False
    own: Annotated[float, Meta(gt=0.5, le=1.0)] = 0.85
    gain: Positive[float] = 2.0

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor, compiled, for two channels of a known string."""
        analyser = SpectrumAnalyser.of(signal, size)
        extractor = _TonesExtractor(analyser, self) if self.tones else _Extractor(analyser, self)
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(Extractor):
    def __init__(self, analyser: SpectrumAnalyser, options: FftHarmonic) -> None:
        self._analyser, self._options = analyser, options
        optional = ((options.gaps, GAPS), (options.seen, SEEN_COLUMNS), (options.glides, GLIDES))
        more = [name for there, names in optional if there for name in names]
        self._columns = (*_columns(tones=options.tones), *more)

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    def __call__(self, windows: Audio) -> Audio:
        windows = batch(windows, 2, self._analyser.size)
        rows = np.empty((len(windows), len(self._columns)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            row[:] = self._row(self._analyser.analyse(window))
        return rows

    def _row(self, spectrum: Spectrum) -> Floats:
        analyser, reading = self._analyser, spectrum.reading
        spacing, place = analyser.bin_spacing, reading.position / analyser.length
        partials = self._partials(spectrum)
        each = measure_harmonics(spectrum.transform, spectrum.power, partials, spacing)
        whole = measure_channels(spectrum.samples, spectrum.power, spacing)
        columns, timbre = of_microphones(each, whole, place)
        near = np.zeros(POINTS)
        if reading.touched:
            at = place * (POINTS - 1)
            point = min(int(at), POINTS - 2)
            near[point], near[point + 1] = point + 1 - at, at - point
        return np.concatenate(
            (
                columns,
                self._timbre_and_tones(timbre, spectrum),
                near,
                self._of_reading(spectrum),
                self._of_gaps(spectrum),
                self._of_seen(spectrum),
                self._of_glides(spectrum, partials),
            )
        )

    def _timbre_and_tones(self, timbre: Floats, spectrum: Spectrum) -> Floats:  # noqa: ARG002
        return timbre.ravel()

    def _partials(self, spectrum: Spectrum) -> Floats:
        """Return the expected harmonics of the three series, (3, `HARMONICS`) in Hz."""
        analyser, reading = self._analyser, spectrum.reading
        far = analyser.length - reading.position if reading.touched else 0.0
        segments = (
            (reading.position, reading.line_1, reading.mode_1),
            (far, reading.line_2, reading.mode_2),
        )
        rest = reading.untouched_frequency or analyser.nominal
        return expected_harmonics(segments, reading.open_frequency, rest, analyser.model)

    def _of_gaps(self, spectrum: Spectrum) -> Floats:
        if not self._options.gaps:
            return np.zeros(0)
        return measure_gaps(spectrum.transform, spectrum.power, self._analyser.bin_spacing).ravel()

    def _of_seen(self, spectrum: Spectrum) -> Floats:
        if not self._options.seen:
            return np.zeros(0)
        return np.array((spectrum.reading.seen_position / self._analyser.length, spectrum.reading.seen_lead))

    def _of_glides(self, spectrum: Spectrum, partials: Floats) -> Floats:
        if not self._options.glides:
            return np.zeros(0)
        near = spectrum.reading.position
        sides = (near, self._analyser.length - near if spectrum.reading.touched else 0.0)
        spacing = self._analyser.bin_spacing
        lines = lines_near(spectrum.power, partials[:2], spacing)
        return measure_glides(spectrum.transform, lines, partials[:2], spacing, sides)

    def _of_reading(self, spectrum: Spectrum) -> tuple[float, ...]:
        reading, analyser = spectrum.reading, self._analyser
        return (
            reading.position / analyser.length,
            analyser.per_mille(reading.open_frequency),
            analyser.per_mille(reading.untouched_frequency),
            reading.mode_1,
            reading.mode_2,
            reading.lead,
            reading.contact_lead,
            reading.score,
            reading.unexplained,
            reading.share_1,
            reading.share_2,
        )


class _TonesExtractor(_Extractor, SupportsCompliance):
    """The extractor with combination tones, which depend on the object's compliance."""

    def __init__(self, analyser: SpectrumAnalyser, options: FftHarmonic) -> None:
        super().__init__(analyser, options)
        self._tones = np.flatnonzero([name.startswith("ratio tone ") for name in self._columns])

    def _timbre_and_tones(self, timbre: Floats, spectrum: Spectrum) -> Floats:
        analyser, reading, options = self._analyser, spectrum.reading, self._options
        tones = combination_tones(
            spectrum.transform,
            spectrum.power,
            analyser.size,
            analyser.bin_spacing,
            (reading.line_1, reading.line_2, reading.position),
            analyser.model,
            analyser.string.tension,
            Microphones(options.own, options.gain),
        )
        return np.concatenate((timbre[:, TIMBRE_WITH_TONES].ravel(), tones))

    def with_compliance(self, rows: Audio, force: Floats, share: Floats) -> Audio:
        """Return rows of objects of another compliance: tones and open frequency follow."""
        augmented, touched = rows.copy(), np.flatnonzero(force > 0.0)
        tones, forces, shares = rows[touched][:, self._tones], force[touched], share[touched]
        scale = np.maximum(forces, MIN_FORCE) ** (-1.0 / 3.0)
        longer = lengthening(tones, forces) * scale * (shares - 1.0)
        # A thousandth of a metre of each of two segments, in thousandths of the length.
        shift = (2.0 * longer / self._analyser.length).astype(np.float32)
        augmented[touched, self._columns.index("ratio open")] -= shift
        augmented[touched[:, np.newaxis], self._tones] = with_compliance(tones, forces, shares)
        return augmented


def _columns(*, tones: bool) -> list[str]:
    numbers = range(1, HARMONICS + 1)
    series = [f"{name} {n}" for name in SERIES for n in numbers]
    own = [f"{name} {n} {what}" for name in ("own", "string") for n in numbers for what in HARMONIC_COLUMNS]
    microphone = [*own, *CHANNEL_COLUMNS]
    difference = [f"{one} level" for one in series] + [f"{one} side" for one in series]
    difference += [f"{one} growth" for one in series[: 2 * HARMONICS]]
    timbre = range(1, HARMONICS + 1)[TIMBRE_WITH_TONES] if tones else numbers
    ratio = [f"{one} likeness" for one in series]
    ratio += [f"{name} {n} timbre" for name in SERIES[:2] for n in timbre]
    ratio += [f"tone {name}" for name in TONES] if tones else []
    ratio += [f"near {point}" for point in range(1, POINTS + 1)]
    groups = {
        "mic 1": microphone,
        "mic 2": microphone,
        "difference": [*difference, *CHANNEL_COLUMNS],
        "ratio": [*ratio, *READING_COLUMNS],
    }
    return [f"{group} {name}" for group, names in groups.items() for name in names]
