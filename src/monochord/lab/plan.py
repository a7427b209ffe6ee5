"""What is to be collected: groups of sessions over a grid of places, forces and radii, as strict data."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, TypeAlias
from zlib import crc32

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Sensor
from monochord.physics.twin.variation import build, day

Range: TypeAlias = tuple[float, float]
Count = Annotated[int, Meta(ge=1, le=100000)]
MOST = 1_000_000
"""Touches of a group and radius, which take a month."""
DAY: Seconds = 86400.0
LATEST: Seconds = 1.0
"""How late a stream may come: taps are looked for so far apart."""
APART: Seconds = 120.0
"""From the begin of one session of a day to that of the next; a session lasts half of it or so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Sessions of one protocol over one grid.

    Parameters
    ----------
    name
        Of the group; its sessions are called NAME_000 and so on.
    protocol
        "hold": press, hold, let go. "slide": press, then slide along or across the string, stroke by stroke.
        "brush": brief touches, mostly transitions.
    sessions
        How many for each radius; the grid is shuffled and dealt out among them.
    grid
        How many places and how many forces; each cell is one touch, somewhere within the cell.
    places
        Range along the string in m; the sensor's own if left out.
    forces
        Range in N, as the design's string at rest would answer: the grid of depths.
    material
        Of the object, a preset's name or file.
    radii
        Of the object where it touches, in m; its material's usual one if left out.
    days
        Seeds of the days on which the sessions take place, in turn; day 0 is the one it was tuned on.
    hold
        How long each touch is held, or each stroke lasts, in s.
    strokes
        How many strokes a touch of "slide" has, each with a speed and, after the first, a force of its own.
    speeds
        Range of the strokes' speeds in m/s.
    lifted
        Clearance offset in m with which the motion is repeated without contact; 0 for contact.
    like
        Name of a group whose motions are repeated, `sessions` of them in all, evenly chosen; its grid and
        protocol then count.
    music
        What sounds in the room while the drivers are on: "synthetic" for the loop of `monochord.lab.music`,
        or a sound file. It pauses for the taps.
    snr
        How far below the untouched string's sound it stays, in dB.
    """

    name: str
    protocol: Literal["hold", "slide", "brush"] = "hold"
    sessions: Count = 1
    grid: tuple[Count, Count] = (8, 4)
    places: tuple[Metres, Metres] | None = None
    forces: tuple[Newtons, Newtons] = (0.1, 2.0)
    material: str = "plastic"
    radii: tuple[Metres, ...] = ()
    days: tuple[Annotated[int, Meta(ge=0)], ...] = (0,)
    hold: Annotated[Seconds, Meta(ge=0.1, le=60.0)] = 1.0
    strokes: Count = 4
    speeds: tuple[MetresPerSecond, MetresPerSecond] = (0.001, 0.03)
    lifted: Annotated[Metres, Meta(ge=0.0, le=0.05)] = 0.0
    like: str = ""
    music: str = ""
    snr: float = 10.0

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.name):
            raise InputError(f"group '{self.name}'", "a name of small letters, digits and _")
        for name in ("places", "forces", "speeds"):
            span: Range | None = getattr(self, name)
            if span is not None and not 0.0 < span[0] <= span[1]:
                raise InputError(f"group {self.name}: {name} {span}", "0 < least <= most")
        if self.forces[1] > 5.0 or self.speeds[1] > 0.2:
            raise InputError(f"group {self.name}: {self.forces} N, {self.speeds} m/s", "5 N, 0.2 m/s at most")
        if self.grid[0] * self.grid[1] > MOST:
            raise InputError(f"group {self.name}: grid {self.grid}", f"{MOST} touches at most")
        if not self.days:
            raise InputError(f"group {self.name} without days", "one day or more")

    @property
    def total(self) -> int:
        """How many sessions it has."""
        return self.sessions if self.like else self.sessions * max(1, len(self.radii))


@dataclass(frozen=True, slots=True, kw_only=True)
class Delays:
    """Least and greatest delay of each stream in s: a session draws its own, so that there is one to find."""

    audio: Range = (0.0, 0.0)
    wrench: Range = (0.0, 0.0)
    pose: Range = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("audio", "wrench", "pose"):
            least, most = getattr(self, name)
            if not 0.0 <= least <= most <= LATEST:
                raise InputError(f"delays of {name} {(least, most)}", f"0 <= least <= most <= {LATEST:g} s")


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSensor:
    """What a force/torque sensor adds, after an ATI Gamma; all assumed.

    `noise` is that of forces in N rms a reading, `torque_noise` of torques in N m; `bandwidth` in Hz is where
    the sensor with the object on it begins to give way, so that it feels less of the string's vibration;
    `drift` how fast its zero may move, in N/s; `crosstalk` what of a normal force shows across;
    `lever` how far it sits above the touching point. On its way a reading is lost with probability `lost`,
    and comes late by `jitter` in s on average, beside the session's delay.
    """

    noise: Annotated[Newtons, Meta(ge=0.0)] = 0.010
    torque_noise: Annotated[float, Meta(ge=0.0)] = 5e-4
    bandwidth: Annotated[Hertz, Meta(ge=50.0, le=5000.0)] = 1000.0
    drift: Annotated[float, Meta(ge=0.0)] = 1e-4
    crosstalk: tuple[float, float] = (0.008, -0.005)
    lever: Metres = 0.06
    lost: Annotated[float, Meta(ge=0.0, lt=1.0)] = 1e-4
    jitter: Annotated[Seconds, Meta(ge=0.0, le=0.1)] = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A whole collection: one sensor, its instruments, and groups of sessions.

    Parameters
    ----------
    name
        What it is called, by default its file's name.
    title, source, notes
        What it is, where it is from and what of it is assumed.
    sensor
        A preset's name or file.
    build
        Seed of a sensor of that design within its tolerances; left out, the design itself.
    epoch
        When day 0 began, in seconds since 1970: sessions carry no time of the machine that made them.
    sample_rate, force_rate, pose_rate, label_rate
        Of microphones, force/torque sensor, robot and labels, a second.
    delays
        Of the streams.
    force_sensor
        What the force/torque sensor is like.
    pose_noise
        Of the robot's pose, in m rms: encoders.
    groups
        What is collected.
    """

    name: str
    title: str = ""
    source: str = ""
    notes: str = ""
    sensor: str = "prototype"
    build: int | None = None
    epoch: Annotated[int, Meta(ge=0, le=2**31 - 10**8)] = 1_767_225_600
    sample_rate: Annotated[int, Meta(ge=16000, le=192000)] = 44100
    force_rate: Annotated[Hertz, Meta(ge=100.0, le=10000.0)] = 1000.0
    pose_rate: Annotated[Hertz, Meta(ge=10.0, le=1000.0)] = 250.0
    label_rate: Annotated[Hertz, Meta(ge=10.0, le=1000.0)] = 1000.0
    delays: Delays = Delays()
    force_sensor: ForceSensor = ForceSensor()
    pose_noise: Annotated[Metres, Meta(ge=0.0, le=0.01)] = 2e-5
    groups: tuple[Group, ...]

    def __post_init__(self) -> None:
        names = [group.name for group in self.groups]
        if not names or len(set(names)) < len(names):
            raise InputError(f"groups {', '.join(names) or 'none'}", "one or more, with names of their own")
        for group in self.groups:
            load_material(group.material)
            if group.music not in ("", "synthetic") and not Path(group.music).is_file():
                raise InputError(f"group {group.name}: music '{group.music}'", "synthetic, or a sound file")
            if group.like and self.group(group.like).like:
                raise InputError(f"group {group.name} like {group.like}", "a group with a motion of its own")

    def group(self, name: str) -> Group:
        """Return a group by its name; raises `InputError` where there is none."""
        for group in self.groups:
            if group.name == name:
                return group
        names = [group.name for group in self.groups]
        raise InputError(f"group '{name}'", ", ".join(names), did_you_mean(name, names))


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """One session of a plan: all that it depends on, so that whoever makes it makes the same.

    `index` counts the sessions of its group, `order` those of the plan; `seed` is the collection's.
    """

    plan: Plan
    group: Group
    index: int
    order: int
    seed: int = 0

    @property
    def name(self) -> str:
        """What the session is called."""
        return f"{self.group.name}_{self.index:03d}"

    @property
    def day(self) -> int:
        """Seed of its day."""
        return self.group.days[self.index % len(self.group.days)]

    @property
    def radius(self) -> Metres:
        """Radius of the object where it touches, in m."""
        group, index = self.origin.group, self.origin.index
        radii = group.radii or (load_material(self.group.material).radius,)
        return radii[index // group.sessions % len(radii)]

    @property
    def epoch(self) -> Seconds:
        """When it begins, in seconds since 1970."""
        return self.plan.epoch + self.day * DAY + self.order * APART

    @property
    def origin(self) -> "Assignment":
        """The session whose motion it carries out: itself, or one of the group that its own is like."""
        if not self.group.like:
            return self
        group = self.plan.group(self.group.like)
        index = self.index * group.total // self.group.total
        return Assignment(plan=self.plan, group=group, index=index, order=self.order, seed=self.seed)

    def design(self) -> Sensor:
        """Return the sensor as designed."""
        return load_sensor(self.plan.sensor)

    def sensor(self) -> Sensor:
        """Return the sensor as it is: this build of the design, on this day."""
        sensor = self.design()
        sensor = sensor if self.plan.build is None else build(sensor, self.plan.build)
        return sensor if self.day == 0 else day(sensor, self.day)

    def random(self, purpose: str) -> np.random.Generator:
        """Return random numbers of this session for one purpose."""
        return np.random.default_rng([self.seed, crc32(f"{self.name} {purpose}".encode())])

    def cells(self) -> Floats:
        """Return the touches of this session: place in m and force in N, (n, 2).

        Each is drawn within its cell of the group's grid, so that no two are alike; the cells are shuffled
        for each radius and dealt out to its sessions.
        """
        group, index = self.origin.group, self.origin.index
        places = group.places or self.design().range
        turn, dealt = divmod(index, group.sessions)
        random = np.random.default_rng([self.seed, crc32(f"{group.name} grid".encode()), turn])
        size = group.grid[0] * group.grid[1]
        row, column = np.divmod(random.permutation(size), group.grid[1])
        within = random.uniform(size=(2, size))
        place = places[0] + (places[1] - places[0]) * (row + within[0]) / group.grid[0]
        force = group.forces[0] + (group.forces[1] - group.forces[0]) * (column + within[1]) / group.grid[1]
        return np.stack([place, force], axis=1)[dealt :: group.sessions]


def assignments(plan: Plan, seed: int = 0) -> list[Assignment]:
    """Return every session of a plan, in order.

    Examples
    --------
    >>> plan = Plan(name="p", groups=(Group(name="a", sessions=2, radii=(0.002, 0.005)), Group(name="b")))
    >>> [session.name for session in assignments(plan)]
    ['a_000', 'a_001', 'a_002', 'a_003', 'b_000']
    """
    found: list[Assignment] = []
    for group in plan.groups:
        for index in range(group.total):
            found.append(Assignment(plan=plan, group=group, index=index, order=len(found), seed=seed))
    return found
