"""A virtual sensor that is touched step by step: press, slide, release, and take the sound."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.lengths import metres_meant
from monochord.core.notebook import lines
from monochord.core.ranges import Finite, NonNegative, Positive, Seed, checked
from monochord.core.types import Audio, Floats
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import as_sensor
from monochord.physics.setup import MAX_TOUCHES, Key, Pluck, Scene, Sensor, Touch
from monochord.physics.theory import open_frequency
from monochord.physics.twin.stream import Labels, advance, begin, retouch, switch
from monochord.physics.twin.world import World, plausible_touch, sensor_of

CLEARANCE: Metres = 3e-3
"""Where an approach begins and a release ends, above the string at rest: many times the string's swing."""
APPROACH: MetresPerSecond = 0.05
"""Speed of an approach and of a release."""
PRESS: Seconds = 0.05
"""Time in which the force of a press builds up, and falls again."""
ACCELERATION: Seconds = 0.02
"""Time in which a slide reaches its speed."""
MAX_SECONDS: Seconds = 3600.0
"""Longest time of an advance or of a slide."""
PLUCK = 5e-4
"""Height of the pluck that starts the string, as a share of its length."""


class VirtualSensor:
    """The twin as an object with a state: a simulated sensor that a program touches as it goes.

    Time runs only in `advance`. What is asked of an object begins at the present time and takes effect in
    the sound that is taken after it; an approach lasts 60 ms and a press 50 ms. All sound is simulated.

    Parameters
    ----------
    sensor
        A preset's name, a TOML file, or a sensor.
    seed
        Random seed of the converters' noise and of the objects' surfaces.
    build, day
        Seeds of another build within the design's tolerances, and of another day; None is the design itself.
    world
        ``ideal``, or ``plausible``: what a real build brings besides, see `monochord.physics.twin.world`. The
        mounts and surfaces of its objects are drawn by `seed` and material.
    sample_rate
        In Hz, 16000 to 192000.

    Attributes
    ----------
    design, sensor
        The sensor as designed, and this build of it; `sensor.measured_length` is what a ruler says.

    Raises
    ------
    InputError
        For an unknown sensor or world, or a seed or rate out of range.

    Examples
    --------
    >>> twin = VirtualSensor("prototype", seed=1)
    >>> _ = twin.press(0.09, 1.0, material="plastic")
    >>> sound, labels = twin.advance(0.2)
    >>> sound.shape, bool(labels["contact"][-1])
    ((2, 8820), True)
    >>> twin.release()
    >>> bool(twin.advance(0.3)[1]["contact"][-1])
    False
    """

    @checked
    def __init__(
        self,
        sensor: str | Path | Sensor = "prototype",
        *,
        seed: Seed = 0,
        build: Seed | None = None,
        day: Seed | None = None,
        world: World = "ideal",
        sample_rate: Annotated[int, "Hz", Meta(ge=16_000, le=192_000)] = 44100,
    ) -> None:
        design = as_sensor(sensor)
        self.design, self.sensor = design, sensor_of(design, world, build=build, day=day)
        self.world: World = world
        self._seed, self.build = seed, build
        length = self.sensor.string.length
        pluck = Pluck(position=0.2 * length, height=PLUCK * length)
        self._twin = begin(self.sensor, Scene(pluck=pluck), sample_rate=sample_rate, seed=seed)
        self._touches: list[Touch] = []
        self._changed = False

    @property
    def time(self) -> Seconds:
        """Time since the start, in s."""
        return self._twin.start / self._twin.sample_rate

    @property
    def sample_rate(self) -> int:
        """Frames a second."""
        return self._twin.sample_rate

    def __repr__(self) -> str:
        string, pressed = self.sensor.string, [key for key in self._pressed() if key.force > 0.0]
        return lines(
            f"VirtualSensor: {self.design.name}, simulated, after {self.time:.2f} s",
            [
                ("world", self.world),
                ("string", f"{1e3 * string.length:.1f} mm, {open_frequency(string):.1f} Hz"),
                (
                    "touch",
                    ", ".join(f"{1e3 * k.position:.1f} mm with {k.force:.2f} N" for k in pressed) or "none",
                ),
                ("sound", f"2 microphones at {self.sample_rate} Hz"),
            ],
        )

    @checked
    def press(
        self,
        position: Finite[Metres],
        force: NonNegative[Newtons],
        *,
        material: str | Path = "plastic",
        radius: Positive[Metres] | None = None,
        rolls: bool = False,
    ) -> int:
        """Bring a new object down on the string.

        Parameters
        ----------
        position
            From pickup 1, in m.
        force
            Normal force in N, 0 to 10.
        material
            A preset's name or a TOML file.
        radius
            Of the object where it touches, in m; the material's usual one by default.
        rolls
            Whether the object rolls when it moves along the string, or slides.

        Returns
        -------
        int
            The object's number, which `slide`, `change` and `release` take.

        Raises
        ------
        InputError
            For a position off the string, a force out of range, an unknown material, or a ninth object.
        """
        self._refuse_off_string(position)
        last = [touch.motion[-1] for touch in self._touches]
        if all(key.clearance > 0.0 and self.time >= key.time for key in last):
            self._touches = []  # all are gone
        if len(self._touches) == MAX_TOUCHES:
            given, allowed = f"object {MAX_TOUCHES + 1}", f"{MAX_TOUCHES} at once"
            raise InputError(given, allowed, "release all, and advance")
        down = self.time + CLEARANCE / APPROACH
        motion = (
            Key(time=self.time, position=position, clearance=CLEARANCE),
            Key(time=down, position=position),
            Key(time=down + PRESS, position=position, force=force),
        )
        touch = Touch(material=load_material(material), motion=motion, radius=radius, rolls=rolls)
        self._touches.append(plausible_touch(touch, self._seed, world=self.world))
        self._changed = True
        return len(self._touches) - 1

    @checked
    def change(self, force: NonNegative[Newtons], *, touch: int = -1) -> None:
        """Change the force of an object that presses, within 50 ms; the last object by default."""
        now = self._now(touch)
        later = replace(now, time=now.time + PRESS, force=force, clearance=0.0, across=0.0)
        self._continue(touch, now, later)

    @checked
    def slide(
        self,
        seconds: Annotated[Seconds, Meta(ge=2.0 * ACCELERATION, le=MAX_SECONDS)],
        *,
        across: Finite[MetresPerSecond] = 0.0,
        along: Finite[MetresPerSecond] = 0.0,
        touch: int = -1,
    ) -> None:
        """Move an object while it presses; the last object by default.

        Parameters
        ----------
        seconds
            How long it moves, 0.05 s or more.
        across, along
            Speed across the string, and along it towards pickup 2, in m/s; either sign.
        touch
            Number of the object.

        Raises
        ------
        InputError
            For too short a motion, or one that leaves the string.
        """
        now = self._now(touch)
        end = now.position + along * seconds
        self._refuse_off_string(end)
        share = ACCELERATION / seconds
        self._continue(
            touch,
            now,
            replace(
                now,
                time=now.time + ACCELERATION,
                position=now.position + share * (end - now.position),
                across=across,
            ),
            replace(
                now,
                time=now.time + seconds - ACCELERATION,
                position=end - share * (end - now.position),
                across=across,
            ),
            replace(now, time=now.time + seconds, position=end, across=0.0),
        )

    @checked
    def release(self, touch: int | None = None) -> None:
        """Lift an object off the string, or all of them."""
        for number in range(len(self._touches)) if touch is None else [touch]:
            now = self._now(number)
            free = replace(now, time=now.time + PRESS, force=0.0, clearance=0.0, across=0.0)
            gone = replace(free, time=free.time + CLEARANCE / APPROACH, clearance=CLEARANCE)
            self._continue(number, now, *([gone] if now.clearance > 0.0 else [free, gone]))

    @checked
    def drive(self, first: bool, second: bool) -> None:  # noqa: FBT001
        """Switch the two drivers on or off; each goes over in 5 ms."""
        self._twin = switch(self._twin, (first, second))

    @checked
    def advance(
        self, seconds: Annotated[Seconds, Meta(ge=0.0, le=MAX_SECONDS)]
    ) -> tuple[Audio, dict[str, Floats]]:
        """Advance time, and return the sound and its ground truth.

        Returns
        -------
        sound
            Both microphones, (2, n) float32 in full scale.
        labels
            By name, (n,) each: ``contact``, ``slip`` and ``settled`` 0 or 1; ``position`` in m, ``force`` in
            N and ``slip_velocity`` in m/s, NaN where nothing touches. Of several objects the one that presses
            hardest counts; ``contacts`` is how many touch.

        Raises
        ------
        InputError
            For a negative time, or more than an hour at once.
        """
        if self._changed:
            self._twin = retouch(self._twin, tuple(self._touches))
            self._changed = False
        take, self._twin = advance(self._twin, round(seconds * self.sample_rate))
        return take.microphones, _columns(take.labels)

    def _refuse_off_string(self, position: Metres) -> None:
        length = self.sensor.string.length
        if not 0.02 * length <= position <= 0.98 * length:
            expected = f"{0.02 * length:g} to {0.98 * length:g} m"
            raise InputError(f"a touch at {position:g} m", expected, metres_meant(position))

    def _pressed(self) -> list[Key]:
        """Return where each object's motion has brought it by now."""
        return [self._now(number) for number in range(len(self._touches))]

    def _now(self, touch: int) -> Key:
        """Return where an object's motion has brought it by now."""
        try:
            motion = self._touches[touch].motion
        except IndexError:
            given, allowed = f"object {touch}", f"one of {len(self._touches)} objects"
            raise InputError(given, allowed, "press first") from None
        times = [key.time for key in motion]
        values = {
            name: float(np.interp(self.time, times, [getattr(key, name) for key in motion]))
            for name in ("position", "force", "clearance", "across")
        }
        return Key(time=self.time, **values)

    def _continue(self, touch: int, *keys: Key) -> None:
        """Have an object go on from now by these keys, whatever it was about to do."""
        before = self._touches[touch]
        past = tuple(key for key in before.motion if key.time < self.time)
        self._touches[touch] = replace(before, motion=(*past[-1:], *keys))
        self._changed = True


def _columns(labels: Labels) -> dict[str, Floats]:
    """Return the labels of all objects as those of the one that presses hardest."""
    count = labels.settled.size
    columns: dict[str, Floats] = {
        "contact": np.zeros(count),
        "contacts": np.zeros(count),
        "settled": labels.settled.astype(np.float64),
    }
    known = {
        "position": labels.position,
        "force": labels.force,
        "slip": labels.slip,
        "slip_velocity": np.hypot(labels.across, labels.along),
    }
    if not labels.contact.shape[0]:
        return columns | {name: np.full(count, np.nan) for name in known}
    touched = labels.contact > 0
    hardest = np.argmax(np.where(touched, labels.force, -1.0), axis=0)[None]
    columns["contacts"] = touched.sum(axis=0).astype(np.float64)
    columns["contact"] = np.minimum(columns["contacts"], 1.0)
    for name, values in known.items():
        column = np.take_along_axis(values, hardest, axis=0)[0].astype(np.float64)
        column[columns["contact"] == 0.0] = np.nan
        columns[name] = column
    return columns
