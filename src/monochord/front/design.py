"""Designs a sensor before it is built, like ``monochord design``."""

from dataclasses import asdict, dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.notebook import lines
from monochord.core.types import Contact
from monochord.core.units import Metres, Newtons
from monochord.perception.model import Model
from monochord.perception.model import load as load_model
from monochord.physics.design import (
    CENTS,
    COMPARED,
    FRAMES,
    MAX_MODE,
    MAX_STRESS_SHARE,
    NO_MODEL,
    WIRES,
    Ambiguity,
    StringCandidate,
    StringCurves,
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
from monochord.physics.sensors import Sensor, design_toml, with_length
from monochord.physics.theory import stretch_stiffness

LENGTHS = "length", "range", "resolution", "gauge", "end_std", "gap"
"""Wishes that are lengths in m."""
MARKS = {None: "", True: "takes", False: "-"}
BUILT_LENGTH = 0.01
"""How much longer or shorter than its design a string may be built, as a share."""
HEADS = (
    "  gauge  tension  length  pitch  force std, N   position  cents    settled  stress  clearance  model",
    "     mm        N      mm     Hz   1 N    most    std, mm  per N         ms       %         mm       ",
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
    chosen: StringCandidate
    candidates: tuple[StringCandidate, ...]
    compared: tuple[StringCandidate, ...]

    def __repr__(self) -> str:
        chosen, string = self.chosen, self.chosen.string
        return lines(
            f"StringDesign: {1e3 * string.length:.0f} mm of {1e3 * string.core_diameter:.3g} mm wire"
            f" at {string.tension:.0f} N, {chosen.frequency:.0f} Hz",
            [
                ("smallest errors", f"{1e3 * chosen.position_std:.2g} mm, {chosen.force_std:.2g} N"),
                ("settles in", f"{1e3 * chosen.settling:.0f} ms"),
                ("lacks", ", ".join(chosen.lacks)),
                ("compared with", f"{len(self.candidates)} strings"),
            ],
        )

    @property
    def sensor(self) -> Sensor:
        """The sensor: the recommended string with the prototype's drivers and pickups in proportion."""
        return sensor_from(self.wishes, self.chosen)

    def bounds(self, contact: Contact) -> tuple[Metres, Newtons]:
        """Return the smallest standard errors of position and force of a touch, in m and N.

        An estimator that knows build, object and mount, and one that knows their classes:

        >>> touch = Contact(position=0.08, force=1.0)
        >>> known = {"mount": "known", "contact_share": 0.0, "end_std": 0.0}
        >>> made = [design(gauge=0.254e-3, tension=65.0, **each) for each in (known, {})]
        >>> [round(each.bounds(touch)[1], 2) for each in made]
        [0.07, 0.13]
        """
        return bounds_at(self.wishes, self.chosen.string, contact)

    @cached_property
    def curves(self) -> StringCurves:
        """Lines, their slopes and bounds along the range."""
        return curves(self.wishes, self.chosen.string)

    @cached_property
    def ambiguity(self) -> Ambiguity:
        """Places that share pairs of lines with another place."""
        return ambiguity(self.wishes, self.chosen.string)

    @property
    def pareto(self) -> tuple[StringCandidate, ...]:
        """Strings that hold and do not squeal, and that no other beats in settling and force, by settling."""
        able = sorted(
            (each for each in self.candidates if not _unsafe(each)),
            key=lambda each: (each.settling, each.force_std),
        )
        front, best = list[StringCandidate](), np.inf
        for each in able:
            if each.force_std < best:
                front.append(each)
                best = each.force_std
        return tuple(front)

    @property
    def squeal(self) -> str:
        """Whether the string squeals at the wished gap, as the words that follow "it"."""
        near = self.chosen.clearance / self.wishes.gap
        return "squeals" if near > 1.0 else "is close to squealing" if near > 0.9 else "does not squeal"

    @property
    def frames(self) -> dict[str, tuple[float, float]]:
        """By frame: drift in cents a kelvin, and the force in N that a kelvin reads as at 1 N."""
        string, wire = self.chosen.string, WIRES[self.wishes.wire]
        scale = CENTS * 0.5 * stretch_stiffness(string) / string.tension
        drifts = {name: scale * (expansion - wire.expansion) for name, expansion in FRAMES.items()}
        return {name: (drift, drift / self.chosen.cents_per_newton) for name, drift in drifts.items()}

    @property
    def mounts(self) -> dict[str, float]:
        """Bound of force in N by how objects are held, at the usual press in the middle."""
        string = self.chosen.string
        touch = Contact(position=0.501 * string.length, force=self.wishes.usual)
        each: dict[str, Wishes] = {
            "known": replace(self.wishes, mount="known"),
            "bolted": replace(self.wishes, mount="bolted"),
            "light": replace(self.wishes, mount="light"),
            "soft": replace(self.wishes, mount="soft"),
        }
        return {name: bounds_at(wishes, string, touch)[1] for name, wishes in each.items()}

    def reasons(self) -> list[str]:
        """Return why this string is recommended, and what others cost, as sentences."""
        wishes, one, string = self.wishes, self.chosen, self.chosen.string
        gauge, wire = 1e3 * string.core_diameter, wishes.wire.replace("_", " ")
        usual, most = f"{wishes.usual:g} N", f"{wishes.forces[1]:g} N"
        among = [each for each in self.candidates if each.fits_model == one.fits_model]
        able, count = [each for each in among if not each.lacks], len(among)
        lacks = ", ".join(one.lacks)
        why = (
            f"It is the fastest of the {len(able)} strings that meet every wish, of {count} in the sweep."
            if able
            else f"No string of the {count} in the sweep meets every wish; this one lacks {lacks}."
        )
        build = (
            f"{gauge:.3f} mm {wire}, {1e3 * string.length:.0f} mm between the ends, {string.tension:.0f} N"
        )
        tells = f"{usual} to {one.force_std:.2g} N, {most} to {one.force_std_most:.2g} N"
        position, stress = f"position to {1e3 * one.position_std:.2g} mm", one.stress / 1e6
        glide = stretch_cents(string, one.swing)
        swing, sag, gap = (f"{1e3 * each:.2f} mm" for each in (one.swing, one.sag, wishes.gap))
        return [
            f"Build: {build} ({one.frequency:.0f} Hz).",
            f"{why} A touch settles in {1e3 * one.settling:.0f} ms.",
            *self._model(),
            f"At best it tells {tells}, and {position} (objects held as '{wishes.mount}').",
            f"Of its pairs of modes up to {MAX_MODE}, {self.ambiguity.share:.0%} fit another place too.",
            "Sensitivity to force goes as E A / T^3: half the tension gives eight times the cents.",
            *(_at(each, wishes) for each in self.compared),
            self._drifts(),
            f"The string swings by {swing}. {most} at an end of the range bring it {sag} nearer to a pole.",
            f"At a gap of {gap} it {self.squeal}. The swing raises the pitch by {glide:.1f} cents.",
            f"Under {most} the wire bears {stress:.0f} MPa, {one.stress_share:.0%} of its strength.",
        ]

    def _model(self) -> list[str]:
        """Return whether the wished model takes the string, as a sentence; none without a model."""
        name, others = self.wishes.model, sum(not each.fits_model for each in self.candidates)
        if self.chosen.fits_model is None:
            return []
        if not self.chosen.fits_model:
            return [f"The model '{name}' takes no string of these wishes: train one for this sensor."]
        left = f"; {others} strings that it refuses are left out" if others else ""
        return [f"The model '{name}' takes it{left}. Model 'none' recommends among all strings."]

    def _drifts(self) -> str:
        frame, (drift, force) = self.wishes.frame, self.frames[self.wishes.frame]
        least = min(self.frames, key=lambda name: abs(self.frames[name][0]))
        if least == frame:
            return f"A frame of {frame} drifts least, by {abs(drift):.2f} cents a kelvin."
        other = f"{least}: {self.frames[least][0]:+.2f}"
        return (
            f"A frame of {frame} drifts by {drift:+.2f} cents a kelvin ({other}). "
            f"Until the open pitch is measured again, a kelvin reads as {force:+.2f} N."
        )

    def lines(self) -> list[str]:
        """Return the design in convenient units, as text lines."""
        sweeps = [
            line
            for name in ("core_diameter", "tension", "length")
            for line in (*(_row(each, self.chosen) for each in self.varied(name)), "")
        ]
        ambiguous, usual = self.ambiguity.fundamental.mean(), f"{self.wishes.usual:g} N"
        frames = ", ".join(
            f"{name} {drift:+.2f} ({force:+.2f} N)" for name, (drift, force) in self.frames.items()
        )
        mounts = ", ".join(f"{name} {value:.2g} N" for name, value in self.mounts.items())
        return [
            *self.reasons(),
            "",
            "Sweeps through the recommended string:",
            *HEADS,
            *sweeps,
            f"Along the range, under {usual}:",
            *_along(self.curves, self.wishes.usual),
            "",
            f"Standard error of {usual} in the middle, by mount: {mounts}.",
            f"Drift in cents a kelvin, and what it reads as, by frame: {frames}.",
            f"A held touch is followed up to {self.chosen.bandwidth:.1f} Hz.",
            f"Places where the pair of fundamentals fits another place too: {ambiguous:.0%}.",
        ]

    def varied(self, name: str) -> list[StringCandidate]:
        """Return the strings of the sweep that differ from the recommended one in one quantity at most."""
        others = {"core_diameter", "tension", "length"} - {name}
        return [
            each
            for each in self.candidates
            if all(getattr(each.string, other) == getattr(self.chosen.string, other) for other in others)
        ]

    def tree(self) -> dict[str, Any]:
        """Return the design as plain values, in SI units."""
        ambiguous, c = self.ambiguity, self.curves
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
                "share": ambiguous.share,
                **{name: value.tolist() for name, value in _arrays(ambiguous).items()},
            },
        }

    def toml(self) -> str:
        """Return the text of a sensor file, which `load_sensor`, ``--sensor`` and the hardware's CAD take."""
        return design_toml(self.sensor)


def design(**wishes: Any) -> StringDesign:
    """Design a sensor: sweep gauge, tension and length, and recommend a string with reasons.

    Parameters
    ----------
    wishes
        Fields of `monochord.physics.design.Wishes`, in SI units, such as ``range`` or ``tension``.

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
    [157, 31, 8]
    """
    refuse_other_units(**{name: wishes.get(name) for name in LENGTHS})
    wanted = from_tree(Wishes, wishes)
    model = _model_of(wanted.model)
    trained = model.definition.string if model else None
    candidates = _marked(sweep(wanted, trained=trained.length if trained else None), model)
    chosen = recommended(wanted, candidates)
    compared = tuple(
        candidate(wanted, chosen.string.core_diameter, tension, chosen.string.length) for tension in COMPARED
    )
    return StringDesign(wishes=wanted, chosen=chosen, candidates=tuple(candidates), compared=compared)


def design_string(wishes: Wishes) -> StringDesign:
    """Return the design of one string: the gauge, tension and whole length of the wishes, without a sweep.

    `InputError` refuses a missing gauge or tension, and a wire that breaks.

    >>> made = design_string(Wishes(gauge=0.254e-3, tension=40.0))
    >>> round(made.chosen.frequency), made.squeal
    (793, 'squeals')
    """
    gauge, tension = wishes.gauge, wishes.tension
    if gauge is None or tension is None:
        raise InputError("a string without gauge or tension", "both")
    holds = tension / (np.pi * gauge**2 / 4.0) < WIRES[wishes.wire].strength
    one = [candidate(wishes, gauge, tension, wishes.length)] if holds else []
    chosen = recommended(wishes, _marked(one, _model_of(wishes.model)))
    return StringDesign(wishes=wishes, chosen=chosen, candidates=(chosen,), compared=())


@cache
def _model_of(name: str) -> Model | None:
    return None if name == NO_MODEL else load_model(name)


def _marked(candidates: list[StringCandidate], model: Model | None) -> list[StringCandidate]:
    """Return strings with whether a model takes each, built up to `BUILT_LENGTH` longer or shorter, too."""
    if model is None:
        return candidates
    return [
        replace(
            one,
            fits_model=all(
                model.takes(with_length(one.string, share * one.string.length), one.range)
                for share in (1.0 - BUILT_LENGTH, 1.0 + BUILT_LENGTH)
            ),
        )
        for one in candidates
    ]


def _unsafe(one: StringCandidate) -> bool:
    return any(word.startswith(("stress", "clearance", "lines", "open")) for word in one.lacks)


def _at(one: StringCandidate, wishes: Wishes) -> str:
    """Return what a tension gives and what it costs, as a sentence."""
    costs = [f"settles in {1e3 * one.settling:.0f} ms"]
    if one.clearance > wishes.gap:
        costs.append(f"needs a gap of {1e3 * one.clearance:.1f} mm (drivers pull less there)")
    if one.stress_share > MAX_STRESS_SHARE:
        costs.append(f"loads the wire to {one.stress_share:.0%} of its strength")
    costs.append(f"leaves {ambiguity(wishes, one.string).share:.0%} of the pairs of modes ambiguous")
    return (
        f"{one.string.tension:.0f} N: {one.cents_per_newton:.0f} cents per newton, {wishes.usual:g} N to "
        f"{one.force_std:.2g} N. It {', '.join(costs[:-1])} and {costs[-1]}."
    )


def _row(one: StringCandidate, chosen: StringCandidate) -> str:
    string, mark = one.string, "*" if one.string == chosen.string else " "
    cells = (
        f"{mark}{1e3 * string.core_diameter:6.3f}",
        f"{string.tension:8.0f} {1e3 * string.length:7.0f} {one.frequency:6.0f}",
        f"{one.force_std:7.3f} {one.force_std_most:7.3f} {1e3 * one.position_std:10.3f}",
        f"{one.cents_per_newton:6.1f} {1e3 * one.settling:10.0f}",
        f"{100.0 * one.stress_share:7.0f} {1e3 * one.clearance:10.2f} {MARKS[one.fits_model]:>6}",
        f" lacks {', '.join(word.split(' ')[0] for word in one.lacks)}" if one.lacks else "",
    )
    return " ".join(cells).rstrip()


def _along(curves: StringCurves, force: float) -> list[str]:
    """Return lines, slopes and bounds along the range, as a table."""
    usual = int(np.argmin(np.abs(curves.forces - force)))
    rows = ["   x, mm  f1, Hz  f2, Hz  df1/dx, Hz/mm  df2/dx  df1/dF, Hz/N  df2/dF  std x, mm  std F, N"]
    for i in range(0, curves.positions.size, 4):
        (one, one_force), (two, two_force) = curves.slopes[i]
        rows.append(
            f"{1e3 * curves.positions[i]:8.1f} {curves.lines[i, 0]:7.0f} {curves.lines[i, 1]:7.0f} "
            f"{1e-3 * one:14.2f} {1e-3 * two:7.2f} {one_force:13.2f} {two_force:7.2f} "
            f"{1e3 * curves.position_std[usual, i]:10.3f} {curves.force_std[usual, i]:9.3f}"
        )
    return rows


def _tree(one: StringCandidate) -> dict[str, Any]:
    return {**asdict(one), "clearance": one.clearance}


def _arrays(of: StringCurves | Ambiguity) -> dict[str, np.ndarray]:
    return {name: getattr(of, name) for name in type(of).__dataclass_fields__}
