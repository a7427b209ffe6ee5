"""Which sensor sound comes from: what a calibrated model remembers of the sensor that it was adapted to."""

from dataclasses import dataclass

from monochord.core.ranges import Checked, Positive, Whole
from monochord.core.units import Metres

LENGTH_APART: Metres = 1e-3
"""Smallest difference of two lengths that are measured on two sensors; a ruler is good to 0.5 mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorIdentity(Checked):
    """What is known of a sensor: the design's name, the simulated build's number, the string's length in m.

    The length is measured, as with a ruler; None, or an empty name, is unknown.

    >>> mine = SensorIdentity(name="prototype", build=77)
    >>> str(mine), mine.is_other(SensorIdentity(build=300)), mine.is_other(SensorIdentity(name="prototype"))
    ('prototype, build 77', True, False)
    """

    name: str = ""
    build: Whole | None = None
    length: Positive[Metres] | None = None

    def is_other(self, other: "SensorIdentity") -> bool:
        """Return whether two identities are certainly of different sensors."""
        names = bool(self.name and other.name) and self.name != other.name
        builds = None not in (self.build, other.build) and self.build != other.build
        lengths = self.length and other.length and abs(self.length - other.length) > LENGTH_APART
        return names or builds or bool(lengths)

    def __str__(self) -> str:
        build = "" if self.build is None else f"build {self.build}"
        length = f"{1e3 * self.length:.1f} mm" if self.length else ""
        return ", ".join(filter(None, (self.name, build, length))) or "unknown"


def calibrated_elsewhere(learned: SensorIdentity | None, present: SensorIdentity | None) -> str:
    """Return the sentence that a model was calibrated on another sensor than the present one, or nothing."""
    if learned is None or present is None or not learned.is_other(present):
        return ""
    return (
        f"the model was calibrated on another sensor ({learned}; this is {present}): calibrate it on this one"
    )
