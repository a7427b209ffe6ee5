"""The twin as a stream: a state goes in, sound with its labels and the next state come out."""

from dataclasses import dataclass, replace

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Samples
from monochord.physics.twin.assemble import plucked, sensor_arrays, touch_arrays
from monochord.physics.twin.bank import FORCE, PRESS, RUB, SHAPE, STRETCH, Q, rows
from monochord.physics.twin.memory import (
    ETA,
    FOUND,
    FRESH,
    GATE,
    QUIET,
    SENSOR_MEMORY,
    SETTLED,
    SINCE,
    SPREAD,
    TOUCH_MEMORY,
    Out,
    State,
)
from monochord.physics.twin.memory import Sensor as Fixed
from monochord.physics.twin.rate import Plan, padded, plan
from monochord.physics.twin.setup import Scene, Sensor, Touch


@dataclass(frozen=True, slots=True)
class Labels:
    """What is true at every frame; of each touch, (touches, n), save `settled`, (n,).

    `contact` and `slip` are 0 or 1, `position` in m, `force` the normal force in N averaged over 5 ms
    (which makes it lag), `reaction` the normal force at that instant, with the string's vibration in it,
    `across` and `along` the speed at which the object slides, in m/s, `friction` the state of the contact at
    that instant (0 none, 1 stick, 2 creep, 3 slide), `settled` whether the sound has come to rest since the
    last change of any touch or driver. `slip` is 1 where the place of the contact on the object moves on by
    more than half a millimetre a second; what a ringing string rocks to and fro under an object at rest does
    not count, nor do 25 um of wandering to either side. See `monochord.physics.twin.friction`.
    """

    contact: np.ndarray
    position: np.ndarray
    force: np.ndarray
    reaction: np.ndarray
    slip: np.ndarray
    across: np.ndarray
    along: np.ndarray
    friction: np.ndarray
    settled: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """A stretch of sound, `microphones` (2, n) in full scale, with its labels."""

    microphones: Audio
    labels: Labels


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """A twin at an instant: all that its next frame depends on. Never changed, only succeeded.

    `start` is the index of the next frame; `fixed` and `moving` are the kernel's arrays, with an axis of one
    sensor in front.
    """

    sensor: Sensor
    scene: Scene
    sample_rate: int
    seed: int
    plan: Plan
    start: Samples
    fixed: tuple[np.ndarray, ...]
    moving: tuple[np.ndarray, ...]


def begin(
    sensor: Sensor,
    scene: Scene | None = None,
    *,
    sample_rate: int = 44100,
    seed: int = 0,
    finer: int | None = None,
    agreement: float = 1e-4,
) -> Twin:
    """Return a twin at time zero.

    Parameters
    ----------
    sensor
        As built, see `monochord.physics.sensors.load_sensor`.
    scene
        What happens to it; an untouched string with both drivers on by default.
    sample_rate
        Frames a second, 16 kHz to 192 kHz.
    seed
        Of the converter's noise and the surfaces of objects.
    finer
        Steps a frame; found from the string by `monochord.physics.twin.rate.plan` by default.
    agreement
        How well tension and motion of a step agree, of the stretch sum; what is left goes into the energy.

    Raises
    ------
    InputError
        If the rate or the scene cannot be.
    """
    scene = Scene() if scene is None else scene
    if not 16000 <= sample_rate <= 192000:
        raise InputError(f"sample rate {sample_rate} Hz", "16000 to 192000 Hz")
    if not 0 <= seed < 2**62:
        raise InputError(f"seed {seed}", "0 to 2^62 - 1")
    if not 0.0 < agreement < 1.0:
        raise InputError(f"agreement {agreement:g}", "between 0 and 1")
    found = plan(sensor.string, float(sample_rate), finer=finer)
    fixed = sensor_arrays(sensor, scene, found, float(sample_rate), seed, agreement)
    fixed |= touch_arrays(sensor, scene.touches, found, float(sample_rate))
    size, count = 2 * padded(found.count), len(scene.touches)
    bank = np.concatenate([fixed.pop("bank"), np.zeros((rows(count) - rows(0), size))])
    bank[Q] = plucked(sensor, scene.pluck, found)
    memory = np.zeros(SENSOR_MEMORY)
    memory[FRESH] = 1.0
    memory[SPREAD] = float(bank[STRETCH] @ bank[Q] ** 2)
    asked, ahead = np.zeros((count, 5)), np.zeros((count, 5))
    for t, touch in enumerate(scene.touches):
        _place(touch, 0.0, _reach(bank), asked[t], ahead[t])
    coils = np.zeros((2, 4))
    coils[:, GATE] = fixed["gates"]
    moving = {
        "bank": bank.ravel(),
        "contact": _untouched(count, _reach(bank)),
        "asked": asked,
        "ahead": ahead,
        "coils": coils,
        "band": np.zeros((2, 3)),
        "memory": memory,
        "solved": np.zeros((count, FOUND)),
        "mutual": np.zeros((2, count, count)),
    }
    return Twin(
        sensor=sensor,
        scene=scene,
        sample_rate=sample_rate,
        seed=seed,
        plan=found,
        start=0,
        fixed=_packed(fixed),
        moving=tuple(array[None] for array in moving.values()),
    )


FIXED = (
    "scalars", "integers", "ebows", "pickup", "gates", "sound", "touches", "keys", "counts", "weights",
    "tables",
)  # fmt: skip


MOVING = ("bank", "contact", "asked", "ahead", "coils", "band", "memory", "solved", "mutual")
OUT_OF_REACH = 1e-3
"""Metres above all of the string where a new object waits for the first tick."""


def advance(twin: Twin, frames: Samples) -> tuple[Take, Twin]:
    """Return the next `frames` frames and the twin after them; alike, bit for bit, however they are cut."""
    from monochord.physics.twin.kernel import kernel  # noqa: PLC0415  (numba loads on use)

    refuse_negative(frames)
    moving = tuple(array.copy() for array in twin.moving)
    heard = room(1, len(twin.scene.touches), frames)
    run = kernel(2 * padded(twin.plan.count))
    run(Fixed(*twin.fixed), State(*moving), heard, np.array([twin.start]), 0, 1)
    return taken(heard, 0), replace(twin, start=twin.start + frames, moving=moving)


def refuse_negative(frames: Samples) -> None:
    """Raise `InputError` for fewer frames than none."""
    if frames < 0:
        raise InputError(f"{frames} frames", "0 or more")


def room(sensors: int, touches: int, frames: Samples) -> Out:
    """Return arrays for what the kernel writes."""
    each = (sensors, touches, frames)
    return Out(
        microphones=np.empty((sensors, 2, frames), np.float32),
        contact=np.empty(each, np.uint8),
        position=np.empty(each, np.float32),
        force=np.empty(each, np.float32),
        reaction=np.empty(each, np.float32),
        slip=np.empty(each, np.uint8),
        across=np.empty(each, np.float32),
        along=np.empty(each, np.float32),
        friction=np.empty(each, np.uint8),
        settled=np.empty((sensors, frames), np.uint8),
    )


def taken(heard: Out, i: int) -> Take:
    """Return what the kernel wrote of one sensor."""
    microphones, *labels = (array[i] for array in heard)
    return Take(microphones=microphones, labels=Labels(*labels))


def retouch(twin: Twin, touches: tuple[Touch, ...]) -> Twin:
    """Return the same twin with other motions of its touches from its next frame on.

    Keys' times count from the twin's own time zero. The first touches go on as the objects they were; more
    are new objects, which begin where their motion says, and those left out are gone.
    """
    scene = replace(twin.scene, touches=touches)
    arrays = _named(FIXED, twin.fixed)
    arrays |= touch_arrays(twin.sensor, touches, twin.plan, float(twin.sample_rate))
    moving = _named(MOVING, twin.moving)
    kept, count, size = min(len(touches), len(twin.scene.touches)), len(touches), 2 * padded(twin.plan.count)
    kept_rows = moving["bank"].reshape(-1, size)[: rows(kept)]
    bank = np.concatenate([kept_rows, np.zeros((rows(count) - rows(kept), size))])
    bank[[FORCE, PRESS, RUB]] = 0.0
    if count > 0:
        bank[PRESS, : size // 2] = bank[SHAPE, : size // 2]
        bank[RUB, size // 2 :] = bank[SHAPE, : size // 2]
    moving["bank"] = bank.ravel()
    reach = _reach(bank)
    for name, fresh in (
        ("contact", _untouched(count, reach)),
        ("asked", np.zeros((count, 5))),
        ("ahead", np.zeros((count, 5))),
    ):
        fresh[:kept] = moving[name][:kept]
        moving[name] = fresh
    moving["solved"], moving["mutual"] = np.zeros((count, FOUND)), np.zeros((2, count, count))
    moving["memory"] = moving["memory"].copy()
    moving["memory"][FRESH] = 1.0
    if touches != twin.scene.touches:
        moving["memory"][[QUIET, SETTLED]] = 0.0
    time = twin.start / twin.sample_rate
    for t in range(kept, count):
        _place(touches[t], time, reach, moving["asked"][t], moving["ahead"][t])
    return replace(
        twin,
        scene=scene,
        fixed=_packed(arrays),
        moving=tuple(np.ascontiguousarray(moving[name])[None] for name in MOVING),
    )


def switch(twin: Twin, drivers: tuple[bool, bool]) -> Twin:
    """Return the same twin with its drivers on or off from its next tick on; each goes over in 5 ms."""
    arrays = _named(FIXED, twin.fixed)
    arrays["gates"] = np.array(drivers, dtype=np.float64)
    return replace(twin, scene=replace(twin.scene, drivers=drivers), fixed=_packed(arrays))


def _reach(bank: np.ndarray) -> float:
    """Return a height in m above all that the string can be at."""
    return OUT_OF_REACH + float(np.abs(bank[Q, : bank.shape[1] // 2]).sum())


def _untouched(count: int, reach: float) -> np.ndarray:
    contact = np.zeros((count, TOUCH_MEMORY))
    contact[:, SINCE] = 1.0
    contact[:, ETA] = -reach
    return contact


def _place(touch: Touch, time: float, reach: float, asked: np.ndarray, ahead: np.ndarray) -> None:
    """Put a new object where its motion says, out of reach until the next tick reads how deep it is."""
    times = [key.time for key in touch.motion]
    for column, name in enumerate(("position", "force", "clearance", "across")):
        ahead[column] = np.interp(time, times, [getattr(key, name) for key in touch.motion])
    ahead[4] = -reach
    asked[:] = ahead


def _packed(arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
    return tuple(np.ascontiguousarray(arrays[name])[None] for name in FIXED)


def _named(names: tuple[str, ...], arrays: tuple[np.ndarray, ...]) -> dict[str, np.ndarray]:
    """Return the arrays of one twin by their names."""
    return {name: array[0] for name, array in zip(names, arrays, strict=True)}
