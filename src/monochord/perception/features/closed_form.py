"""Position and tension from the inverse of the clamped string, with scores for and against the reading."""

from dataclasses import dataclass

import numpy as np

from monochord.core.ranges import NonNegative, Positive
from monochord.core.shapes import batch
from monochord.core.types import Audio, Signal, Window
from monochord.core.units import Metres, Newtons, Samples
from monochord.perception.closed_form.modes import ModeReading
from monochord.perception.closed_form.spectrum import SpectrumAnalyser
from monochord.perception.closed_form.usable import unusable_reason
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
    """The inverse of the clamped, stiff string from its two strongest lines.

    x = L f2 / (f1 + f2) and T = mu (2 L f1 f2 / (f1 + f2))^2, where f1 and f2 are the fundamentals of the
    segments, corrected for stiffness. `monochord.perception.closed_form.modes` assigns a mode number to each
    line with networks trained on simulated builds. The estimator of the same name uses the same readings.

    Columns of the touch: `position` in m; `tension` in N; `open`, the open frequency for this tension, in
    thousandths above nominal; `force` in N by the geometric law for a string of nominal tension, 0 for a
    lower tension. Columns of the lines: both fundamentals and both lines in kHz, their modes, and the share
    of each line's power at microphone 1.

    Columns of confidence: `score` of the two-segment reading; `lead`, the log odds of the position against
    all others; `rival position` in m, the next best one; `contact`, the score's lead over the untouched
    string; `untouched score`, and `rest`, the untouched string's frequency in thousandths above nominal;
    `left over`, the share of unexplained lines; `lines`, the number of lines.

    Flags, 0 or 1: no reading; two candidates (`lead` below `margin`); untouched (`contact` negative); and one
    for each reason that makes a window unusable. If the string is not tuned as its design states, tension and
    frequencies are scaled to the design's tuning.

    Parameters
    ----------
    margin
        Lead of the position below which two candidates are flagged.
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
        """Return the compiled extractor for two channels of a known string."""
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
        problem = unusable_reason(Window(samples=window, start=0, sample_rate=self._analyser.sample_rate))
        return [float(problem == reason) for reason in REASONS]
