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
"""Harmonics that keep their timbre columns when combination tones are on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FftHarmonic(Feature):
    """300 measures of harmonics: 75 each for microphone 1, microphone 2, their difference and their ratio.

    The Fourier transform of the whole window, mean removed, gives spectra with a Hann taper. Three bins give
    the exact frequency and growth rate of a line. The strongest lines are read as modes of two segments,
    whichever modes the drivers sustain, or as partials of the untouched string. The reading is physics, with
    modes chosen by networks trained on simulated builds (`monochord.perception.closed_form`).

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
      both in thousandths above nominal; both modes; the lead of the place (its log odds); the lead over the
      untouched string; the score; the share of lines that the reading does not explain (`left over`); and the
      share of each line's power at microphone 1.

    `tones` replaces part of the timbre in the ratio group by 12 measures of combination tones of the two
    lines; the timbre of the second and third harmonics stays. Combination tones depend on the object's
    compliance; from the frequencies alone, compliance and tension cannot be told apart. Training can vary the
    compliance (`SupportsCompliance`).

    `gaps` adds 84 columns of the sound between the lines, which sliding and rubbing make on any build. There
    are 28 bands of equal ratio from 20 Hz to 16 kHz, each at least three bins wide. A band has three columns:
    log10 of each microphone's power density, from the median over the band's bins, in full scale^2 / Hz (for
    noise, the mean density); and the likeness 2 Re(A B*) / (A A* + B B*) over the bins without lines. A bin
    is without lines if its power, summed over both microphones, is at most the sum of the two medians.

    `seen` adds two columns: the place that a network estimates from the spectra, whichever lines are read,
    and its log odds (`monochord.perception.closed_form.place_density`).

    `glides` adds six columns on how fast lines glide within the window: the glide of each segment's lines,
    the spread of the glides within each segment, the speed of the place if the segments glide apart, and the
    glide of pitch common to both. Each is asinh of the magnitude, and 0 for a touch at rest.

    The paper's feature has 300 columns as well. The bundled model `demo` uses all options: 392 columns.

    Parameters
    ----------
    tones
        Add columns of combination tones.
    gaps
        Add columns of the sound between the lines.
    seen
        Add columns of the place that a network estimates from the spectra.
    glides
        Add columns of gliding lines.
    own
        With `tones`: share of the force at a microphone's own end in its signal, above 0.5; the rest is
        crosstalk. The prototype's by default.
    gain
        With `tones`: gain of a microphone, in full scale per newton. The prototype's by default.

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
