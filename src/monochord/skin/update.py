"""What a skin tells at an instant: contacts in the frame of its link, their wrench, and what is withheld."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from monochord.core.notebook import lines
from monochord.core.types import Estimate, Floats, NamedEstimates
from monochord.core.units import Seconds
from monochord.skin.geometry import SkinString


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinContact:
    """A touch of one string, in the frame of the skin's link.

    Attributes
    ----------
    string
        Name of the string.
    position, force
        Its estimates: the place from pickup 1 in m, and the normal force in N.
    point, point_covariance
        Where it is, (3,) in m, and its covariance (3, 3) in m^2; NaN where the position is withheld.
    wrench, wrench_covariance
        Its force on the link in N, then its torque about the link's origin in N m, (6,), and their covariance
        (6, 6); NaN where position or force is withheld. Friction is not part of it: no string tells it.
    """

    string: str
    position: Estimate
    force: Estimate
    point: Floats
    point_covariance: Floats
    wrench: Floats
    wrench_covariance: Floats

    def __repr__(self) -> str:
        place = ", ".join(f"{1e3 * each:.1f}" for each in self.point)
        facts = [("position", str(self.position)), ("force", str(self.force)), ("point", f"{place} mm")]
        return lines(f"SkinContact of {self.string}", facts)


def contact_of(name: str, string: SkinString, position: Estimate, force: Estimate) -> SkinContact:
    """Return the contact of estimates of position x and force f on a string, to first order in their errors.

    With the point p = p1 + x a and the direction d of the press, the wrench is (f d, p x f d). Errors of
    position, force and direction are taken as independent.
    """
    along, press = string.along, string.direction
    point, pushed = string.at(position.value), force.value * press
    turned = force.value * np.cross(along / np.linalg.norm(along), press)
    by_error = np.column_stack(
        [
            np.concatenate([np.zeros(3), np.cross(along, pushed)]) * position.std,
            np.concatenate([press, np.cross(point, press)]) * force.std,
            np.concatenate([turned, np.cross(point, turned)]) * string.press_std,
        ]
    )
    return SkinContact(
        string=name,
        position=position,
        force=force,
        point=point,
        point_covariance=position.std**2 * np.outer(along, along),
        wrench=np.concatenate([pushed, np.cross(point, pushed)]),
        wrench_covariance=by_error @ by_error.T,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinUpdate:
    """All that a skin tells at an instant.

    Attributes
    ----------
    contacts
        The strings in contact, in the skin's order; also those whose position or force is withheld.
    wrench, wrench_covariance
        The sum of the contacts' wrenches, (6,) and (6, 6): normal forces on the link, and their torque about
        its origin. NaN while anything is withheld, since the sum would lack a part; add up the contacts to
        have it without. The errors of different strings are taken as independent.
    withheld
        Strings without an answer and the reason: of the contact, or else of the position or the force.
    time
        Start of the window, in s since the stream began; NaN where the strings' estimates have none.
    strings
        The strings' updates or estimates, by name.
    """

    contacts: tuple[SkinContact, ...]
    wrench: Floats
    wrench_covariance: Floats
    withheld: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    time: Seconds = float("nan")
    strings: Mapping[str, NamedEstimates] = field(default_factory=lambda: MappingProxyType({}))

    @classmethod
    def of(
        cls,
        contacts: tuple[SkinContact, ...],
        withheld: Mapping[str, str],
        time: Seconds,
        strings: Mapping[str, NamedEstimates],
    ) -> "SkinUpdate":
        """Return the update of contacts, with the sum of their wrenches."""
        unknown = np.nan if withheld else 0.0
        return cls(
            contacts=contacts,
            wrench=sum((each.wrench for each in contacts), np.full(6, unknown)),
            wrench_covariance=sum((each.wrench_covariance for each in contacts), np.full((6, 6), unknown)),
            withheld=MappingProxyType({**withheld}),
            time=time,
            strings=MappingProxyType({**strings}),
        )

    def __repr__(self) -> str:
        touched = "; ".join(f"{each.string} {each.position}, {each.force}" for each in self.contacts)
        force, torque = (", ".join(f"{each:.3g}" for each in part) for part in np.split(self.wrench, 2))
        return lines(
            f"SkinUpdate at {self.time:.2f} s",
            [
                ("contacts", touched or "none"),
                ("wrench", f"{force} N; {torque} N m"),
                ("withheld", ", ".join(f"{name} ({reason})" for name, reason in self.withheld.items())),
            ],
        )
