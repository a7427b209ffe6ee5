"""Position and tension by the inverse of the clamped string, with the scores for and against them."""

from dataclasses import dataclass

import numpy as np

from monochord.core.ranges import NonNegative, Positive
from monochord.core.shapes import batch
from monochord.core.types import Audio, Signal, Window
from monochord.core.units import Metres, Newtons, Samples
from monochord.perception.closed_form.modes import ModeReading
from monochord.perception.closed_form.spectrum import SpectrumAnalyser
from monochord.perception.closed_form.usable import why_unusable
from monochord.perception.features.base import Extractor, Feature
from monochord.physics.theory import force_from_tension

REASONS = ("silence", "samples that are not numbers", "clipped")
COLUMNS = (
    "position",
    "tension",
    "open",
    "force",
    "fundamental 1",
    "fundamental 2",
    "mode 1",
    "mode 2",
    "line 1",
    "line 2",
    "share 1",
    "share 2",
    "score",
    "lead",
    "rival position",
    "contact",
    "untouched score",
    "rest",
    "left over",
    "lines",
    "no reading",
    "two candidates",
    "untouched",
    *REASONS,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm(Feature):
    """The inverse of the clamped, stiff string from its two strongest lines, their harmonic numbers resolved.

    x = L f2 / (f1 + f2) and T = mu (2 L f1 f2 / (f1 + f2))^2, where f1 and f2 are the fundamentals of the
    segments with stiffness taken off. `monochord.perception.closed_form.modes` chooses their modes by
    networks trained on simulated builds, for this feature and for the estimator of the same name alike.

    Columns: `position` in m, `tension` in N, `open`, the open frequency that follows from it in thousandths
    over nominal, and `force` in N by the geometric law if the untouched string has its nominal tension, 0
    below that; the two fundamentals and the two lines in kHz, their modes, and the share of their power at
    microphone 1; the `score` of two segments, the `lead` of the place (the logarithm of its odds against all
    others), the best rival's position in m, the score's lead over the untouched string (`contact`), that
    string's own score and its frequency in thousandths over nominal (`rest`); the share of lines that the
    reading leaves unexplained (`left over`), and the count of lines. Flags, 0 or 1: no reading; two
    candidates, where the lead is less than `margin`; untouched, where contact is negative; and why the window
    cannot be used. Of a string tuned otherwise than its design, tension and frequencies are as if it were
    tuned so.

    Parameters
    ----------
    margin
        Lead of the place below which two candidates are flagged.
    most_force
        Largest force in the column `force`, in N.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = ClosedForm().prepare(signal, 4410)
    >>> row = extract(np.zeros((1, 2, 4410), np.float32))[0]
    >>> [extract.columns[k] for k in np.flatnonzero(row == 1.0)]
    ['no reading', 'silence']
    """

    margin: NonNegative[float] = 2.0
    most_force: Positive[Newtons] = 5.0

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor, compiled, for two channels of a known string."""
        analyser = SpectrumAnalyser.of(signal, size)
        extractor = _Extractor(analyser, self, signal.tension_scale)
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(Extractor):
    def __init__(self, analyser: SpectrumAnalyser, options: ClosedForm, tension_scale: float) -> None:
        self._analyser, self._string, self._options = analyser, analyser.string, options
        self._tension_scale, self._kilohertz = tension_scale, 1000.0 / tension_scale**0.5

    @property
    def columns(self) -> tuple[str, ...]:
        return COLUMNS

    def __call__(self, windows: Audio) -> Audio:
        windows = batch(windows, 2, self._analyser.size)
        rows = np.empty((len(windows), len(COLUMNS)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            row[:] = (*self._values(self._analyser.analyse(window).reading), *self._unusable(window))
        return rows

    def _values(self, reading: ModeReading) -> tuple[float, ...]:
        analyser, string, touched = self._analyser, self._string, reading.touched
        tension = string.linear_density * (2.0 * string.length * reading.open_frequency) ** 2
        segments = (reading.position, string.length - reading.position)
        first, second = (
            reading.open_frequency * string.length / side if touched else 0.0 for side in segments
        )
        return (
            reading.position,
            tension * self._tension_scale,
            analyser.per_mille(reading.open_frequency),
            self._force(tension, reading.position),
            first / self._kilohertz,
            second / self._kilohertz,
            reading.mode_1,
            reading.mode_2,
            reading.line_1 / self._kilohertz,
            reading.line_2 / self._kilohertz,
            reading.share_1,
            reading.share_2,
            reading.score,
            reading.lead,
            reading.rival_position,
            reading.contact_lead,
            reading.untouched_score,
            analyser.per_mille(reading.untouched_frequency),
            reading.unexplained,
            reading.lines,
            float(not touched),
            float(touched and reading.lead < self._options.margin),
            float(reading.contact_lead < 0.0),
        )

    def _force(self, tension: Newtons, position: Metres) -> Newtons:
        if tension <= self._string.tension or position <= 0.0 or self._string.core_diameter == 0.0:
            return 0.0
        force = force_from_tension(self._string, tension, position, "geometric")
        return min(force, self._options.most_force)

    def _unusable(self, window: Audio) -> list[float]:
        why_not = why_unusable(Window(samples=window, start=0, sample_rate=self._analyser.sample_rate))
        return [float(why_not == reason) for reason in REASONS]
