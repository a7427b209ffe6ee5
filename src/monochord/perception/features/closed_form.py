"""Position and tension by physics alone, with what speaks for and against them."""

from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal, Window
from monochord.core.units import Metres, Newtons, Samples
from monochord.perception.closed_form.usable import why_unusable
from monochord.perception.features._ear import Ear, Heard
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
    segments with stiffness taken off. Which modes the lines are, `features._reading` decides.

    Columns: position in m, tension in N, the open frequency that it means in thousandths over the nominal
    one, and the force in N that the geometric law wants for that tension if the untouched string has its
    nominal one, 0 where it is lower; the two fundamentals and the two lines in kHz, their modes, and the
    share of their power that microphone 1 hears; the score of the reading, its lead over the best rival
    that puts the touch elsewhere, the rival's position in m, its lead over the untouched string
    (`contact`), that string's own score and its frequency in thousandths over nominal (`rest`); the share
    of lines that the reading leaves over, and how many lines there are. Flags, 0 or 1: no reading at all;
    two candidates, where the lead is less than `margin`; untouched, where contact is negative; and why the
    window cannot be used.

    Parameters
    ----------
    margin
        Lead of the best reading below which two candidates are flagged.
    most_force
        Largest force told, in N.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> extract = ClosedForm().prepare(signal, 4410)
    >>> row = extract(np.zeros((1, 2, 4410), np.float32))[0]
    >>> [extract.columns[k] for k in np.flatnonzero(row == 1.0)]
    ['no reading', 'silence']
    """

    margin: float = 0.25
    most_force: Newtons = 5.0

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor, compiled, for two channels of a known string."""
        ear = Ear.of(signal, size)
        if not (0.0 <= self.margin < np.inf and 0.0 < self.most_force < np.inf):
            given = f"margin {self.margin:g}, most_force {self.most_force:g} N"
            raise InputError(given, "a margin from 0 on and a force above 0 N")
        extractor = _Extractor(ear, self)
        extractor(np.zeros((1, 2, size), np.float32))
        return extractor


class _Extractor(Extractor):
    def __init__(self, ear: Ear, options: ClosedForm) -> None:
        self._ear, self._string, self._options = ear, ear.string, options

    @property
    def columns(self) -> tuple[str, ...]:
        return COLUMNS

    def __call__(self, windows: Audio) -> Audio:
        rows = np.empty((len(windows), len(COLUMNS)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            row[:] = (*self._told(self._ear.hear(window)), *self._unusable(window))
        return rows

    def _told(self, heard: Heard) -> tuple[float, ...]:
        told, ear, string = heard.reading, self._ear, self._string
        touched = told.position > 0.0
        tension = string.linear_density * (2.0 * ear.length * told.open_frequency) ** 2
        sides = (told.position, ear.length - told.position)
        first, second = (told.open_frequency * ear.length / side if touched else 0.0 for side in sides)
        lead, contact = told.score - told.rival, told.score - told.untouched
        return (
            told.position,
            tension,
            ear.per_mille(told.open_frequency),
            self._force(tension, told.position),
            first / 1000.0,
            second / 1000.0,
            told.mode_1,
            told.mode_2,
            told.line_1 / 1000.0,
            told.line_2 / 1000.0,
            told.share_1,
            told.share_2,
            told.score,
            lead,
            told.rival_position,
            contact,
            told.untouched,
            ear.per_mille(told.rest_frequency),
            told.left_over,
            told.lines,
            float(not touched),
            float(touched and lead < self._options.margin),
            float(contact < 0.0),
        )

    def _force(self, tension: Newtons, position: Metres) -> Newtons:
        if tension <= self._string.tension or position <= 0.0 or self._string.core_diameter == 0.0:
            return 0.0
        force = force_from_tension(self._string, tension, position, "geometric")
        return min(force, self._options.most_force)

    def _unusable(self, window: Audio) -> list[float]:
        samples = np.array(window, np.float32, order="C")
        why_not = why_unusable(Window(samples=samples, start=0, sample_rate=self._ear.sample_rate))
        return [float(why_not == reason) for reason in REASONS]
