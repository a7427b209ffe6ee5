"""Strings in a MuJoCo scene: their contacts lead virtual sensors, whose sound a model hears.

`add_string` adds a string to a scene. `Strings` reads its contacts after every step, and `mc.listen` takes
each string as a source, with MuJoCo's truth beside each update. All sound is simulated.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.ranges import Seed, checked
from monochord.core.types import Floats
from monochord.core.units import Metres, Seconds
from monochord.physics.sensors import as_sensor
from monochord.physics.setup import MAX_TOUCHES, Sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.world import World
from monochord.sim._contacts import Counts, Row, SimulatedContact
from monochord.sim._mujoco import mujoco
from monochord.sim._simulated_string import PERIOD, SimulatedString, StringTwin

__all__ = ["Counts", "SimulatedContact", "SimulatedString", "Strings", "add_string"]

RADIUS: Metres = 2e-3
"""Of a string in the scene: through one of its true 0.13 mm a fast finger passes."""
BACKING: Metres = 4e-3
"""Half the thickness of what lies behind a string, from its middle on."""
YIELD: Seconds = 0.01
"""Time constant of a string's contacts: below it, what slides at steps of 1 ms chatters."""
BACKING_YIELD: Seconds = 0.004
"""Time constant of the contacts of what lies behind it: no fast finger passes."""
NEAR: Metres = 5e-3
"""Distance up to which an object that does not touch yet is known."""
SHORTEST: Metres = 0.05
LENGTH_TOLERANCE: Metres = 1e-3
"""Largest difference of a string's length from its sensor's."""
ROWS = 8
"""Contacts that a contact sensor has room for."""
SUFFIX = "_contacts"
"""A string's contact sensor has its name with this at the end."""
CONTACT_DATA = ("FOUND", "FORCE", "DIST", "POS", "NORMAL", "TANGENT", "LINVEL")
FOUND, NORMAL_FORCE, DISTANCE = 0, 1, 4
WHERE, NORMAL, TANGENT, VELOCITY = slice(5, 8), slice(8, 11), slice(11, 14), slice(14, 17)
"""Columns of a contact sensor's row with these data."""
COLUMNS = 17
STEEL, BLACK = (0.85, 0.85, 0.9, 1.0), (0.2, 0.2, 0.25, 1.0)
MAX_FORCE_FIRST = 2
"""A contact sensor's reduction ``maxforce``."""

Spec: TypeAlias = Any
MjModel: TypeAlias = Any
MjData: TypeAlias = Any
"""MuJoCo's own classes, which ship no types."""
Numbers: TypeAlias = NDArray[np.intp]
Vector: TypeAlias = Sequence[float] | Floats


def add_string(spec: Spec, *, body: str, start: Vector, end: Vector, press: Vector, name: str) -> None:
    """Add a string to a body of a MuJoCo scene, with what it lies on and its contact sensor.

    The string is a capsule of 2 mm radius, and a stiff box lies behind it, so that no object
    passes it. What touches the box is not felt. Friction is that of the touching geom. A site has the
    string's name: its origin is `start`, its x axis points to `end` and its z axis against `press`.

    Parameters
    ----------
    spec
        A ``mujoco.MjSpec``, changed in place.
    body
        Name of the body that holds the string, ``"world"`` for the scene itself.
    start, end
        Ends of the string in the body's frame, in m; positions count from `start`, pickup 1.
    press
        Direction in which objects press, in the body's frame; only its part across the string counts.
    name
        Of the string, its geom and its site.

    Raises
    ------
    InputError
        For an unknown body, a name that is taken, a string below 50 mm, or a press along the string.

    Examples
    --------
    >>> import mujoco
    >>> spec = mujoco.MjSpec()
    >>> add_string(spec, body="world", start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), name="left")
    >>> model = spec.compile()
    >>> model.site("left").pos.tolist(), int(model.sensor("left_contacts").dim[0])
    ([0.0, 0.0, 0.0], 136)
    """
    first, last, direction = (
        _vector(each, what) for each, what in ((start, "start"), (end, "end"), (press, "press"))
    )
    length = float(np.linalg.norm(last - first))
    if length < SHORTEST:
        raise InputError(
            f"a string of {1e3 * length:.3g} mm", f"{1e3 * SHORTEST:g} mm or more", "start and end are in m"
        )
    along = (last - first) / length
    down = direction - direction @ along * along
    if np.linalg.norm(down) < 1e-3 * max(float(np.linalg.norm(direction)), 1e-12):
        raise InputError(f"press {_text(direction)} along the string", "a direction across it")
    up = -down / np.linalg.norm(down)
    holder = _body(spec, body)
    for kind in (spec.geoms, spec.sites):
        if name in {each.name for each in kind}:
            raise InputError(f"string '{name}'", "a name that no geom or site has yet")
    frame = np.column_stack((along, np.cross(up, along), up))
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, frame.ravel())
    shared: dict[str, Any] = {"solmix": 1e6, "friction": [0.0] * 3, "mass": 1e-3}
    holder.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*first, *last],
        size=[RADIUS, 0.0, 0.0],
        gap=NEAR,
        solref=[YIELD, 1.0],
        rgba=STEEL,
        **shared,
    )
    holder.add_geom(
        name=f"{name}_backing",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=0.5 * (first + last) - BACKING * up,
        quat=quaternion,
        size=[0.5 * length, RADIUS, BACKING],
        solref=[BACKING_YIELD, 1.0],
        rgba=BLACK,
        **shared,
    )
    holder.add_site(name=name, pos=first, quat=quaternion, size=[1e-4, 0.0, 0.0])
    data = sum(1 << int(getattr(mujoco.mjtConDataField, f"mjCONDATA_{each}")) for each in CONTACT_DATA)
    sensor = spec.add_sensor(
        name=name + SUFFIX,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=name,
    )
    sensor.intprm = [data, MAX_FORCE_FIRST, ROWS]


class _UnknownStringError(InputError, KeyError):
    """An unknown string: an unusable input, and what a mapping raises."""

    __str__ = Exception.__str__  # a KeyError prints its argument as Python writes it


class Strings(Mapping[str, SimulatedString]):
    """The strings of a MuJoCo scene by name, each with a virtual sensor that its contacts lead.

    `read` is called once after each ``mujoco.mj_step``, or `step` does both. A listener, ``mc.listen(strings
    ["left"], model="demo")``, takes the sound that there is, and calls `step` where it needs more: a program
    sets ``data.ctrl`` after each update, and MuJoCo runs on by a hop. A stream begins with the 0.1 s of sound
    before it was opened, so that the first update needs no step. After ``mujoco.mj_resetData`` each string is
    warm and untouched again, and its stream has a gap: windows with sound from before are withheld.

    Sound is in blocks of 10 ms on the sample clock, and one step of MuJoCo later than its contacts (0.8 ms
    at least). More than 10 N and more than 0.5 m/s across a string are clipped, and counted in
    ``strings["left"].counts``, as are contacts that find no slot. MuJoCo's friction creeps: with elliptic
    cones and ``impratio = 10`` below the 0.5 mm/s from which motion is slip.

    Parameters
    ----------
    model, data
        A compiled scene with strings from `add_string`, and its state. The time step divides 10 ms.
    sensor, sensors
        Of all strings, and of single ones by name: presets or files. Each is as long as its string.
    seed, build
        Of the first string by name order in the model; each next one has the next number.
    world, day, sample_rate
        As of `monochord.VirtualSensor`; the rate is a multiple of 100 Hz.
    objects
        Materials of bodies, with all that hangs on them, or of geoms, by name. What is named nowhere is of
        the material `other`.
    contacts
        Contacts that a string feels at once for each material.

    Raises
    ------
    InputError
        For a scene without strings, an unknown name or material, a sensor of another length, or a time step
        that does not divide 10 ms.

    Examples
    --------
    >>> import mujoco, monochord as mc
    >>> spec = mujoco.MjSpec()
    >>> spec.option.timestep = 1e-3
    >>> add_string(spec, body="world", start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), name="left")
    >>> cup = spec.worldbody.add_body(name="cup", pos=(0.08, 0, 0.013))
    >>> _ = cup.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 0, 1), damping=1.0)
    >>> _ = cup.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.01, 0, 0), mass=0.1)
    >>> model = spec.compile()
    >>> strings = Strings(model, mujoco.MjData(model), objects={"cup": "wood"})
    >>> *_, update = mc.listen(strings["left"], seconds=0.8)
    >>> print(f"{update.position.value:.2f} m, truly {update.truth['position']:.2f} m")
    0.08 m, truly 0.08 m
    """

    @checked
    def __init__(
        self,
        model: MjModel,
        data: MjData,
        *,
        sensor: str | Path | Sensor = "prototype",
        sensors: Mapping[str, str | Path] | None = None,
        seed: Seed = 0,
        build: Seed | None = None,
        day: Seed | None = None,
        world: World = "ideal",
        sample_rate: Annotated[int, "Hz", Meta(ge=16_000, le=192_000)] = 44100,
        objects: Mapping[str, str | Path] | None = None,
        other: str | Path = "plastic",
        contacts: Annotated[int, Meta(ge=1, le=MAX_TOUCHES)] = 2,
    ) -> None:
        self._model, self._data = model, data
        self.timestep: Seconds = float(model.opt.timestep)
        if abs(PERIOD / self.timestep - round(PERIOD / self.timestep)) > 1e-6 or self.timestep > PERIOD:
            raise InputError(
                f"MuJoCo's time step {1e3 * self.timestep:.4g} ms",
                "one that divides 10 ms",
                "spec.option.timestep = 1e-3",
            )
        if sample_rate % 100:
            raise InputError(
                f"sample rate {sample_rate} Hz", "a multiple of 100 Hz: sound is in blocks of 10 ms"
            )
        materials, self._material_of = _materials(model, dict(objects or {}), other)
        if len(materials) * contacts > MAX_TOUCHES:
            given = f"{contacts} contacts for each of {len(materials)} materials"
            raise InputError(given, f"{MAX_TOUCHES} in all", "fewer materials, or contacts=1")
        names = _string_names(model)
        special = dict(sensors or {})
        for name in special.keys() - names.keys():
            raise InputError(f"a sensor for the string '{name}'", f"one of {', '.join(names)}")
        self._strings: dict[str, SimulatedString] = {}
        self._readings: list[_Reading] = []
        for number, (name, address) in enumerate(names.items()):
            design = as_sensor(special.get(name, sensor))
            refuse_length(model, name, design)
            twin = VirtualSensor(
                design,
                seed=seed + number,
                build=None if build is None else build + number,
                day=day,
                world=world,
                sample_rate=sample_rate,
                objects=[material for material in materials for _ in range(contacts)],
            )
            led = StringTwin(twin, self.timestep, len(materials), contacts)
            self._strings[name] = SimulatedString(name=name, twin=led, step=self.step)
            self._readings.append(_Reading(model, data, name, address, led))
        self._several = len(materials) > 1
        self._time: Seconds = float(data.time)

    def __getitem__(self, name: str) -> SimulatedString:
        """Return a string by name; `InputError` says which there are."""
        try:
            return self._strings[name]
        except KeyError:
            raise _UnknownStringError(f"string '{name}'", f"one of {', '.join(self._strings)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._strings)

    def __len__(self) -> int:
        return len(self._strings)

    def step(self) -> None:
        """Advance MuJoCo by a step, and read its contacts."""
        mujoco.mj_step(self._model, self._data)
        self.read()

    def read(self) -> None:
        """Read the contacts of the step that MuJoCo has just made.

        A time before that of the last reading is a reset. Raises `InputError` where MuJoCo made several steps
        since then.
        """
        time = float(self._data.time)
        if time < self._time - 1e-3 * self.timestep:
            self.restart()
            self._time = time - self.timestep
        steps = (time - self._time) / self.timestep
        if steps > 1.5:
            raise InputError(
                f"{steps:.0f} steps of MuJoCo since the last reading",
                "one",
                "call read() after each mj_step, or restart() after a jump",
            )
        if steps < 0.5:
            return
        self._time = time
        geoms = self._geoms() if self._several else None
        for reading in self._readings:
            reading.twin.follow(reading.contacts(geoms))

    def restart(self) -> None:
        """Have every string warm and untouched again, as after a reset; MuJoCo's time goes on from here."""
        for reading in self._readings:
            reading.twin.restart()
        self._time = float(self._data.time)

    def _geoms(self) -> tuple[Floats, Numbers]:
        """Return positions and materials of all contacts of the scene."""
        contact = self._data.contact
        return contact.pos, self._material_of[contact.geom]


class _Reading:
    """The contact sensor of a string, read after a step."""

    def __init__(self, model: MjModel, data: MjData, name: str, address: int, twin: StringTwin) -> None:
        site = model.site(name).id
        self._rows = data.sensordata[address : address + ROWS * COLUMNS].reshape(ROWS, COLUMNS)
        self._origin, self._frame = data.site_xpos[site], data.site_xmat[site]
        self.twin = twin

    def contacts(self, scene: tuple[Floats, Numbers] | None) -> list[SimulatedContact]:
        """Return contacts and objects nearby; `scene` has all contacts' positions and geoms' materials."""
        found = int(self._rows[0, FOUND])
        if not found:
            return []
        rows = self._rows[: min(found, ROWS)]
        materials = [0] * len(rows)
        if scene is not None:
            places, material_of = scene
            nearest = ((places - rows[:, np.newaxis, WHERE]) ** 2).sum(axis=2).argmin(axis=1)
            materials = material_of[nearest].max(axis=1).clip(min=0).tolist()
        origin, along = self._origin.tolist(), self._frame[0::3].tolist()
        return [
            _contact(row, origin, along, material)
            for row, material in zip(rows.tolist(), materials, strict=True)
        ]


def _contact(row: Row, origin: Row, along: Row, material: int) -> SimulatedContact:
    """Return the contact in a row of a contact sensor, in terms of the string.

    The object's velocity is given along the normal n, which leaves the string, a tangent t, and n x t.
    """
    (nx, ny, nz), (tx, ty, tz) = row[NORMAL], row[TANGENT]
    away, first, second = row[VELOCITY]
    ax, ay, az = along
    on_first = ax * tx + ay * ty + az * tz
    on_second = ax * (ny * tz - nz * ty) + ay * (nz * tx - nx * tz) + az * (nx * ty - ny * tx)
    return SimulatedContact(
        position=sum(a * (x - o) for a, x, o in zip(along, row[WHERE], origin, strict=True)),
        force=row[NORMAL_FORCE],
        gap=row[DISTANCE],
        approach=-away,
        along=first * on_first + second * on_second,
        across=second * on_first - first * on_second,
        material=material,
    )


def _string_names(model: MjModel) -> dict[str, int]:
    """Return the names of a scene's strings, and where their contact sensors' data begin."""
    names = {
        each.name.removesuffix(SUFFIX): int(each.adr[0])
        for each in map(model.sensor, range(model.nsensor))
        if each.name.endswith(SUFFIX) and each.type[0] == mujoco.mjtSensor.mjSENS_CONTACT
    }
    if not names:
        raise InputError(
            "a scene without strings", "one or more", "add_string(spec, ...) before spec.compile()"
        )
    return names


def _materials(
    model: MjModel, objects: dict[str, str | Path], other: str | Path
) -> tuple[list[str | Path], Numbers]:
    """Return the materials of a scene, and by geom which of them it is of, -1 for a string."""
    geoms = {model.geom(number).name: [number] for number in range(model.ngeom)}
    strings = _string_names(model)
    bodies: dict[str, list[int]] = {}
    for number in range(model.ngeom):
        body = int(model.geom_bodyid[number])
        while True:
            bodies.setdefault(model.body(body).name, []).append(number)
            if body == 0:
                break
            body = int(model.body_parentid[body])
    materials: list[str | Path] = [other]
    material_of = np.zeros(model.ngeom, dtype=np.intp)
    for name, material in objects.items():
        numbers = bodies.get(name) or geoms.get(name)
        if numbers is None or not name:
            there = sorted(
                {*bodies, *geoms} - {"", "world", *strings, *(f"{each}_backing" for each in strings)}
            )
            raise InputError(f"object '{name}'", f"a body or geom: {', '.join(there) or 'none has a name'}")
        if material not in materials:
            materials.append(material)
        material_of[numbers] = materials.index(material)
    for name in strings:
        material_of[geoms[name]] = -1
    return materials, material_of


def refuse_length(model: MjModel, name: str, sensor: Sensor) -> None:
    """Raise `InputError` for a sensor whose string is not as long as that of the scene."""
    there, needed = 2.0 * float(model.geom(name).size[1]), sensor.string.length
    if abs(there - needed) > LENGTH_TOLERANCE:
        given = f"string '{name}' of {1e3 * there:.4g} mm with the sensor {sensor.name}"
        raise InputError(given, f"{1e3 * needed:.4g} mm", "move start or end, or use another sensor")


def _body(spec: Spec, name: str) -> Any:
    """Return a body of a scene by name."""
    for body in spec.bodies:
        if body.name == name:
            return body
    raise InputError(f"body '{name}'", f"one of {', '.join(each.name for each in spec.bodies if each.name)}")


def _vector(value: Vector, name: str) -> Floats:
    """Return three finite numbers, or refuse them."""
    vector = np.asarray(value, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise InputError(f"{name} {_text(np.atleast_1d(vector))}", "three finite numbers in m")
    return vector


def _text(vector: Floats) -> str:
    return f"({', '.join(f'{each:g}' for each in vector.ravel()[:6])})"
