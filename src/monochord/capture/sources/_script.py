"""Scripted touches for the simulated sources: given by the user, or drawn at random without end."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Contact, StringParams
from monochord.core.units import Metres, MetresPerSecond, Newtons, Samples, Seconds
from monochord.physics.materials import load_material
from monochord.physics.twin import Touch
from monochord.physics.twin.ends import NEAREST
from monochord.physics.twin.trajectory import TRAVEL_HEIGHT, Trajectory, Waypoint, trajectory

SLIDE_RAMP: Seconds = 0.02
"""Time for a slide to reach its speed, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptedTouch:
    """An object meets the string at `start`, presses, moves and leaves.

    Parameters
    ----------
    start
        Time at which the object reaches the string at rest, in s; the approach comes before.
    position, force
        Position in m and normal force in N.
    seconds
        Time from `start` to the release, in s; without end by default.
    material
        A preset's name or a TOML file; the source's first material if empty.
    still
        Time from `start` until the object begins to move, in s.
    moving
        Duration of the motion, in s.
    across, along
        Signed speeds in m/s across the string and along it, positive towards its far end.
    rolls
        Whether the object rolls along the string instead of sliding.
    then
        Force in N reached during the motion; by default the force is constant.
    approach
        Speed of approach and release in m/s.
    press
        Rise and fall time of the force, in s.
    """

    start: Seconds = 0.5
    position: Metres
    force: Newtons = 1.0
    seconds: Seconds = math.inf
    material: str = ""
    still: Seconds = 0.4
    moving: Seconds = 0.5
    across: MetresPerSecond = 0.0
    along: MetresPerSecond = 0.0
    rolls: bool = False
    then: Newtons | None = None
    approach: MetresPerSecond = 0.05
    press: Seconds = 0.05

    @property
    def begin(self) -> Seconds:
        """Start time of the approach, in s."""
        return self.start - TRAVEL_HEIGHT / self.approach

    @property
    def end(self) -> Seconds:
        """Time at which the object has left the string, in s."""
        return self.start + self.seconds + self.press + TRAVEL_HEIGHT / self.approach

    @property
    def moves(self) -> bool:
        """Whether the object moves or changes its force during the touch."""
        return self.across != 0.0 or self.along != 0.0 or self.then is not None

    def refuse_impossible(self, length: Metres) -> None:
        """Raise `InputError` for a touch that is impossible on a string of `length`."""
        where = f"touch at {self.start:g} s"
        for name, low, high, unit in (
            ("start", 0.0, math.inf, "s"),
            ("force", 0.0, 10.0, "N"),
            ("then", 0.0, 10.0, "N"),
            ("still", self.press, math.inf, "s (press or more)"),
            ("moving", 0.05, math.inf, "s"),
            ("across", -0.5, 0.5, "m/s"),
            ("along", -5.0, 5.0, "m/s"),
            ("approach", 1e-3, 1.0, "m/s"),
            ("press", 1e-3, 10.0, "s"),
            ("seconds", self.press, math.inf, "s (press or more)"),
        ):
            value = getattr(self, name)
            if value is not None and not (low <= value <= high and (name == "seconds" or value < math.inf)):
                raise InputError(f"{where}: {name} {value:g}", f"{low:g} to {high:g} {unit}")
        shortest = self.still + self.moving + 2.0 * SLIDE_RAMP
        if self.moves and shortest > self.seconds:
            allowed = f"{shortest:g} s or more"
            raise InputError(f"{where}: seconds {self.seconds:g}", allowed, "or a shorter moving")
        edge = NEAREST * length
        for position in (self.position, self.position + self.along * self.moving):
            if not edge <= position <= length - edge:
                raise InputError(f"{where}: position {position:g} m", f"{edge:g} to {length - edge:g} m")
        load_material(self.material or "plastic")

    def trajectory(self, string: StringParams) -> Trajectory:
        """Return the object's motion over a string."""
        pressed = self.start + self.press
        moves = [
            Waypoint(time=self.start, kind="approach"),
            Waypoint(time=pressed, force=self.force, kind="press"),
        ]
        gone, after = self.position, self.force
        if self.moves:
            gone = self.position + self.along * self.moving
            after = self.force if self.then is None else self.then
            begin, stop = self.start + self.still, self.start + self.still + self.moving
            ramp = SLIDE_RAMP / self.moving
            moves += [
                Waypoint(time=begin, force=self.force),
                Waypoint(
                    time=begin + SLIDE_RAMP,
                    position=self.position + (gone - self.position) * ramp,
                    force=self.force + (after - self.force) * SLIDE_RAMP / self.moving,
                    across=self.across,
                    kind="slide",
                ),
                Waypoint(time=stop, position=gone, force=after, across=self.across, kind="slide"),
                Waypoint(time=stop + SLIDE_RAMP, force=after, kind="slide"),
            ]
        leave = self.start + self.seconds
        if math.isfinite(leave):
            moves += [
                Waypoint(time=leave, force=after),
                Waypoint(time=leave + self.press, kind="release"),
                Waypoint(time=self.end, clearance=TRAVEL_HEIGHT, kind="retreat"),
            ]
        return trajectory(moves, string, position=self.position, begin=self.begin)

    def touch(self, string: StringParams, default_material: str) -> Touch:
        """Return the object and its motion for the twin."""
        material = load_material(self.material or default_material)
        return Touch(material=material, motion=self.trajectory(string).keys, rolls=self.rolls)


_CLAMP_FIELDS = {"start", "position", "force", "seconds"}


def refuse_unlike_clamps(touches: Iterable[ScriptedTouch]) -> None:
    """Raise `InputError` for touches that a split string cannot render: it supports clamping only."""
    for touch in touches:
        for field in fields(touch):
            if field.name not in _CLAMP_FIELDS and getattr(touch, field.name) != field.default:
                given = f"touch at {touch.start:g} s: {field.name} for a split string"
                raise InputError(given, ", ".join(sorted(_CLAMP_FIELDS)), "use the source twin")


def draw_touches(
    *,
    seed: int,
    hold: Seconds,
    positions: tuple[Metres, Metres],
    forces: tuple[Newtons, Newtons],
    slips: float,
    materials: Sequence[str],
) -> Iterator[ScriptedTouch]:
    """Yield touches without end: each with its own position, force, approach and release, then a pause.

    A share `slips` of the touches moves while pressing: half of these across the string, the others along it,
    sliding or rolling, at 2 to 30 mm/s. Half of the remaining touches change their force. Touches last 0.7 to
    1.3 times `hold`, pauses 0.4 to 1.0 times.
    """
    random = np.random.default_rng([seed, 2])
    end = 0.0
    while True:
        pause, seconds = hold * random.uniform(0.4, 1.0), hold * random.uniform(0.7, 1.3)
        position, force, then = random.uniform(*positions), random.uniform(*forces), random.uniform(*forces)
        approach, press = 10.0 ** random.uniform(-2.0, -1.0), 10.0 ** random.uniform(-1.7, -0.7)
        speed = 10.0 ** random.uniform(-2.7, -1.52) * random.choice((-1.0, 1.0))
        kind, material = random.uniform(), materials[int(random.integers(len(materials)))]
        moving = 0.4 * seconds
        space = (positions[1] if speed > 0.0 else positions[0]) - position
        along = math.copysign(min(abs(speed), abs(space) / moving), speed)
        touch = ScriptedTouch(
            start=end + pause + TRAVEL_HEIGHT / approach,
            position=position,
            force=force,
            seconds=seconds,
            material=material,
            still=0.35 * seconds,
            moving=moving,
            across=speed if kind < 0.5 * slips else 0.0,
            along=along if 0.5 * slips <= kind < slips else 0.0,
            rolls=0.75 * slips <= kind < slips,
            then=then if kind >= 0.5 * (1.0 + slips) else None,
            approach=approach,
            press=min(press, 0.1 * seconds),
        )
        end = touch.end
        yield touch


def draw_clamps(
    *, seed: int, hold: Seconds, positions: tuple[Metres, Metres], forces: tuple[Newtons, Newtons]
) -> Iterator[ScriptedTouch]:
    """Yield touches without end, the first after about one `hold`.

    A touch is followed, with equal probability, by a touch elsewhere or by a release; a release by a touch.
    Each lasts 0.7 to 1.3 times `hold`.
    """
    random = np.random.default_rng(seed)
    start, touching, before = 0.0, False, None
    while True:
        start += hold * random.uniform(0.7, 1.3)
        if before is not None:
            begin, position, force = before
            yield ScriptedTouch(start=begin, position=position, force=force, seconds=start - begin)
        touching = not touching or bool(random.integers(2))
        position, force = random.uniform(*positions), random.uniform(*forces)
        before = (start, position, force) if touching else None


def twin_changes(
    touches: Iterable[ScriptedTouch], string: StringParams, default_material: str, sample_rate: int
) -> Iterator[tuple[Samples, tuple[Touch, ...]]]:
    """Yield the frame index of each arrival or departure of an object, with the touches from then on."""
    for touch in touches:
        yield max(0, math.floor(touch.begin * sample_rate)), (touch.touch(string, default_material),)
        if math.isinf(touch.end):
            return
        yield math.ceil(touch.end * sample_rate), ()


def clamp_changes(
    touches: Iterable[ScriptedTouch], sample_rate: int
) -> Iterator[tuple[Samples, Contact | None]]:
    """Yield each change as its first sample index and the contact, None for a release.

    A touch ends where the next begins, or after its `seconds` if that is earlier.
    """
    end: Samples | None = None
    for touch in touches:
        begin = round(touch.start * sample_rate)
        if end is not None and end < begin:
            yield end, None
        yield begin, Contact(position=touch.position, force=touch.force)
        finite = math.isfinite(touch.seconds)
        end = round((touch.start + touch.seconds) * sample_rate) if finite else None
    if end is not None:
        yield end, None
