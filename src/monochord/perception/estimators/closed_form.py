"""The closed-form estimator: position and force by physics, from the pitch of what sounds."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal

from monochord.core.errors import InputError
from monochord.core.types import Prepared, Signal
from monochord.core.units import Hertz, Metres, Newtons, Samples
from monochord.perception.closed_form.far_segment import FarSegment
from monochord.perception.closed_form.two_segments import TwoSegments
from monochord.perception.estimators.base import Estimator
from monochord.physics.theory import TensionLaw, open_frequency

FAR_ONLY = ("calibration", "length", "open_frequency", "reach", "margin", "evidence")
"""Options of the far form alone."""
BOTH_ONLY = ("tension_law", "most_force")
"""Options of the two-sided form alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm(Estimator):
    """Position from pitch alone, with nothing learned: the exact inverse of the clamped string.

    The far form uses the pitch of one segment, as on a fretted instrument: x = L (1 - f_open / f). The
    two-sided form uses both, as the sensor does: x = L f2 / (f1 + f2), and f1 f2 / (f1 + f2) gives tension,
    hence force.
    Windows are judged one by one; a window that is silent, clipped, torn by a gap, without harmonic structure
    or with two candidates gives an abstention that says so.

    Parameters
    ----------
    length
        Of the string between nut and bridge, in m. Left out, it is the signal's known string's.
    open_frequency
        Of the untouched string, in Hz, as recorded. Left out, it follows from the signal's known string.
    calibration
        Takes of known position for the far form: (frequency in Hz, position in m from the nut), or with the
        take's inharmonicity B as a third number. A position of 0 is the open note itself.
    sides
        "far", "both", or "auto": both where the signal has two channels of a known string and no open
        frequency is given, else far.
    reach
        Largest position of the far form as a share of the length.
    margin
        Least lead of the best candidate over any other, in nats of evidence.
    evidence
        Least evidence for a harmonic series over clutter, in nats. White noise stays below 25.
    tension_law, most_force
        For the two-sided form: how force raises tension, and the largest force in N that is expected.
    """

    length: Metres | None = None
    open_frequency: Hertz | None = None
    calibration: tuple[tuple[float, ...], ...] = ()
    sides: Literal["auto", "far", "both"] = "auto"
    reach: float = 0.8
    margin: float = 6.0
    evidence: float = 27.0
    tension_law: TensionLaw = "linear"
    most_force: Newtons = 2.5

    @property
    def string_length(self) -> Metres | None:
        """The option `length`."""
        return self.length

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Choose the form that `sides` asks for and the signal allows, and prepare it."""
        both = signal.channels == 2 and signal.string is not None and self.open_frequency is None
        if self.sides == "both" or (self.sides == "auto" and both):
            self._refuse_set(FAR_ONLY, "both segments", "one segment with --open-frequency")
            return self._two_segments(signal).prepare(signal.sample_rate, size)
        self._refuse_set(
            BOTH_ONLY, "the far segment alone", "both segments with two microphones and --string"
        )
        return self._far_segment(signal).prepare(signal.sample_rate, size)

    def _refuse_set(self, names: Sequence[str], form: str, remedy: str) -> None:
        """Refuse options that the form at hand has no use for."""
        usual = {each.name: each.default for each in fields(self)}
        given = [name for name in names if getattr(self, name) != usual[name]]
        if given:
            raise InputError(
                f"{given[0]} with the form of {form}",
                f"no {given[0]} there",
                f"leave it out, or use {remedy}",
            )

    def _two_segments(self, signal: Signal) -> TwoSegments:
        if signal.string is None or signal.channels != 2:
            known = "an unknown" if signal.string is None else "a known"
            given = f"two-sided form on {signal.channels} channel(s) of {known} string"
            raise InputError(given, "two channels of a known string", "name it with --string")
        if not self.most_force > 0.0:
            raise InputError(f"most_force {self.most_force:g} N", "above 0 N")
        return TwoSegments(string=signal.string, law=self.tension_law, most_force=self.most_force)

    def _far_segment(self, signal: Signal) -> FarSegment:
        string = signal.string
        length = self.length if self.length is not None or string is None else string.length
        known = self.open_frequency
        if known is None and string is not None:
            known = open_frequency(string)
        if length is None or known is None:
            missing = "length" if length is None else "open frequency"
            remedy = "give --length and --open-frequency"
            raise InputError(f"a string of unknown {missing}", "a known string", remedy)
        return FarSegment(
            length=length,
            open_frequency=known,
            calibration=self.calibration,
            reach=self.reach,
            margin=self.margin,
            evidence=self.evidence,
        )
