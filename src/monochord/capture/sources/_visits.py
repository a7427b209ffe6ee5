"""When, where and how an object visits a simulated string: a script, or an endless draw."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.units import Metres, MetresPerSecond, Newtons, Samples, Seconds
from monochord.physics.materials import load_material
from monochord.physics.twin import Key, Touch

CLEAR: Metres = 3e-3
"""How far above the string an approach begins and a release ends: many times the string's swing."""
SET_OFF: Seconds = 0.02
"""How long a slide takes to reach its speed."""
EDGE = 0.02
"""Share of the string's length at each end where nothing can touch it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """An object meets the string at `start`, presses, moves and leaves.

    Parameters
    ----------
    start
        When its surface reaches the string at rest, in s; the approach comes before.
    position, force
        Where in m, and how hard in N.
    seconds
        From `start` to the beginning of the release; without end by default.
    material
        A preset's name or file; the source's first one if empty.
    still
        How long after `start` it begins to move, in s.
    moving
        For how long it moves, in s.
    across, along
        Speed in m/s across the string and, towards its end, along it; either sign.
    rolls
        Whether it rolls where it moves along the string, or slides.
    then
        Force in N that it goes over to while it moves; by default it keeps its force.
    approach
        Speed of approach and release in m/s.
    press
        Time in s in which the force rises to its value, and falls again.
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
        """When the approach begins, in s."""
        return self.start - CLEAR / self.approach

    @property
    def end(self) -> Seconds:
        """When the object is clear of the string again, in s."""
        return self.start + self.seconds + self.press + CLEAR / self.approach

    @property
    def moves(self) -> bool:
        """Whether it does anything but press while it touches."""
        return self.across != 0.0 or self.along != 0.0 or self.then is not None

    def refuse_impossible(self, length: Metres) -> None:
        """Raise `InputError` for a visit that a string of `length` cannot have."""
        where = f"visit at {self.start:g} s"
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
        if self.moves and self.still + self.moving + 2.0 * SET_OFF > self.seconds:
            least = self.still + self.moving + 2.0 * SET_OFF
            raise InputError(
                f"{where}: seconds {self.seconds:g}", f"{least:g} s or more", "or less of moving"
            )
        edge = EDGE * length
        for place in (self.position, self.position + self.along * self.moving):
            if not edge <= place <= length - edge:
                raise InputError(f"{where}: place {place:g} m", f"{edge:g} to {length - edge:g} m")
        load_material(self.material or "plastic")

    def touch(self, usual: str) -> Touch:
        """Return the object and its motion; `usual` is its material unless the visit names one."""
        gone = self.position + self.along * self.moving
        after = self.force if self.then is None else self.then
        keys = [
            Key(time=self.begin, position=self.position, clearance=CLEAR),
            Key(time=self.start, position=self.position),
            Key(time=self.start + self.press, position=self.position, force=self.force),
        ]
        leave = self.start + self.seconds
        if self.moves:
            off, to = self.start + self.still, self.start + self.still + self.moving
            keys += [
                Key(time=off, position=self.position, force=self.force),
                Key(time=off + SET_OFF, position=_between(self.position, gone, SET_OFF / self.moving),
                    force=self.force + (after - self.force) * SET_OFF / self.moving, across=self.across),
                Key(time=to, position=gone, force=after, across=self.across),
                Key(time=to + SET_OFF, position=gone, force=after),
            ]  # fmt: skip
        if math.isfinite(leave):
            last = keys[-1]
            keys += [
                Key(time=leave, position=last.position, force=last.force),
                Key(time=leave + self.press, position=last.position),
                Key(time=self.end, position=last.position, clearance=CLEAR),
            ]
        rising = [
            key
            for key, after in zip(keys, [*keys[1:], None], strict=True)
            if after is None or after.time > key.time
        ]
        return Touch(material=load_material(self.material or usual), motion=tuple(rising), rolls=self.rolls)


def wander(
    *,
    seed: int,
    hold: Seconds,
    positions: tuple[Metres, Metres],
    forces: tuple[Newtons, Newtons],
    slips: float,
    materials: Sequence[str],
) -> Iterator[Visit]:
    """Yield visits without end: each a place, a force, an approach and a release of its own, then a pause.

    A share `slips` of them moves while it presses, half of these across the string, the others along it,
    sliding or rolling, at 2 to 30 mm/s; of the rest every second goes over to another force. Visits last
    0.7 to 1.3 times `hold`, pauses 0.4 to 1.0 times.
    """
    random = np.random.default_rng([seed, 2])
    end = 0.0
    while True:
        pause, seconds = hold * random.uniform(0.4, 1.0), hold * random.uniform(0.7, 1.3)
        position, force, then = random.uniform(*positions), random.uniform(*forces), random.uniform(*forces)
        approach, press = 10.0 ** random.uniform(-2.0, -1.0), 10.0 ** random.uniform(-1.7, -0.7)
        speed = 10.0 ** random.uniform(-2.7, -1.52) * random.choice((-1.0, 1.0))
        kind, material = random.uniform(), materials[int(random.integers(len(materials)))]
        press = min(press, 0.1 * seconds)
        moving = 0.4 * seconds
        room = (positions[1] if speed > 0.0 else positions[0]) - position
        lengthwise = math.copysign(min(abs(speed), abs(room) / moving), speed)
        start = end + pause + CLEAR / approach
        visit = Visit(
            start=start,
            position=position,
            force=force,
            seconds=seconds,
            material=material,
            still=0.35 * seconds,
            moving=moving,
            across=speed if kind < 0.5 * slips else 0.0,
            along=lengthwise if 0.5 * slips <= kind < slips else 0.0,
            rolls=0.75 * slips <= kind < slips,
            then=then if kind >= 0.5 * (1.0 + slips) else None,
            approach=approach,
            press=press,
        )
        end = visit.end
        yield visit


def changes(
    visits: Iterable[Visit], usual: str, sample_rate: int
) -> Iterator[tuple[Samples, tuple[Touch, ...]]]:
    """Yield, for the index of each frame at which an object comes or goes, the touches from there on."""
    for visit in visits:
        yield max(0, math.floor(visit.begin * sample_rate)), (visit.touch(usual),)
        if math.isinf(visit.end):
            return
        yield math.ceil(visit.end * sample_rate), ()


def _between(first: float, last: float, share: float) -> float:
    return first + (last - first) * share
