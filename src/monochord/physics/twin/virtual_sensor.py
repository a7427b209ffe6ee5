"""A virtual sensor that is touched step by step: press, slide, release, and take the sound."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike

from monochord.core.errors import InputError
from monochord.core.lengths import metres_meant
from monochord.core.notebook import lines
from monochord.core.ranges import Finite, Positive, Seed, checked
from monochord.core.shapes import numbers
from monochord.core.types import Audio, Floats
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import as_sensor
from monochord.physics.setup import MAX_TOUCHES, Key, Material, Pluck, Scene, Sensor, Touch
from monochord.physics.theory import open_frequency
from monochord.physics.twin.ends import lengthened, reach
from monochord.physics.twin.stream import (
    KEY_COLUMNS,
    Labels,
    Twin,
    advance,
    advance_many,
    begin,
    led,
    retouch,
    switch,
)
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
TIME, POSITION, FORCE, HEIGHT, ACROSS = range(5)
"""Columns of a motion: s, m from pickup 1, N, m above the string at rest, m/s across it."""
LED = KEY_COLUMNS[1:]
MAX_FORCE: Newtons = 10.0
MAX_CLEARANCE: Metres = 0.1
MAX_ACROSS: MetresPerSecond = 0.5
MAX_ALONG: MetresPerSecond = 5.0
"""What an object may do; see `Key` and `Touch`."""
Force: TypeAlias = Annotated[Newtons, Meta(ge=0.0, le=MAX_FORCE)]
Across: TypeAlias = Annotated[MetresPerSecond, Meta(ge=-MAX_ACROSS, le=MAX_ACROSS)]
Along: TypeAlias = Annotated[MetresPerSecond, Meta(ge=-MAX_ALONG, le=MAX_ALONG)]


class Snapshot(NamedTuple):
    """A virtual sensor at an instant, as `VirtualSensor.restore` takes it."""

    twin: Twin
    objects: tuple[Touch, ...]
    motions: tuple[Floats, ...]
    slots: int
    last: int
    new: bool
    behind: float


class VirtualSensor:
    """The twin as an object with a state: a simulated sensor that a program touches as it goes.

    Time runs only in `advance`. What is asked of an object begins at the present time and takes effect in
    the sound that is taken after it; an approach lasts 60 ms and a press 50 ms. A slide leaves alone how the
    force goes on, and a change how the object moves; a release ends both. All sound is simulated.

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
    objects
        Materials of objects that are there from the beginning, 3 mm above the middle of the string, for
        `lead`: names of presets or TOML files.

    Attributes
    ----------
    design, sensor
        The sensor as designed, and this build of it; `sensor.measured_length` is what a ruler says, None
        where nobody measured.

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
        objects: Sequence[str | Path] = (),
    ) -> None:
        design = as_sensor(sensor)
        self.design, self.sensor = design, sensor_of(design, world, build=build, day=day)
        self.world: World = world
        self._seed, self.build = seed, build
        self._ends = reach(lengthened(self.sensor))
        length = self.sensor.string.length
        pluck = Pluck(position=0.2 * length, height=PLUCK * length)
        self._objects: list[Touch] = []
        self._motions: list[Floats] = []
        self._changed = self._new = False
        self._slots, self._last, self._behind = len(objects), -1, 0.0
        for material in objects:
            self._bring(load_material(material), np.array([[0.0, 0.5 * length, 0.0, CLEARANCE, 0.0]]))
        scene = Scene(pluck=pluck, touches=tuple(self._objects))
        self._twin, self._new = begin(self.sensor, scene, sample_rate=sample_rate, seed=seed), False

    @property
    def time(self) -> Seconds:
        """Time since the start, in s."""
        return self._twin.start / self._twin.sample_rate

    @property
    def sample_rate(self) -> int:
        """Frames a second."""
        return self._twin.sample_rate

    def __repr__(self) -> str:
        string, rows = self.sensor.string, self._pressed()
        pressed = [f"{1e3 * x:.1f} mm with {force:.2f} N" for _, x, force, *_ in rows if force > 0.0]
        return lines(
            f"VirtualSensor: {self.design.name}, simulated, after {self.time:.2f} s",
            [
                ("world", self.world),
                ("string", f"{1e3 * string.length:.1f} mm, {open_frequency(string):.1f} Hz"),
                ("touch", ", ".join(pressed) or "none"),
                ("sound", f"2 microphones at {self.sample_rate} Hz"),
            ],
        )

    @checked
    def press(
        self,
        position: Finite[Metres],
        force: Force,
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
            The object's number, which `slide`, `change` and `release` take. Once all objects are up, numbers
            begin at the first again. A ninth object gets the number of one that has been lifted.

        Raises
        ------
        InputError
            For a position off the string, a force out of range, an unknown material, or a ninth object
            while eight are down.
        """
        down = self.time + CLEARANCE / APPROACH
        motion = np.array([
            [self.time, position, 0.0, CLEARANCE, 0.0],
            [down, position, 0.0, 0.0, 0.0],
            [down + PRESS, position, force, 0.0, 0.0],
        ])  # fmt: skip
        return self._bring(load_material(material), motion, radius=radius, rolls=rolls)

    @checked
    def change(self, force: Force, *, touch: int = -1) -> None:
        """Change the force of an object that presses, within 50 ms; the last object by default."""
        now = self._now(touch)
        pressed = [now[TIME] + PRESS, now[POSITION], force, 0.0, 0.0]
        self._continue(touch, [now, pressed], keep=(POSITION, ACROSS))

    @checked
    def slide(
        self,
        seconds: Annotated[Seconds, Meta(ge=2.0 * ACCELERATION, le=MAX_SECONDS)],
        *,
        across: Across = 0.0,
        along: Along = 0.0,
        touch: int = -1,
    ) -> None:
        """Move an object; the last one by default.

        Parameters
        ----------
        seconds
            How long it moves, 0.05 s or more.
        across, along
            Speed across the string, up to 0.5 m/s, and along it towards pickup 2, up to 5; either sign.
        touch
            Number of the object.

        Raises
        ------
        InputError
            For too short or too fast a motion, or one that leaves the string.
        """
        now = self._now(touch)
        time, begin, force, height, _ = now
        end = begin + along * seconds
        self._refuse_off_string(end, self._objects[self._number(touch)])
        way = ACCELERATION / seconds * (end - begin)
        keys = [
            now,
            [time + ACCELERATION, begin + way, force, height, across],
            [time + seconds - ACCELERATION, end - way, force, height, across],
            [time + seconds, end, force, height, 0.0],
        ]
        self._continue(touch, keys, keep=(FORCE, HEIGHT))

    @checked
    def release(self, touch: int | None = None) -> None:
        """Lift an object off the string, or all of them."""
        for number in range(len(self._motions)) if touch is None else [touch]:
            now = self._now(number)
            time, place, _, height, _ = now
            free, gone = time + PRESS, time + PRESS + CLEARANCE / APPROACH
            keys = [[free, place, 0.0, 0.0, 0.0], [gone, place, 0.0, CLEARANCE, 0.0]]
            self._continue(number, [now, *keys[1 if height > 0.0 else 0 :]])

    @checked
    def lead(
        self,
        step: Annotated[Seconds, Meta(gt=0.0, le=MAX_SECONDS)],
        *,
        position: ArrayLike,
        force: ArrayLike = 0.0,
        clearance: ArrayLike = 0.0,
        across: ArrayLike = 0.0,
    ) -> None:
        """Lead the objects of `objects` from now on, as a physics simulation does after its steps.

        Every value is for the end of each of k steps, (objects, k), or broadcasts to it; between them all run
        linearly, from where each object is now; one that was not led before comes down from 3 mm above its
        first place. After the last step it keeps its last values, so call it before each `advance` with what
        has been simulated. The twin reads motions every 32 of its steps, at most 0.8 ms, for the time until
        it reads them again.

        Parameters
        ----------
        step
            Duration of a step in s.
        position
            From pickup 1, in m.
        force
            Normal force in N, 0 to 10.
        clearance
            Distance of an object that does not touch from the string at rest, in m, up to 0.1. An object that
            is 3 mm off and touches a step of 1 ms later strikes the string at 3 m/s.
        across
            Speed across the string in m/s, 0.5 at most.

        Raises
        ------
        InputError
            For values out of range, or of a shape that is not that of the objects.

        Examples
        --------
        >>> twin = VirtualSensor("prototype", objects=["plastic"])
        >>> twin.lead(1e-3, position=0.08, force=np.linspace(0.0, 1.0, 100), clearance=0.0)
        >>> round(float(twin.advance(0.1)[1]["position"][-1]), 3)
        0.08
        """
        lead_together([self], step, [(position, force, clearance, across)])

    def _led(self, step: Seconds, *values: ArrayLike) -> Floats:
        """Return the motions, (objects, k + 1, columns), that `lead` asks for from now on."""
        rows = self._asked(*values)
        motion = np.empty((self._slots, rows.shape[2] + 1, 5))
        motion[:, 0] = [self._now(number) for number in range(self._slots)]
        motion[:, 1:, TIME] = self.time + step * np.arange(1, rows.shape[2] + 1)
        motion[:, 1:, POSITION:] = rows.transpose(1, 2, 0)
        off = motion[:, :-1, HEIGHT] > 0.0
        new = np.array([len(self._motions[number]) == 1 for number in range(self._slots)])
        motion[new, 0, POSITION] = motion[new, 1, POSITION]  # it has been nowhere yet
        fastest = np.abs(np.diff(motion[:, :, POSITION]))[~off].max(initial=0.0) / step
        if fastest > MAX_ALONG:
            given = f"an object that moves at {fastest:.3g} m/s along the string"
            raise InputError(given, f"{MAX_ALONG:g} m/s at most")
        return motion

    def snapshot(self) -> Snapshot:
        """Return the present state of the string, of its objects and of the electronics, for `restore`."""
        objects, motions = tuple(self._objects), tuple(self._motions)
        return Snapshot(self._twin, objects, motions, self._slots, self._last, self._new, self._behind)

    @checked
    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of this sensor, or on to one of another sensor of the same design and build.

        The sound that follows is the same to the last bit, but for objects yet to come, whose mounts and
        surfaces this sensor's own seed draws. Raises `InputError` for a snapshot of another build.
        """
        if snapshot.twin.sensor != self.sensor or snapshot.twin.sample_rate != self.sample_rate:
            raise InputError("a snapshot of another sensor", "one of the same design, build, day and rate")
        self._twin, objects, motions, self._slots, self._last, self._new, self._behind = snapshot
        self._objects, self._motions, self._changed = list(objects), list(motions), True

    def __copy__(self) -> "VirtualSensor":
        """Return a sensor of its own at the same instant, which gives the same sound."""
        copy = object.__new__(VirtualSensor)
        vars(copy).update(vars(self))
        copy.restore(self.snapshot())
        return copy

    @checked
    def drive(self, first: bool, second: bool) -> None:  # noqa: FBT001
        """Switch the two drivers on or off; each goes over in 5 ms."""
        self._twin = switch(self._twin, (first, second))

    @checked
    def advance(
        self, seconds: Annotated[Seconds, Meta(ge=0.0, le=MAX_SECONDS)]
    ) -> tuple[Audio, dict[str, Floats]]:
        """Advance time, and return the sound and its ground truth.

        A share of a frame that is left over is made up for by the next call, so that steps of 1 ms keep time.

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
        take, self._twin = advance(self._moved(), self._frames(seconds))
        return take.microphones, _columns(take.labels)

    def _frames(self, seconds: Seconds) -> int:
        """Return the frames of the next advance, and keep the rest of one for that after it."""
        asked = round(seconds * self.sample_rate + self._behind, 6)
        frames = math.floor(asked + 0.5)
        self._behind = asked - frames
        return frames

    def _moved(self) -> Twin:
        """Return the twin with what was asked of its objects since it last advanced."""
        if self._new:
            moved = zip(self._objects, self._motions, strict=True)
            self._twin = retouch(self._twin, tuple(replace(each, motion=_keys(rows)) for each, rows in moved))
        elif self._changed:
            self._twin = led(self._twin, self._motions)
        self._changed = self._new = False
        return self._twin

    def _refuse_off_string(self, position: Metres, touch: Touch) -> None:
        half = 0.5 * touch.law.width
        low, high = self._ends[0] + half, self._ends[1] - half
        if not low <= position <= high:
            raise InputError(f"a touch at {position:g} m", f"{low:g} to {high:g} m", metres_meant(position))

    def _pressed(self) -> list[Floats]:
        """Return where each object's motion has brought it by now."""
        return [self._now(number) for number in range(len(self._motions))]

    def _now(self, touch: int) -> Floats:
        """Return the row of an object's motion at the present time."""
        try:
            motion = self._motions[self._number(touch)]
        except IndexError:
            given, allowed = f"object {touch}", f"one of {len(self._motions)} objects"
            raise InputError(given, allowed, "press first") from None
        time = self.time
        if time >= motion[-1, TIME]:
            return np.array([time, *motion[-1, POSITION:]])
        return np.array([time, *(np.interp(time, motion[:, TIME], column) for column in motion.T[1:])])

    def _number(self, touch: int) -> int:
        """Return the number of an object; -1 is the one that came last."""
        return self._last if touch == -1 else touch

    def _bring(
        self, material: Material, motion: Floats, *, radius: Metres | None = None, rolls: bool = False
    ) -> int:
        """Add an object, or put it in the place of one that is up, and return its number."""
        drawn = Touch(material=material, motion=_keys(motion), radius=radius, rolls=rolls)
        touch = plausible_touch(drawn, self._seed, world=self.world)
        self._refuse_off_string(float(motion[0, POSITION]), touch)
        pressed = range(self._slots, len(self._objects))
        last = {number: self._motions[number][-1] for number in pressed}
        up = [number for number, row in last.items() if row[HEIGHT] > 0.0 and self.time >= row[TIME]]
        if len(up) == len(pressed):
            del self._objects[self._slots :], self._motions[self._slots :]  # all are gone
        number = len(self._objects)
        if number == MAX_TOUCHES:
            if not up:
                raise InputError(f"object {number + 1}", f"{number} at once", "release one, and advance")
            number = up[0]
        self._objects[number : number + 1] = [touch]
        self._motions[number : number + 1] = [motion]
        self._last, self._new = number, True
        return number

    def _continue(
        self, touch: int, keys: Floats | Sequence[Floats | Sequence[float]], keep: Sequence[int] = ()
    ) -> None:
        """Have an object go on by these keys, the first of which is now, whatever it was about to do.

        The columns `keep` alone go on as before.
        """
        touch, wanted = self._number(touch), np.array(keys)
        motion = self._motions[touch]
        if keep:
            time = np.union1d(wanted[:, TIME], motion[motion[:, TIME] > self.time, TIME])
            columns = [time]
            for column in (POSITION, FORCE, HEIGHT, ACROSS):
                source = motion if column in keep else wanted
                columns.append(np.interp(time, source[:, TIME], source[:, column]))
            wanted = np.stack(columns, axis=1)
        past = motion[motion[:, TIME] < self.time]
        self._motions[touch] = np.vstack((past[-1:], wanted))
        self._changed = True

    def _asked(self, *values: ArrayLike) -> Floats:
        """Return position, force, clearance and speed across, (4, objects, k), or refuse them."""
        if not self._slots:
            raise InputError("lead without objects", 'VirtualSensor(..., objects=["plastic"])')
        arrays = [numbers(value, float, name) for name, value in zip(LED, values, strict=True)]
        try:
            size = np.broadcast(np.empty((self._slots, 1)), *arrays).shape
        except ValueError:
            size = ()
        if len(size) != 2 or size[0] != self._slots or not size[1]:
            shapes = ", ".join(str(array.shape) for array in arrays)
            raise InputError(f"arrays {shapes}", f"({self._slots}, k), k steps of {self._slots} object(s)")
        rows = np.empty((len(arrays), *size))
        for row, array in zip(rows, arrays, strict=True):
            row[:] = array
        half = 0.5 * max(touch.law.width for touch in self._objects[: self._slots])
        first, last = self._ends[0] + half, self._ends[1] - half
        low = np.array([first, 0.0, 0.0, -MAX_ACROSS]).reshape(-1, 1, 1)
        high = np.array([last, MAX_FORCE, MAX_CLEARANCE, MAX_ACROSS]).reshape(-1, 1, 1)
        allowed = (rows >= low) & (rows <= high)
        if not allowed.all():
            wrong = np.argwhere(~allowed)[0]
            name, value = LED[wrong[0]], float(rows[tuple(wrong)])
            expected = f"{low[wrong[0]].item():g} to {high[wrong[0]].item():g}"
            raise InputError(f"{name} {value:g}", expected, metres_meant(value) if name == "position" else "")
        return rows


def lead_together(
    sensors: Sequence[VirtualSensor], step: Seconds, values: Sequence[Sequence[ArrayLike]]
) -> None:
    """Lead the objects of all sensors, each by values in the order of `VirtualSensor.lead`, or of none."""
    motions = [each._led(step, *own) for each, own in zip(sensors, values, strict=True)]  # noqa: SLF001
    for each, led_by in zip(sensors, motions, strict=True):
        for number, motion in enumerate(led_by):
            each._continue(number, motion)  # noqa: SLF001


def advance_together(
    sensors: Sequence[VirtualSensor], seconds: Seconds, cores: int | None = None
) -> list[tuple[Audio, dict[str, Floats]]]:
    """Advance the time of sensors of one rate side by side; each gives what its `advance` returns."""
    frames = sensors[0]._frames(seconds)  # noqa: SLF001
    done = advance_many([each._moved() for each in sensors], frames, cores=cores)  # noqa: SLF001
    for each, (_, twin) in zip(sensors, done, strict=True):
        each._twin = twin  # noqa: SLF001
    return [(take.microphones, _columns(take.labels)) for take, _ in done]


def _keys(motion: Floats) -> tuple[Key, ...]:
    """Return the rows of a motion as keys."""
    return tuple(Key(**dict(zip(KEY_COLUMNS, row, strict=True))) for row in motion.tolist())


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
    columns["contacts"] = touched.sum(axis=0).astype(np.float64)
    columns["contact"] = np.minimum(columns["contacts"], 1.0)
    away = columns["contact"] == 0.0
    hardest = np.argmax(np.where(touched, labels.force, -1.0), axis=0) if len(touched) > 1 else 0
    chosen: Any = (hardest, np.arange(count)) if len(touched) > 1 else hardest
    for name, values in known.items():
        columns[name] = values[chosen].astype(np.float64)
        columns[name][away] = np.nan
    return columns
