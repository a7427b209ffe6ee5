"""A simulated object moved by a person over a simulated string during playback."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monochord.capture.sources.base import Controls, ControlSetting
from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Contact
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.materials import load_material
from monochord.physics.setup import Key, Sensor, Touch
from monochord.physics.twin.ends import lengthened, reach
from monochord.physics.twin.world import World, plausible_touch

FORCES: tuple[Newtons, Newtons] = (0.05, 2.5)
HEIGHT: Metres = 1.5e-3
"""Height above the string at rest where an approach begins and a release ends: above the string's swing."""
APPROACH: MetresPerSecond = 0.1
"""Speed of approach and release, in m/s."""
PRESS: Seconds = 0.04
"""Rise and fall time of the force, in s."""
FOLLOW: Seconds = 0.06
"""Time to reach a new position or force, in s: it smooths a person's steps of 20 to 30 ms."""
PAUSE: Seconds = 0.03
"""Shortest time between two motion changes, in s; each costs some 3 ms of computing."""
MAX_SPEED: MetresPerSecond = 0.5
MAX_ACROSS: MetresPerSecond = 0.1
STEP: Metres = 1e-4
FORCE_STEP: Newtons = 0.02
ACROSS_STEP: MetresPerSecond = 1e-3
"""Smaller changes of position, force and sliding speed are hand tremor and are ignored."""
AUTOMATIC, MANUAL = "automatic", "by hand"
"""Whether touches are automatic or by hand."""
NOISES: Mapping[str, tuple[str, float] | None] = {
    "none": None,
    **{
        f"{name}, {ratio} dB": (kind, float(ratio))
        for name, kind in (("white", "white"), ("music", "chord"), ("motor", "motor"))
        for ratio in (30, 20, 10)
    },
}
"""Noise choices: a kind from `monochord.dsp.noise.NOISES`, and the signal-to-noise ratio in dB."""
TUNINGS: Mapping[str, float] = {"-3 %": -0.03, "-1 %": -0.01, "as built": 0.0, "+1 %": 0.01, "+3 %": 0.03}
"""Relative changes of the open string's pitch."""


class TouchRequests(Controls):
    """A person's requests to a simulated string; only the newest request counts.

    Touches are within the range `positions`, in m, of one of the `materials`, by default the first.
    """

    def __init__(self, positions: tuple[Metres, Metres], materials: Sequence[str]) -> None:
        self._positions = positions
        self._lock = threading.Lock()
        self._contact: Contact | None = None
        self._number = 0
        self._choices: dict[str, tuple[str, ...]] = {
            "touches": (AUTOMATIC, MANUAL),
            "material": tuple(materials),
            "noise": tuple(NOISES),
            "tuning": tuple(TUNINGS),
        }
        self._values = {name: choices[0] for name, choices in self._choices.items()} | {"tuning": "as built"}

    @property
    def positions(self) -> tuple[Metres, Metres]:
        """Range of touch positions, in m."""
        return self._positions

    @property
    def forces(self) -> tuple[Newtons, Newtons]:
        """Range of touch forces, in N."""
        return FORCES

    @property
    def settings(self) -> tuple[ControlSetting, ...]:
        """Current settings: who touches the string, the material, the noise, and the tuning."""
        with self._lock:
            values = self._values
            return tuple(ControlSetting(name=n, choices=c, value=values[n]) for n, c in self._choices.items())

    def touch(self, contact: Contact) -> None:
        """Touch the string, or move the object there; automatic touches end."""
        position = float(np.clip(contact.position, *self._positions))
        force = float(np.clip(contact.force, *FORCES))
        across = float(np.clip(contact.slip_velocity, -MAX_ACROSS, MAX_ACROSS))
        if not np.isfinite(position + force + across):
            raise InputError(f"a touch at {contact.position} m with {contact.force} N", "finite numbers")
        with self._lock:
            self._number += self._contact is None
            self._contact = Contact(position=position, force=force, slip_velocity=across)
            self._values["touches"] = MANUAL

    def release(self) -> None:
        """Lift the object off the string."""
        with self._lock:
            self._contact = None

    def change(self, name: str, value: str) -> None:
        """Change a setting."""
        if name not in self._choices:
            raise InputError(f"setting '{name}'", ", ".join(self._choices), did_you_mean(name, self._choices))
        choices = self._choices[name]
        if value not in choices:
            raise InputError(f"{name} '{value}'", ", ".join(choices), did_you_mean(value, choices))
        with self._lock:
            self._values[name] = value
            if value == AUTOMATIC:
                self._contact = None

    @property
    def manual(self) -> bool:
        """Whether the person alone touches the string."""
        return self._values["touches"] == MANUAL

    @property
    def noise(self) -> tuple[str, float] | None:
        """Kind of the added noise and the signal-to-noise ratio in dB; None for no noise."""
        return NOISES[self._values["noise"]]

    @property
    def retuning(self) -> float:
        """Relative change of the open string's pitch."""
        return TUNINGS[self._values["tuning"]]

    def target(self) -> tuple[int, Contact, str] | None:
        """Return the touch number, its target and the material; None for no touch."""
        with self._lock:
            if self._contact is None:
                return None
            return self._number, self._contact, self._values["material"]


class HandledObject:
    """The object that follows `TouchRequests`; `seed` draws its mount and surface in a plausible `world`.

    It stays on the string of `sensor`: near an end, a wide one as near as it comes.
    """

    def __init__(self, requests: TouchRequests, sensor: Sensor, seed: int, world: World) -> None:
        self._requests, self._sensor, self._seed = requests, lengthened(sensor), seed
        self._world: World = world
        self._touch: Touch | None = None
        self._number: int | None = None
        self._lifting = False
        self._changed: Seconds = 0.0

    def take_over(self, touches: tuple[Touch, ...]) -> None:
        """Take over the object that touches the string now, so that it can be lifted off."""
        self._touch, self._number, self._lifting = next(iter(touches), None), None, False

    def touches(self, time: Seconds) -> tuple[Touch, ...] | None:
        """Return the touches from this time on; None for no change."""
        target, touch = self._requests.target(), self._touch
        if touch is None:
            return None if target is None else self._bring(time, *target)
        if self._lifting:
            if time < touch.motion[-1].time:
                return None
            self._touch = None
            return ()
        now = _at(touch.motion, time)
        if target is None or target[0] != self._number:
            self._lifting = True
            return self._go_on(time, now, *_off(now))
        return self._lead(time, now, target[1])

    def _bring(self, time: Seconds, number: int, contact: Contact, material: str) -> tuple[Touch, ...]:
        self._number, self._lifting, self._changed = number, False, time
        drawn = Touch(
            material=load_material(material), motion=(Key(time=time, position=contact.position),), rolls=False
        )
        touch = plausible_touch(drawn, self._seed, world=self._world)
        above = Key(time=time, position=self._reached(contact.position, touch), clearance=HEIGHT)
        down = replace(above, time=time + HEIGHT / APPROACH, clearance=0.0)
        pressed = replace(down, time=down.time + PRESS, force=contact.force)
        self._touch = replace(touch, motion=(above, down, pressed))
        return (self._touch,)

    def _reached(self, position: Metres, touch: Touch) -> Metres:
        """Return the place nearest to `position` that an object of this width reaches, however tuned."""
        low, high = reach(self._sensor, touch.law.width)
        return float(np.clip(position, low + STEP, high - STEP))

    def _lead(self, time: Seconds, now: Key, contact: Contact) -> tuple[Touch, ...] | None:
        assert self._touch is not None
        goal, last = self._goal(now, contact, self._touch), self._touch.motion[-1]
        still = abs(goal.position - last.position) < STEP and abs(goal.force - last.force) < FORCE_STEP
        if (still and abs(goal.across - last.across) < ACROSS_STEP) or time < self._changed + PAUSE:
            return None
        down = replace(now, time=time + now.clearance / APPROACH, clearance=0.0)
        there = replace(goal, time=down.time + (FOLLOW if now.clearance == 0.0 else PRESS))
        return self._go_on(time, now, *([down] if now.clearance > 0.0 else []), there)

    def _goal(self, now: Key, contact: Contact, touch: Touch) -> Key:
        way = MAX_SPEED * FOLLOW
        position = np.clip(contact.position, now.position - way, now.position + way)
        position = self._reached(position, touch)
        return Key(time=now.time, position=position, force=contact.force, across=contact.slip_velocity)

    def _go_on(self, time: Seconds, *keys: Key) -> tuple[Touch, ...]:
        """Let the object follow these keyframes instead of its planned motion."""
        assert self._touch is not None
        past = tuple(key for key in self._touch.motion if key.time < time)[-1:]
        self._touch, self._changed = replace(self._touch, motion=(*past, *keys)), time
        return (self._touch,)


def _at(motion: Sequence[Key], time: Seconds) -> Key:
    """Return the state of a motion at a time."""
    times = [key.time for key in motion]
    names = ("position", "force", "clearance", "across")
    now = {name: float(np.interp(time, times, [getattr(key, name) for key in motion])) for name in names}
    return Key(time=time, **now)


def _off(now: Key) -> list[Key]:
    """Return the remaining motion, which ends above the string."""
    free = replace(now, time=now.time + PRESS, force=0.0, across=0.0)
    start = free if now.clearance == 0.0 else now
    rise = max(HEIGHT - now.clearance, 0.0) / APPROACH
    gone = replace(start, time=start.time + rise + 1e-3, force=0.0, clearance=max(HEIGHT, now.clearance))
    return [free, gone] if now.clearance == 0.0 else [gone]
