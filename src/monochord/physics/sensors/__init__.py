"""Sensors: one TOML file per design, with its source, or a tuned sensor's file.

A design names its string preset, ``string = "prototype"``; ``[override]`` changes values of it. The other
keys are the fields of `monochord.physics.setup.Sensor`. A file from ``monochord tune`` names the design,
``design = "prototype"``, with a table ``[tuning]``; the sensor is that design with the tuned string, of the
measured length where it was measured.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from monochord.core.config import dump_toml, from_tree, load_toml, to_tree
from monochord.core.errors import InputError
from monochord.core.identity import SensorIdentity
from monochord.core.presets import Presets
from monochord.core.types import Signal, StringParams
from monochord.core.units import Hertz, Metres, Newtons, Seconds
from monochord.physics.setup import Sensor, lengthened
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency

__all__ = ["Sensor", "as_sensor", "design_toml", "load_sensor", "sensor_names", "with_length"]

MAX_RETUNING = 0.25
"""Largest relative deviation of a sensor's tuning from its design."""
LENGTH_TOLERANCE = 0.03
"""Largest relative deviation of a string's length from its design; beyond it, it is another string."""
HOW_LONG = "from crest to crest of the saddle pins"
"""How the length of a string is measured, in every help text and on every page."""
RULER_STD: Metres = 3e-4
"""Standard error of a length measured with a ruler, which is good to 0.5 mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorTuning:
    """Measurement of a sensor's untouched string.

    Parameters
    ----------
    open_frequency, open_frequency_std
        Fundamental without stiffness, f0 = sqrt(T / mu) / (2 L), and its standard error, in Hz.
    tension, tension_std
        Tension from f0, T = mu (2 L f0)^2, in N. For information only: it is recomputed for the sensor.
    inharmonicity, inharmonicity_std
        B of f_n = n f0 sqrt(1 + B n^2), and its standard error.
    decay, decay_std
        Decay rate of its lowest free partial in 1/s, where measured.
    partials
        Numbers of the partials that were detected, the loudest first.
    microphones
        Numbers of the microphones that picked them up, from 1 on.
    length
        The string's length in m, if it was measured, as with a ruler.
    seconds
        Duration of the untouched sound, in s.
    time
        Time of the measurement, in ISO 8601.
    source
        Source of the sound: a file, a session, ports.
    """

    open_frequency: Hertz
    open_frequency_std: Hertz = 0.0
    tension: Newtons | None = None
    tension_std: Newtons | None = None
    inharmonicity: float | None = None
    inharmonicity_std: float | None = None
    decay: float | None = None
    decay_std: float | None = None
    partials: tuple[int, ...] = ()
    microphones: tuple[int, ...] = ()
    length: Metres | None = None
    seconds: Seconds = 0.0
    time: str = ""
    source: str = ""


def sensor_toml(design: str, tuning: SensorTuning) -> str:
    """Return the text of a file that `load_sensor` reads as this design with this tuning.

    >>> print(sensor_toml("prototype", SensorTuning(open_frequency=990.0)).partition("[tuning]")[0])
    design = "prototype"
    <BLANKLINE>
    <BLANKLINE>
    """
    return dump_toml({"design": design, "tuning": to_tree(tuning)})


def design_toml(sensor: Sensor) -> str:
    """Return the text of a file that `load_sensor` reads as this sensor, with every value written out.

    Examples
    --------
    >>> print(design_toml(load_sensor("long")).splitlines()[0])
    title = "A long sensor: 45 cm range on a guitar's scale"
    """
    tree = to_tree(sensor)
    string = tree.pop("string")
    kept = {key: tree[key] for key in tree if key != "name" and tree[key] is not None}
    texts = {key: kept.pop(key) for key in ("title", "source", "notes")}
    return dump_toml({**texts, "string": "prototype", **kept, "override": string})


def sensor_tuning(name: str | Path) -> SensorTuning | None:
    """Return the tuning in a sensor's file, None for a design."""
    name = str(name)
    if not name.endswith(".toml"):
        return None
    tree = load_toml(Path(name))
    return _tuning(tree, f"sensor {Path(name).stem}") if "tuning" in tree else None


def sensor_design(name: str | Path) -> str:
    """Return the name of a sensor's design; the sensor may be a tuned sensor's file.

    >>> sensor_design("prototype-one-driver")
    'prototype_one_driver'
    """
    name = str(name)
    if not name.endswith(".toml"):
        return name.replace("-", "_")
    return str(load_toml(Path(name)).get("design", Path(name).absolute()))


def retuned(string: StringParams, frequency: Hertz) -> StringParams:
    """Return a string with the tension for an open frequency, otherwise unchanged.

    >>> string = retuned(load_string("prototype").string, 990.0)
    >>> round(string.tension, 2), round(open_frequency(string), 6)
    (62.38, 990.0)
    """
    return replace(string, tension=string.tension * (frequency / open_frequency(string)) ** 2)


def with_length(string: StringParams, length: Metres) -> StringParams:
    """Return a string of another length at the same pitch, otherwise unchanged.

    Examples
    --------
    >>> string = load_string("prototype").string
    >>> longer = with_length(string, 1.01 * string.length)
    >>> round(longer.tension / string.tension, 6), round(open_frequency(longer) / open_frequency(string), 9)
    (1.0201, 1.0)
    """
    return replace(string, length=length, tension=string.tension * (length / string.length) ** 2)


def refuse_other_length(length: Metres, design: Metres, what: str, remedy: str) -> None:
    """Raise `InputError` for a length that deviates from a design's by more than `LENGTH_TOLERANCE`."""
    if not abs(length / design - 1.0) <= LENGTH_TOLERANCE:
        raise InputError(
            f"{what} of {length:g} m", f"{design:g} m within {100.0 * LENGTH_TOLERANCE:g} %", remedy
        )


def _read(tree: dict[str, Any], where: str) -> Sensor:
    if "design" in tree:
        return _tuned(tree, where)
    string, override = tree.get("string"), tree.pop("override", {})
    if not isinstance(string, str) or not isinstance(override, dict):
        given = f"{where}: string = {string!r} with override = {override!r}"
        raise InputError(given, 'the name of a string preset, and a table: string = "prototype"')
    tree["string"] = {**to_tree(load_string(string).string), **override}
    for needed in ("title", "source"):
        if not tree.get(needed):
            raise InputError(f"option '{where}.{needed}' (missing)", "a text")
    return from_tree(Sensor, tree, where)


def _tuned(tree: dict[str, Any], where: str) -> Sensor:
    """Return the design named in a file, with the tuned string; other keys are the design's."""
    design = tree.pop("design")
    if not isinstance(design, str) or (design.endswith(".toml") and "design" in load_toml(Path(design))):
        allowed = f"{', '.join(sensor_names())}, or the file of a design"
        raise InputError(f"{where}: design = {design!r}", allowed)
    tuning = _tuning(tree, where)
    for key in tree.keys() - {"name", "tuning"}:
        raise InputError(f"{where}: {key} with a design", "design and [tuning] only", "leave it out")
    sensor = load_sensor(design)
    off = tuning.open_frequency / open_frequency(sensor.string) - 1.0
    if not abs(off) <= MAX_RETUNING:
        given = f"{where}: an open frequency of {tuning.open_frequency:g} Hz"
        nominal = open_frequency(sensor.string)
        allowed = f"within {100.0 * MAX_RETUNING:.0f} % of {nominal:.1f} Hz, the design's"
        raise InputError(given, allowed, "tune it again, or use another design")
    if tuning.length is not None:
        design_length = sensor.string.length
        refuse_other_length(tuning.length, design_length, f"{where}: a length", "or use another design")
        sensor = replace(lengthened(sensor, tuning.length / design_length), measured_length=tuning.length)
    return replace(sensor, string=retuned(sensor.string, tuning.open_frequency))


def _tuning(tree: dict[str, Any], where: str) -> SensorTuning:
    table = tree.get("tuning")
    if not isinstance(table, dict):
        raise InputError(f"{where}: tuning = {table!r}", "a table [tuning] with open_frequency")
    return from_tree(SensorTuning, table, f"{where}.tuning")


SENSORS = Presets(package=__name__, kind="sensor", read=_read)
sensor_names, load_sensor = SENSORS.names, SENSORS.load


def as_sensor(sensor: str | Path | Sensor) -> Sensor:
    """Return a sensor by name or file, or the sensor itself.

    Examples
    --------
    >>> as_sensor(as_sensor("prototype")).name
    'prototype'
    """
    return sensor if isinstance(sensor, Sensor) else load_sensor(sensor)


def with_sensor(signal: Signal, sensor: Sensor) -> Signal:
    """Return a signal with the known properties of its sensor.

    >>> with_sensor(Signal(sample_rate=44100, channels=2), load_sensor("prototype")).sensing_range
    (0.05, 0.15)
    """
    return replace(
        signal,
        string=sensor.string,
        length_std=None if sensor.measured_length is None else RULER_STD,
        sensing_range=sensor.range,
        drivers=tuple((each.sense, each.drive) for each in sensor.drivers if each.gain * each.limit),
        sensor=replace(signal.sensor or SensorIdentity(), name=sensor.name, length=sensor.measured_length),
    )


def designs_with(string: StringParams | None) -> list[str]:
    """Return the names of the sensor presets with a string, at any tension; none for an unknown string.

    A string that is a little longer or shorter counts too.

    >>> designs_with(load_string("prototype").string)
    ['prototype', 'prototype_ebow', 'prototype_one_driver']
    """
    if string is None:
        return []
    return [name for name in sensor_names() if same_wire(load_sensor(name).string, string)]


def same_wire(string: StringParams, other: StringParams) -> bool:
    """Return whether two strings are of one design: the same wire at any tension, about as long.

    >>> string = load_string("prototype").string
    >>> [same_wire(string, replace(string, length=length)) for length in (0.198, 0.3)]
    [True, False]
    """
    alike = replace(string, tension=other.tension, length=other.length) == other
    return alike and abs(string.length / other.length - 1.0) <= LENGTH_TOLERANCE
