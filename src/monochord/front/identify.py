"""Measures a real build from its untouched sound, like ``monochord identify``."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.notebook import lines
from monochord.core.ranges import Positive, checked
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Floats
from monochord.core.units import KilogramsPerMetre, Metres, Seconds
from monochord.live.listen import Listenable, source_of
from monochord.live.tuning import SECONDS, heard_in, preset_of
from monochord.perception.tuning.measurement import (
    UNITS,
    Partial,
    StringMeasurement,
    StringTake,
    measured_string,
)
from monochord.physics.identification import (
    NAMES,
    StringFit,
    even_std,
    is_plain,
    steel_density_of,
)
from monochord.physics.sensors import Sensor, design_toml, load_sensor, sensor_design
from monochord.physics.theory import decay_rates, outer_diameter

DESIGN = "prototype"
"""Design assumed for a recording that does not name its sensor."""
LENGTH_ERROR: Metres = 5e-4
CALIPER_ERROR: Metres = 1e-6
WEIGHED_ERROR = 3e-3
"""Default errors, each a plus or minus: of a ruler and a micrometer in m, and of a weighed wire, relative."""
MAX_LENGTH_DEVIATION = 0.1
"""Largest relative deviation of a build's length from its design's."""
DISAGREEMENT = 4.0
"""Standard errors by which caliper and scales differ where the wire is not plain steel."""
MEASURE = (
    "Measure the wire's diameter to 1 um (--caliper), or weigh a measured piece of it (--weighed, kg per m)."
)
NO_PLUCK = (
    "Losses, and which partials ring freely: record a pluck with both drivers off, and give that file too."
)
NO_DRIVE = "Which partials the drivers hold: record the untouched string with both drivers on, too."
NEVER = (
    "The tension law and the drivers' gain and limit: they need touches of known force ('monochord "
    "calibrate'). The file keeps the design's."
)


@dataclass(frozen=True, kw_only=True)
class Identification:
    """What recordings of an untouched string say about a build.

    Attributes
    ----------
    design
        Name of the design.
    sensor
        The build: the design with what was measured. A quantity without an answer is the design's.
    estimates
        Quantities by name, each with standard error, or with the reason why there is no answer:
        ``open_frequency`` (f0 = sqrt(T / mu) / (2 L)), ``inharmonicity``, ``length``, ``linear_density``,
        ``tension``, ``pull_1`` and ``pull_2`` (the magnets' negative stiffness), ``support_loss``.
    fit
        The fit behind them, with the correlation matrix of its quantities.
    partials
        The partials of each recording.
    notes
        What contradicts itself.
    unknown
        What these recordings do not tell, and what to measure.
    """

    design: str
    sensor: Sensor
    estimates: dict[str, Estimate]
    fit: StringFit
    partials: tuple[Partial, ...]
    notes: tuple[str, ...]
    unknown: tuple[str, ...]

    @property
    def held(self) -> tuple[int, ...]:
        """Numbers of the partials that the drivers hold, ascending."""
        return tuple(sorted({each.number for each in self.partials if each.held}))

    def __repr__(self) -> str:
        known = {name: _in_words(each) for name, each in self.estimates.items() if each.valid}
        lacking = ", ".join(name for name in self.estimates if name not in known)
        facts = [*known.items(), ("no answer", lacking), ("notes", "; ".join(self.notes))]
        return lines(f"Identification: {self.design}, as built", facts)

    def tree(self) -> dict[str, Any]:
        """Return the result as plain values."""
        return {
            "design": self.design,
            "estimates": {
                name: {
                    "value": each.value if each.valid else None,
                    "std": each.std if each.valid else None,
                    "unit": each.unit,
                    "reason": each.reason,
                }
                for name, each in self.estimates.items()
            },
            "correlation": {"names": list(NAMES), "matrix": self.fit.correlation.tolist()},
            "held": list(self.held),
            "partials": [asdict(each) for each in self.partials],
            "notes": list(self.notes),
            "unknown": list(self.unknown),
        }

    def lines(self) -> list[str]:
        """Return the result in convenient units, as text lines."""
        lines = [f"{self.design}, as built:"]
        for name, each in self.estimates.items():
            lines.append(f"  {name:<16}{_in_words(each)}")
        held = ", ".join(map(str, self.held)) or "none"
        lines += [f"  {'held partials':<16}{held}", "  correlation (%)"]
        lines += [f"    {'':<16}{'  '.join(name[:9].rjust(9) for name in NAMES)}"]
        for name, row in zip(NAMES, self.fit.correlation, strict=True):
            lines.append(f"    {name:<16}{'  '.join(f'{100.0 * value:9.0f}' for value in row)}")
        lines += [f"  note: {note}" for note in self.notes]
        return [*lines, "  not told by these recordings:", *(f"    {each}" for each in self.unknown)]

    def toml(self) -> str:
        """Return the text of a sensor file, which `load_sensor` and ``--sensor`` take."""
        return design_toml(self.sensor)


@checked
def identify(
    *recordings: Listenable,
    length: Positive[Metres],
    caliper: Positive[Metres] | None = None,
    weighed: Positive[KilogramsPerMetre] | None = None,
    sensor: str | Path = "",
    seconds: Positive[Seconds] = SECONDS,
    length_error: Positive[Metres] = LENGTH_ERROR,
    caliper_error: Positive[Metres] = CALIPER_ERROR,
    weighed_error: Positive[float] = WEIGHED_ERROR,
    **options: Any,
) -> Identification:
    """Measure a build from plucked and driven recordings of its untouched string, a ruler and a caliper.

    Every error is stated as standard error. Tension and linear density need the wire's diameter or weight:
    from sound and ruler alone they are 4 to 8 % uncertain, and then there is no answer.

    Parameters
    ----------
    recordings
        Each as for `listen`. Touched windows are left out. At best one is a pluck with both drivers off, and
        one the driven string.
    length
        Length between the string's ends, in m.
    caliper
        Diameter of a plain steel wire, in m.
    weighed
        Linear density of the wire: its weight over its length, in kg/m.
    sensor
        The design: a preset's name or a TOML file; by default a session's own, else the prototype.
    seconds
        Duration taken from each recording, in s.
    length_error
        Largest error of `length`, in m; each error is even within plus or minus its largest.
    caliper_error
        Largest error of `caliper`, in m.
    weighed_error
        Largest relative error of `weighed`.
    options
        Options of the source, for a source by name.

    Returns
    -------
    Identification
        The estimates with their correlation, and the sensor.

    Raises
    ------
    InputError
        If no recording has an untouched string within 10 % of the design's pitch, or a measurement is
        impossible.

    Examples
    --------
    >>> import monochord as mc
    >>> pluck = mc.VirtualSensor("prototype", seed=1)
    >>> pluck.drive(False, False)
    >>> build = mc.identify(pluck, length=0.2, caliper=0.254e-3)
    >>> abs(build.sensor.string.tension - 65.0) < 1.0, build.held
    (True, ())
    >>> again = mc.VirtualSensor("prototype", seed=1)
    >>> again.drive(False, False)
    >>> mc.identify(again, length=0.2).estimates["tension"].valid
    False
    """
    if not recordings:
        raise InputError("no recording", "one or more recordings of the untouched string")
    refuse_other_units(length=length, caliper=caliper, length_error=length_error, caliper_error=caliper_error)
    takes = list[StringTake]()
    design, reasons, remedies = sensor_design(sensor) if sensor else "", list[str](), list[str]()
    for number, recording in enumerate(recordings):
        source = source_of(recording, dict(options), seconds=seconds)
        with source.open() as stream:
            design = design or (preset_of(stream.signal.string) if stream.signal.string else DESIGN)
            _refuse_other_size(load_sensor(design), design, length, bool(sensor))
            takes.append(heard_in(stream, load_sensor(design).string, seconds, number))
        if reason := takes[-1].reason:
            name = recording if isinstance(recording, str | Path) else type(recording).__name__
            reasons.append(f"{name}: {reason}")
            remedies.append(Reason.of(reason).remedy)
    if not any(take.partials for take in takes):
        allowed = f"sound of an untouched string of the sensor {design}"
        raise InputError("; ".join(reasons), allowed, remedies[0])
    built = load_sensor(design)
    densities, notes = _densities(built, caliper, caliper_error, weighed, weighed_error)
    string = measured_string(
        built, takes, length=(length, even_std(length_error)), linear_density=_combined(densities)
    )
    return _identified(design, built, string, (*reasons, *notes), measured=bool(densities))


def _refuse_other_size(sensor: Sensor, design: str, length: Metres, named: bool) -> None:  # noqa: FBT001
    nominal = sensor.string.length
    if abs(length / nominal - 1.0) > MAX_LENGTH_DEVIATION:
        given = f"length {length:g} m with the sensor {design}"
        remedy = "check the length" if named else "name the design: --sensor PRESET"
        raise InputError(given, f"within 10 % of {nominal:g} m", f"{remedy}, or 'monochord design' makes one")


def _densities(
    sensor: Sensor,
    caliper: Metres | None,
    caliper_error: Metres,
    weighed: KilogramsPerMetre | None,
    weighed_error: float,
) -> tuple[list[tuple[float, float]], tuple[str, ...]]:
    """Return each measured linear density with its standard error, and notes on them."""
    densities, notes = list[tuple[float, float]](), list[str]()
    if caliper is not None and is_plain(sensor):
        density = steel_density_of(caliper)
        densities.append((density, 2.0 * density * even_std(caliper_error) / caliper))
    elif caliper is not None:
        notes.append("--caliper is left out: a wound string's density does not follow from its diameter")
    if weighed is not None:
        densities.append((weighed, weighed * even_std(weighed_error)))
    if len(densities) == 2:
        (one, one_std), (other, other_std) = densities
        if abs(one - other) > DISAGREEMENT * math.hypot(one_std, other_std):
            notes.append(
                f"caliper and scales differ by {abs(one / other - 1.0):.1%}: the wire is not plain steel; "
                "its weight counts"
            )
            densities = densities[1:]
    nominal = sensor.string.linear_density
    for density, _ in densities:
        if not 0.5 < density / nominal < 2.0:
            given = f"a wire of {density:.3g} kg/m"
            remedy = "check the unit (m, kg/m), or name another --sensor"
            raise InputError(given, f"half to twice the design's {nominal:.3g} kg/m", remedy)
    return densities, tuple(notes)


def _combined(densities: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the mean of measured values by their weights, with its standard error."""
    if not densities:
        return None
    weight = sum(std**-2 for _, std in densities)
    return sum(value * std**-2 for value, std in densities) / weight, weight**-0.5


def _identified(
    design: str,
    built: Sensor,
    string: StringMeasurement,
    notes: tuple[str, ...],
    *,
    measured: bool,
) -> Identification:
    fit, partials = string.fit, string.partials
    estimates = {name: string.estimate(name) for name in NAMES}
    unknown = [NEVER]
    if not measured:
        for name in ("linear_density", "tension"):
            reason = Reason.SOUND_ALONE.with_detail(fit.relative_std(name))
            estimates[name] = Estimate.abstain(UNITS[name], reason)
        unknown.insert(0, f"Tension and linear density: {MEASURE}")
    sensor = _as_built(built, fit, measured=measured)
    loss = _support_loss(sensor, partials)
    estimates["support_loss"] = loss
    if loss.valid:
        sensor = replace(sensor, losses=replace(sensor.losses, support=min(max(loss.value, 0.0), 0.1)))
    else:
        unknown.append(NO_PLUCK)
    unknown += [] if any(each.held for each in partials) else [NO_DRIVE]
    return Identification(
        design=design,
        sensor=sensor,
        estimates=estimates,
        fit=fit,
        partials=partials,
        notes=notes,
        unknown=tuple(unknown),
    )


def _as_built(design: Sensor, fit: StringFit, *, measured: bool) -> Sensor:
    """Return the design with the fitted string, magnets and ends; far coils keep their place from their end.

    Without a measured density the design's holds, with the tension that gives the pitch.
    """
    values = dict(zip(NAMES, fit.values.tolist(), strict=True))
    string, length = design.string, values["length"]
    density = values["linear_density"] if measured else string.linear_density
    tension = density * (2.0 * length * values["open_frequency"]) ** 2
    thread = replace(string, length=length, linear_density=density, tension=tension)
    if measured and is_plain(design):
        thread = replace(thread, core_diameter=outer_diameter(thread))

    def place(x: Metres) -> Metres:
        return x if x < 0.5 * string.length else x + length - string.length

    near, far = (
        replace(each, sense=place(each.sense), drive=place(each.drive), pull=max(values[pull], 0.0))
        for each, pull in zip(design.drivers, ("pull_1", "pull_2"), strict=True)
    )
    give = max(0.5 * fit.ends * length / tension, 0.0)
    first, second = (replace(end, compliance=give) for end in design.ends)
    measured_by = "length, linear density and tension" if measured else "length and pitch"
    assumed = "" if measured else "Its linear density is that of the design, not measured. "
    return replace(
        design,
        string=thread,
        drivers=(near, far),
        ends=(first, second),
        title=f"{design.title}, as built",
        source=f"monochord identify: {measured_by} measured; all else is that of the design",
        notes=assumed + design.notes,
    )


def _support_loss(sensor: Sensor, partials: Sequence[Partial]) -> Estimate:
    """Return the support's loss factor from freely ringing partials, with its standard error."""
    free = [each for each in partials if each.plucked and each.used and each.decay_std < 0.3 * each.decay]
    if not free:
        return Estimate.abstain("1", Reason.NO_FREE_PARTIAL)
    frequency: Floats = np.array([each.frequency for each in free])
    decay = np.array([each.decay for each in free])
    std = np.hypot([each.decay_std for each in free], 0.1 * decay)
    other = decay_rates(sensor.string, replace(sensor.losses, support=0.0), frequency)
    slope = math.pi * frequency
    information = float(np.sum((slope / std) ** 2))
    value = float(np.sum((decay - other) * slope / std**2)) / information
    excess = float(np.sum(((decay - other - value * slope) / std) ** 2)) / max(len(free) - 1, 1)
    return Estimate(value=value, std=math.sqrt(max(excess, 1.0) / information), unit="1")


def _in_words(estimate: Estimate) -> str:
    """Return an estimate in convenient units, to two digits of its error, or the reason for none."""
    scale, unit = {"kg/m": (1e3, "g/m"), "m": (1e3, "mm")}.get(estimate.unit, (1.0, estimate.unit))
    shown = f"{_shown(scale * estimate.value, scale * estimate.std)} {unit.removeprefix('1')}"
    return shown.rstrip() if estimate.valid else str(estimate)


def _shown(value: float, std: float) -> str:
    """Return a value with its standard error, to two digits of the error.

    >>> _shown(0.0001551, 4.7e-6), _shown(64.97, 0.35)
    ('1.551e-04 +- 4.7e-06', '64.97 +- 0.35')
    """
    if not 0.0 < std < math.inf:
        return f"{value:.5g}"
    if abs(value) < 1e-2:
        digits = max(math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 1, 0) if value else 1
        return f"{value:.{digits}e} +- {std:.1e}"
    digits = max(1 - math.floor(math.log10(std)), 0)
    return f"{value:.{digits}f} +- {std:.{digits}f}"
