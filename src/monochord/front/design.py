"""Designs a sensor before it is built, like ``monochord design``."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.config import from_tree
from monochord.core.types import Contact
from monochord.front.design_figure import drawn
from monochord.physics.design import (
    CENTS,
    COMPARED,
    FRAMES,
    MAX_STRESS_SHARE,
    WIRES,
    Ambiguity,
    Candidate,
    Curves,
    Wishes,
    ambiguity,
    bounds_at,
    candidate,
    curves,
    recommended,
    sensor_from,
    stretch_cents,
    sweep,
)
from monochord.physics.sensors import Sensor, design_toml
from monochord.physics.theory import stretch_stiffness

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

HEADS = (
    "  gauge  tension  length  pitch  force std, N   position  cents    settled  stress  clearance",
    "     mm        N      mm     Hz   1 N    most    std, mm  per N         ms       %         mm",
)


@dataclass(frozen=True, kw_only=True)
class StringDesign:
    """A sensor's design: the recommended string, what it does, and what others would.

    Attributes
    ----------
    wishes
        What was asked for.
    chosen
        The recommended string with its figures.
    candidates
        Every string of the sweep.
    compared
        The recommended gauge and length at 20, 40 and 65 N.
    """

    wishes: Wishes
    chosen: Candidate
    candidates: tuple[Candidate, ...]
    compared: tuple[Candidate, ...]

    @property
    def sensor(self) -> Sensor:
        """The sensor: the recommended string with the prototype's drivers and pickups in proportion."""
        return sensor_from(self.wishes, self.chosen)

    @cached_property
    def curves(self) -> Curves:
        """Lines, their slopes and bounds along the range."""
        return curves(self.wishes, self.chosen.string)

    @cached_property
    def ambiguity(self) -> Ambiguity:
        """Places that share pairs of lines with another place."""
        return ambiguity(self.wishes, self.chosen.string)

    @property
    def pareto(self) -> tuple[Candidate, ...]:
        """Strings within strength and clearance that no other beats in both settling and force, the fastest first."""
        able = sorted(
            (each for each in self.candidates if not _unsafe(each)),
            key=lambda each: (each.settling, each.force_std),
        )
        front, best = list[Candidate](), np.inf
        for each in able:
            if each.force_std < best:
                front.append(each)
                best = each.force_std
        return tuple(front)

    @property
    def frames(self) -> dict[str, tuple[float, float]]:
        """By frame: drift in cents a kelvin, and the force in N that a kelvin reads as at 1 N."""
        string, wire = self.chosen.string, WIRES[self.wishes.wire]
        scale = CENTS * 0.5 * stretch_stiffness(string) / string.tension
        drifts = {name: scale * (expansion - wire.expansion) for name, expansion in FRAMES.items()}
        return {name: (drift, drift / self.chosen.cents_per_newton) for name, drift in drifts.items()}

    @property
    def mounts(self) -> dict[str, float]:
        """Bound of force in N by how objects are held, at 1 N in the middle."""
        string = self.chosen.string
        touch = Contact(
            position=0.501 * string.length, force=min(max(1.0, self.wishes.forces[0]), self.wishes.forces[1])
        )
        each = {
            name: from_tree(Wishes, {**asdict(self.wishes), "mount": name})
            for name in ("known", "bolted", "light", "soft")
        }
        return {name: bounds_at(wishes, string, touch)[1] for name, wishes in each.items()}

    def reasons(self) -> list[str]:
        """Return why this string is recommended, and what others cost, as sentences."""
        wishes, one = self.wishes, self.chosen
        string = one.string
        lines = [
            f"Build {1e3 * string.core_diameter:.3f} mm {wishes.wire.replace('_', ' ')}, {1e3 * string.length:.0f} mm "
            f"between the ends, at {string.tension:.0f} N ({one.frequency:.0f} Hz)."
        ]
        able = [each for each in self.candidates if not each.lacks]
        if one.lacks:
            lines.append(
                f"No string of the {len(self.candidates)} in the sweep meets every wish. This one lacks least: "
                f"{'; '.join(one.lacks)}."
            )
        else:
            lines.append(
                f"It is the fastest of {len(able)} strings that meet every wish, of {len(self.candidates)} in the sweep: "
                f"a touch settles in {1e3 * one.settling:.0f} ms."
            )
        lines.append(
            f"Force is told to {one.force_std:.2g} N at 1 N and {one.force_std_most:.2g} N at {wishes.forces[1]:g} N at "
            f"best, position to {1e3 * one.position_std:.2g} mm, if objects are held as '{wishes.mount}'."
        )
        lines.append(
            "The sensitivity to force goes as E A / T^3, so half the tension gives eight times the cents per newton."
        )
        lines += [_at(each, wishes) for each in self.compared]
        drift, force = self.frames[wishes.frame]
        least = min(self.frames, key=lambda name: abs(self.frames[name][0]))
        other = (
            "as little as any" if least == wishes.frame else f"{least} drifts by {self.frames[least][0]:+.2f}"
        )
        lines.append(
            f"A frame of {wishes.frame} drifts by {drift:+.2f} cents a kelvin ({other}), which reads as {force:+.2f} N "
            "until the open pitch is measured again."
        )
        near = one.clearance / wishes.gap
        risk = "squeals" if near > 1.0 else "is close to squealing" if near > 0.9 else "does not squeal"
        lines.append(
            f"Under {wishes.forces[1]:g} N beside a coil the string comes {1e3 * one.sag:.2f} mm nearer to the pole and "
            f"swings by {1e3 * one.swing:.2f} mm (which raises the pitch by {stretch_cents(string, one.swing):.1f} "
            f"cents): at a gap of {1e3 * wishes.gap:g} mm it {risk}."
        )
        lines.append(
            f"The wire bears {one.stress / 1e6:.0f} MPa under the largest press, {one.stress_share:.0%} of its strength."
        )
        return lines

    def lines(self) -> list[str]:
        """Return the design in convenient units, as text lines."""
        lines = [*self.reasons(), "", "Sweeps through the recommended string:", *HEADS]
        for name in ("core_diameter", "tension", "length"):
            lines += [_row(each, self.chosen) for each in self.varied(name)] + [""]
        c = self.curves
        lines.append("Along the range, at 1 N:")
        lines.append(
            "   x, mm   f1, Hz   f2, Hz   df1/dx, Hz/mm   df2/dx   df1/dF, Hz/N   df2/dF   std x, mm   std F, N"
        )
        usual = int(np.argmin(np.abs(c.forces - 1.0)))
        for i in range(0, c.positions.size, 4):
            (a, b), (p, q) = c.slopes[i]
            lines.append(
                f"{1e3 * c.positions[i]:8.1f} {c.lines[i, 0]:8.1f} {c.lines[i, 1]:8.1f} {1e-3 * a:15.2f} {1e-3 * p:8.2f} "
                f"{b:14.2f} {q:8.2f} {1e3 * c.position_std[usual, i]:11.3f} {c.force_std[usual, i]:10.3f}"
            )
        frames = ", ".join(
            f"{name} {drift:+.2f} ({force:+.2f} N)" for name, (drift, force) in self.frames.items()
        )
        mounts = ", ".join(f"{name} {value:.2g} N" for name, value in self.mounts.items())
        own = self.ambiguity
        return [
            *lines,
            f"Force at 1 N by mount: {mounts}.",
            f"Drift in cents a kelvin by frame: {frames}.",
            f"A held touch is followed up to {self.chosen.bandwidth:.1f} Hz.",
            f"Of the pairs of modes up to 6, {own.share:.0%} fit another place, too; of the fundamentals, at "
            f"{own.fundamental.mean():.0%} of places.",
        ]

    def varied(self, name: str) -> list[Candidate]:
        """Return the strings of the sweep that differ from the recommended one in one quantity at most."""
        others = {"core_diameter", "tension", "length"} - {name}
        return [
            each
            for each in self.candidates
            if all(getattr(each.string, other) == getattr(self.chosen.string, other) for other in others)
        ]

    def tree(self) -> dict[str, Any]:
        """Return the design as plain values, in SI units."""
        own, c = self.ambiguity, self.curves
        return {
            "wishes": asdict(self.wishes),
            "recommended": _tree(self.chosen),
            "reasons": self.reasons(),
            "compared": [_tree(each) for each in self.compared],
            "sweep": [_tree(each) for each in self.candidates],
            "frames": {
                name: {"cents": drift, "force": force} for name, (drift, force) in self.frames.items()
            },
            "mounts": self.mounts,
            "curves": {name: value.tolist() for name, value in _arrays(c).items()},
            "ambiguity": {
                "share": own.share,
                **{name: value.tolist() for name, value in _arrays(own).items()},
            },
        }

    def draw(self) -> "Canvas":
        """Return the figure of the design; requires matplotlib."""
        return drawn(self)

    def toml(self) -> str:
        """Return the text of a sensor file, which `load_sensor`, ``--sensor`` and the hardware's CAD take."""
        return design_toml(self.sensor)


def design(**wishes: Any) -> StringDesign:
    """Design a sensor: sweep gauge, tension and length, and recommend a string with reasons.

    Parameters
    ----------
    wishes
        Fields of `monochord.physics.design.Wishes`, in SI units: ``length`` (the room between the ends),
        ``range``, ``resolution``, ``force_resolution``, ``forces``, ``gauge``, ``tension``, ``wire``,
        ``frame``, ``mount``, ``material``, ``contact_share``, ``window``, ``gap`` and ``level``.

    Returns
    -------
    StringDesign
        The recommended string with its Cramer-Rao bounds, and all others of the sweep.

    Raises
    ------
    InputError
        For an unknown or impossible wish.

    Examples
    --------
    >>> import monochord as mc
    >>> made = mc.design(gauge=0.254e-3, tension=40.0)
    >>> made.chosen.lacks
    ('clearance 1.8 mm (gap 1.5 mm)',)
    >>> [round(each.cents_per_newton) for each in made.compared]
    [158, 31, 8]
    """
    wanted = from_tree(Wishes, wishes)
    candidates = sweep(wanted)
    chosen = recommended(wanted, candidates)
    compared = tuple(
        candidate(wanted, chosen.string.core_diameter, tension, chosen.string.length) for tension in COMPARED
    )
    return StringDesign(wishes=wanted, chosen=chosen, candidates=tuple(candidates), compared=compared)


def _unsafe(one: Candidate) -> bool:
    return any(word.startswith(("stress", "clearance", "lines", "open")) for word in one.lacks)


def _at(one: Candidate, wishes: Wishes) -> str:
    costs = list[str]()
    if one.clearance > wishes.gap:
        costs.append(f"needs a gap of {1e3 * one.clearance:.1f} mm, at which drivers pull less")
    if one.stress_share > MAX_STRESS_SHARE:
        costs.append(f"loads the wire to {one.stress_share:.0%} of its strength")
    costs.append(f"settles in {1e3 * one.settling:.0f} ms")
    own = ambiguity(wishes, one.string).share
    costs.append(f"leaves {own:.0%} of mode pairs ambiguous")
    return (
        f"At {one.string.tension:.0f} N it gives {one.cents_per_newton:.0f} cents per newton and tells 1 N to "
        f"{one.force_std:.2g} N; it {', '.join(costs[:-1])} and {costs[-1]}."
    )


def _row(one: Candidate, chosen: Candidate) -> str:
    string, mark = one.string, "*" if one.string == chosen.string else " "
    return (
        f"{mark}{1e3 * string.core_diameter:6.3f} {string.tension:8.0f} {1e3 * string.length:7.0f} {one.frequency:6.0f} "
        f"{one.force_std:7.3f} {one.force_std_most:7.3f} {1e3 * one.position_std:10.3f} {one.cents_per_newton:6.1f} "
        f"{1e3 * one.settling:10.0f} {100.0 * one.stress_share:7.0f} {1e3 * one.clearance:10.2f}"
        f"{'  lacks ' + ', '.join(word.split(' ')[0] for word in one.lacks) if one.lacks else ''}"
    )


def _tree(one: Candidate) -> dict[str, Any]:
    return {**asdict(one), "clearance": one.clearance}


def _arrays(of: Curves | Ambiguity) -> dict[str, np.ndarray]:
    return {name: getattr(of, name) for name in type(of).__dataclass_fields__}
