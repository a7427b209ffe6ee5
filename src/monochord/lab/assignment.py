"""What each session of a plan is given: its build, its day, its object and its touches."""

from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Metres, Seconds
from monochord.lab.designs import drawn_design
from monochord.lab.deviation import Deviation
from monochord.lab.objects import DRAWN
from monochord.lab.plan import Group, Plan
from monochord.physics.materials import Material, load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.setup import MountKind
from monochord.physics.twin import Key, Sensor, Touch
from monochord.physics.twin.held import drawn_mount
from monochord.physics.twin.world import World, plausible_touch, sensor_of

DAY: Seconds = 86400.0
SESSION_INTERVAL: Seconds = 120.0
"""Time between the starts of two sessions of a day, in s; a session lasts about half of it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """One session of a plan: everything that its content depends on.

    `index` counts the sessions of its group, `order` those of the plan; `seed` is the collection's.
    """

    plan: Plan
    group: Group
    index: int
    order: int
    seed: int = 0

    @property
    def name(self) -> str:
        """Name of the session."""
        return f"{self.group.name}_{self.index:03d}"

    @property
    def day(self) -> int:
        """Seed of the session's day."""
        turn = self.index // max(1, len(self.group.builds))
        return self.group.days[turn % len(self.group.days)]

    @property
    def build(self) -> int | None:
        """Seed of the session's build; None for the nominal design."""
        if self.group.first_build is not None:
            return self.group.first_build + self.index
        builds = self.group.builds
        return builds[self.index % len(builds)] if builds else self.plan.build

    @property
    def world(self) -> World:
        """The session's world."""
        return self.group.world or self.plan.world

    @property
    def material(self) -> Material:
        """The material of its object."""
        draw = DRAWN.get(self.group.material)
        return draw(self.random("object")) if draw else load_material(self.group.material)

    @property
    def radius(self) -> Metres:
        """Radius of the object where it touches, in m."""
        group, index = self.origin.group, self.origin.index
        radii = group.radii or (self.material.radius,)
        return radii[index // group.sessions % len(radii)]

    @property
    def epoch(self) -> Seconds:
        """Start time, in s since 1970."""
        return self.plan.epoch + self.day * DAY + self.order * SESSION_INTERVAL

    @property
    def origin(self) -> "Assignment":
        """The session whose motion is repeated: itself, or one of the group named by `like`."""
        if not self.group.like:
            return self
        group = self.plan.group(self.group.like)
        index = self.index * group.total // self.group.total
        return Assignment(plan=self.plan, group=group, index=index, order=self.order, seed=self.seed)

    def design(self) -> Sensor:
        """Return the sensor as designed."""
        sensor = load_sensor(self.plan.sensor)
        return drawn_design(sensor, self.random("design")) if self.group.design else sensor

    @property
    def deviation(self) -> Deviation:
        """Deviations of the session's sensor and object."""
        deviation = self.plan.deviation if self.group.deviation is None else self.group.deviation
        if self.group.detuned is None:
            return deviation
        return replace(deviation, tuning=float(self.random("tuning").uniform(*self.group.detuned)))

    def sensor(self) -> Sensor:
        """Return the sensor of this session: its build of the design, on its day."""
        day = None if self.day == 0 else self.day
        sensor = sensor_of(self.design(), self.world, build=self.build, day=day, effects=self.plan.effects)
        return self.deviation.of_sensor(sensor)

    def touch(self, motion: tuple[Key, ...]) -> Touch:
        """Return the object with its motion.

        In the plausible world one gripper holds all objects of a build, save drawn ones, each with its own.
        """
        radius = self.radius if self.origin.group.radii else None
        touch = Touch(material=self.material, motion=motion, radius=radius, rolls=self.group.rolls)
        drawn_for = self.name if self.group.material in DRAWN else f"build {self.build}"
        seed = crc32(f"{self.seed} {drawn_for}".encode())
        if self.group.mount and self.world == "plausible" and self.plan.effects.mount:
            touch = replace(touch, mount=drawn_mount(self.material.name, seed, self.group.mount))
        touch = plausible_touch(touch, seed, self.plan.effects, self.world)
        return self.deviation.of_touch(touch)

    @property
    def mount(self) -> MountKind:
        """The class of the mount that holds its object; empty where none is drawn."""
        place = 0.5 * sum(self.design().range)
        return self.touch((Key(time=0.0, position=place),)).mount.kind

    def random(self, purpose: str) -> np.random.Generator:
        """Return random numbers of this session for one purpose."""
        return np.random.default_rng([self.seed, crc32(f"{self.name} {purpose}".encode())])

    def cells(self) -> Floats:
        """Return the touches of this session: position in m and force in N, (n, 2).

        Each is drawn within its cell of the group's grid, so that no two are equal; the cells are shuffled
        for each radius and distributed among its sessions.
        """
        group, index = self.origin.group, self.origin.index
        places = group.places or self.design().range
        turn, part = divmod(index, group.sessions)
        random = np.random.default_rng([self.seed, crc32(f"{group.name} grid".encode()), turn])
        size = group.grid[0] * group.grid[1]
        row, column = np.divmod(random.permutation(size), group.grid[1])
        within = random.uniform(size=(2, size))
        place = places[0] + (places[1] - places[0]) * (row + within[0]) / group.grid[0]
        force = group.forces[0] + (group.forces[1] - group.forces[0]) * (column + within[1]) / group.grid[1]
        return np.stack([place, force], axis=1)[part :: group.sessions]


def assignments(plan: Plan, seed: int = 0) -> list[Assignment]:
    """Return every session of a plan, in order.

    Examples
    --------
    >>> plan = Plan(name="p", groups=(Group(name="a", sessions=2, radii=(0.002, 0.005)), Group(name="b")))
    >>> [session.name for session in assignments(plan)]
    ['a_000', 'a_001', 'a_002', 'a_003', 'b_000']
    """
    sessions: list[Assignment] = []
    for group in plan.groups:
        for index in range(group.total):
            sessions.append(Assignment(plan=plan, group=group, index=index, order=len(sessions), seed=seed))
    return sessions
