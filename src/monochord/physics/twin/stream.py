"""The twin as a stream: a twin goes in, its next frames with labels and the twin after them come out.

Also how a sensor and a scene, in the field's terms, become the records and arrays that the kernel runs on,
and how several twins run side by side.
"""

import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from math import cos, pi, sin, tan
from typing import Any, TypeVar

import numpy as np

from monochord.core.cores import available_cores
from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, StringParams
from monochord.core.units import Hertz, Metres, Samples
from monochord.physics.setup import (
    Ebow,
    Pluck,
    Scene,
    Sensor,
    Touch,
)
from monochord.physics.theory import (
    bending_stiffness,
    decay_rates,
    mindlin_ratio,
    mutual_compliance,
    static_compliance,
    stretch_stiffness,
)
from monochord.physics.twin.ends import end_shifts, lengthened, offset_of, reach
from monochord.physics.twin.plausible import plausible_of
from monochord.physics.twin.rate import RatePlan, mode_frequencies, padded, plan, touch_weights
from monochord.physics.twin.records import (
    DECAY,
    DRIVE_1,
    END_1,
    END_2,
    FORCE,
    FRAME,
    NORMAL,
    OMEGA2_BENDING,
    OMEGA2_TENSION,
    SENSE_1,
    SHAPE,
    STRETCH,
    TABLE_PLACES,
    TANGENTIAL,
    Constants,
    ContactSolution,
    ContactState,
    DriverParameters,
    DriverState,
    KeyRecord,
    Motion,
    Out,
    Parameters,
    PickupParameters,
    Plausible,
    PreampState,
    Q,
    Records,
    SensorState,
    State,
    TouchParameters,
    dtype_of,
    record_of,
    rows,
)
from monochord.physics.twin.surface import edges_of, surface_of

WIDTH_MODES = 400
"""Modes that a touch's compliance is corrected by for its width."""
EDGE_POWERS = (1.0, 0.8, 0.6, 0.4, 0.2)
"""How exact the modes' weights at two edges are tried to be, as powers of those at a point."""
CLEARANCE_OF_NEW: Metres = 1e-3
"""Distance from all of the string at which a new object waits for the first control update."""
KEY_COLUMNS = ("time", "position", "force", "clearance", "across")
"""Columns of a motion as an array."""
SHARES_A_CORE = 4
"""Parts into which each core's share of many twins is cut, so that none waits long for another."""

Named = TypeVar("Named", Parameters, State, Plausible)


@dataclass(frozen=True, slots=True)
class Labels:
    """The true state at every frame: for each touch, (touches, n), save `settled`, (n,).

    `contact` and `slip` are 0 or 1, `position` in m, `force` the normal force in N averaged over 5 ms (which
    makes it lag), `reaction` the normal force at that instant, with the string's vibration in it, `across`
    and `along` the speed at which the object slides, in m/s, `friction` the state of the contact at that
    instant (0 none, 1 stick, 2 creep, 3 slide), `settled` whether the sound has become steady since the last
    change of any touch or driver. `slip` is 1 where the place of the contact on the object moves by more than
    half a millimetre a second; the rocking of a ringing string under an object at rest does not count, nor
    does wandering by 25 um to either side. See `monochord.physics.twin.friction`.
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
    """Some frames of sound, `microphones` (2, n) in full scale, with their labels."""

    microphones: Audio
    labels: Labels


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """A twin at an instant: all that its next frame depends on. Never changed; `advance` returns another.

    `start` is the index of the next frame; `parameters`, `state` and `plausible`, which is None for an ideal
    twin, are the kernel's, as a batch of one sensor.
    """

    sensor: Sensor
    scene: Scene
    sample_rate: int
    seed: int
    plan: RatePlan
    start: Samples
    parameters: Parameters
    state: State
    plausible: Plausible | None = None


def begin(
    sensor: Sensor,
    scene: Scene | None = None,
    *,
    sample_rate: int = 44100,
    seed: int = 0,
    oversampling: int | None = None,
    tolerance: float = 1e-4,
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
        Random seed of the converter's noise and of the objects' surfaces.
    oversampling
        Steps a frame; chosen for the string by `monochord.physics.twin.rate.plan` by default.
    tolerance
        Relative error of the stretch sum at which a step's iteration ends; the error enters the energy.

    Raises
    ------
    InputError
        If the rate, the seed or the scene is out of range.
    """
    scene = Scene() if scene is None else scene
    if not 16000 <= sample_rate <= 192000:
        raise InputError(f"sample rate {sample_rate} Hz", "16000 to 192000 Hz")
    if not 0 <= seed < 2**62:
        raise InputError(f"seed {seed}", "0 to 2^62 - 1")
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"tolerance {tolerance:g}", "between 0 and 1")
    longer, rate = lengthened(sensor), float(sample_rate)
    chosen = plan(longer.string, rate, oversampling=oversampling)
    count = len(scene.touches)
    bank = np.zeros((rows(count), 2 * padded(chosen.count)))
    bank[: rows(0)] = _bank(longer, chosen, 1.0 / (rate * chosen.oversampling))
    bank[Q] = _plucked(longer, scene.pluck, chosen)
    memory = np.zeros((), dtype_of(SensorState))
    memory["touches_changed"] = 1.0
    memory["stretch"] = float(bank[STRETCH] @ bank[Q] ** 2)
    parameters = Parameters(
        constants=_constants(longer, scene, chosen, rate, seed, tolerance),
        drivers=_drivers(sensor, scene, 1.0 / (rate * chosen.oversampling)),
        pickup=_pickup(sensor, rate),
        sound=_outside(scene),
        **_touches(longer, scene.touches, chosen, rate),
    )
    drivers = np.zeros(2, dtype_of(DriverState))
    drivers["gate"] = parameters.drivers["on"]
    contact, motion = _new_contacts(longer, scene.touches, 0.0, bank)
    state = State(
        bank=bank.ravel(),
        contact=contact,
        motion=motion,
        ahead=motion.copy(),
        drivers=drivers,
        preamps=np.zeros(2, dtype_of(PreampState)),
        memory=memory,
        solution=np.zeros(count, dtype_of(ContactSolution)),
        mutual=np.zeros((2, count, count)),
    )
    return Twin(
        sensor=sensor,
        scene=scene,
        sample_rate=sample_rate,
        seed=seed,
        plan=chosen,
        start=0,
        parameters=_batched(parameters),
        state=_batched(state),
        plausible=_plausible(longer, scene.touches, chosen, rate, parameters.weights, bank),
    )


def advance(twin: Twin, frames: Samples) -> tuple[Take, Twin]:
    """Return the next `frames` frames and the twin after them; the same bits however the frames are cut."""
    from monochord.physics.twin.kernel import kernel  # noqa: PLC0415  (numba loads on use)

    _refuse_negative(frames)
    state = State(*(array.copy() for array in twin.state))
    out = empty_out(1, len(twin.scene.touches), frames)
    more = None if twin.plausible is None else Plausible(*(array.copy() for array in twin.plausible))
    kernel(2 * padded(twin.plan.count))(twin.parameters, state, more, out, np.array([twin.start]), 0, 1)
    return take_of(out, 0), replace(twin, start=twin.start + frames, state=state, plausible=more)


def advance_many(
    twins: Sequence[Twin], frames: Samples, *, cores: int | None = None
) -> list[tuple[Take, Twin]]:
    """Return the next `frames` frames of every twin, and the twins after them, in the order given.

    Each is what `advance` returns, bit for bit. Twins of one shape (as many modes and touches, an outside
    sound of the same length, one world) run side by side, one a core; others run after them. The kernel
    releases Python's lock, so that plain threads do.

    Parameters
    ----------
    twins
        At any instants; none is changed.
    frames
        How many frames each advances.
    cores
        How many cores to use; by default all that this process may use.

    Examples
    --------
    >>> from monochord.physics.sensors import load_sensor
    >>> from monochord.physics.twin import Pluck, Scene, begin
    >>> scene = Scene(pluck=Pluck(position=0.07, height=1e-4))
    >>> several = [begin(load_sensor("prototype"), scene, seed=seed) for seed in range(3)]
    >>> [take.microphones.shape for take, _ in advance_many(several, 10)]
    [(2, 10), (2, 10), (2, 10)]
    """
    _refuse_negative(frames)
    shapes: dict[object, list[int]] = {}
    for i, twin in enumerate(twins):
        # Keys may differ in number: they are padded.
        fixed = tuple(array.shape for array in twin.parameters._replace(keys=np.zeros(0)))
        shapes.setdefault((padded(twin.plan.count), fixed, twin.plausible is None), []).append(i)
    done: dict[int, tuple[Take, Twin]] = {}
    for group in shapes.values():
        done |= zip(group, _side_by_side([twins[i] for i in group], frames, cores), strict=True)
    return [done[i] for i in range(len(twins))]


def _side_by_side(twins: Sequence[Twin], frames: Samples, cores: int | None) -> list[tuple[Take, Twin]]:
    from monochord.physics.twin.kernel import kernel  # noqa: PLC0415  (numba loads on use)

    keys = _padded([twin.parameters.keys for twin in twins])
    each = [twin.parameters._replace(keys=own) for twin, own in zip(twins, keys, strict=True)]
    parameters = Parameters(*map(_stacked, zip(*each, strict=True)))
    state = State(*(_stacked(arrays) for arrays in zip(*(twin.state for twin in twins), strict=True)))
    additions = [twin.plausible for twin in twins if twin.plausible is not None]
    more = Plausible(*(_stacked(arrays) for arrays in zip(*additions, strict=True))) if additions else None
    out = empty_out(len(twins), len(twins[0].scene.touches), frames)
    run = kernel(2 * padded(twins[0].plan.count))
    arguments = parameters, state, more, out, np.array([twin.start for twin in twins])
    cores = cores or available_cores()
    edges = np.linspace(0, len(twins), min(len(twins), SHARES_A_CORE * cores) + 1).astype(int)
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(lambda pair: run(*arguments, *pair), itertools.pairwise(edges)))
    return [
        (
            take_of(out, i),
            replace(
                twin,
                start=twin.start + frames,
                state=State(*(a[i : i + 1] for a in state)),
                plausible=None if more is None else Plausible(*(a[i : i + 1] for a in more)),
            ),
        )
        for i, twin in enumerate(twins)
    ]


def retouch(twin: Twin, touches: tuple[Touch, ...]) -> Twin:
    """Return the same twin with other motions of its touches from its next frame on.

    The keys' times count from the twin's own time zero. The first touches continue as the objects they were;
    further ones are new objects, which begin where their motion says, and missing ones are gone.
    """
    longer, rate = lengthened(twin.sensor), float(twin.sample_rate)
    parameters = _single(twin.parameters)._replace(**_touches(longer, touches, twin.plan, rate))
    state = _single(twin.state)
    count, size = len(touches), 2 * padded(twin.plan.count)
    continued = min(count, len(twin.scene.touches))
    bank = np.zeros((rows(count), size))
    bank[: rows(continued)] = state.bank.reshape(-1, size)[: rows(continued)]
    bank[[FORCE, NORMAL, TANGENTIAL]] = 0.0
    if count > 0:
        bank[NORMAL, : size // 2] = bank[SHAPE, : size // 2]
        bank[TANGENTIAL, size // 2 :] = bank[SHAPE, : size // 2]
    contact, motion = _new_contacts(longer, touches, twin.start / twin.sample_rate, bank)
    ahead = motion.copy()
    contact[:continued], motion[:continued], ahead[:continued] = (
        state.contact[:continued],
        state.motion[:continued],
        state.ahead[:continued],
    )
    memory = state.memory.copy()
    memory["touches_changed"] = 1.0
    if touches != twin.scene.touches:
        memory["steady_time"], memory["settled"] = 0.0, 0.0
    state = state._replace(
        bank=bank.ravel(),
        contact=contact,
        motion=motion,
        ahead=ahead,
        memory=memory,
        solution=np.zeros(count, dtype_of(ContactSolution)),
        mutual=np.zeros((2, count, count)),
    )
    plausible = _plausible(longer, touches, twin.plan, rate, parameters.weights, bank)
    if plausible is not None and twin.plausible is not None:
        for name in ("q", "v"):
            plausible.mount_modes[name][0, :continued] = twin.plausible.mount_modes[name][0, :continued]
        for name in ("stiffness", "deflection", "slope"):
            plausible.turnings[name][0, :continued] = twin.plausible.turnings[name][0, :continued]
        plausible.slopes[0, :continued] = twin.plausible.slopes[0, :continued]
        for name in ("place", "place_before", "drive"):
            plausible.coils[name] = twin.plausible.coils[name]
    scene = replace(twin.scene, touches=touches)
    return replace(
        twin, scene=scene, parameters=_batched(parameters), state=_batched(state), plausible=plausible
    )


def led(twin: Twin, motions: Sequence[Floats]) -> Twin:
    """Return the same twin whose touches go on by other keys, from its next control update on.

    Unlike `retouch` it makes no object and forgets nothing of a contact: it costs microseconds. The twin's
    `scene` keeps the motions with which its objects came. A motion (keys, 5) has the columns `KEY_COLUMNS` at
    rising times, in SI units, which nothing checks here.
    """
    counts = [len(motion) for motion in motions]
    keys = np.zeros((1, len(motions), max(counts, default=1)), dtype_of(KeyRecord))
    offset = offset_of(twin.sensor)
    for record, motion in zip(keys[0], motions, strict=True):
        for name, column in zip(KEY_COLUMNS, motion.T, strict=True):
            record[name][: len(motion)] = column
        record["position"][: len(motion)] += offset
    touches = twin.parameters.touches.copy()
    touches["keys"][0] = counts
    return replace(twin, parameters=twin.parameters._replace(keys=keys, touches=touches))


def switch(twin: Twin, drivers: tuple[bool, bool]) -> Twin:
    """Return the same twin with its drivers on or off from its next control update on; each takes 5 ms."""
    records = twin.parameters.drivers.copy()
    records["on"] = drivers
    scene = replace(twin.scene, drivers=drivers)
    return replace(twin, scene=scene, parameters=twin.parameters._replace(drivers=records))


def empty_out(sensors: int, touches: int, frames: Samples) -> Out:
    """Return uninitialised arrays for what the kernel writes."""
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


def take_of(out: Out, i: int) -> Take:
    """Return what the kernel wrote of one sensor."""
    microphones, *labels = (array[i] for array in out)
    return Take(microphones=microphones, labels=Labels(*labels))


def _batched(named: Named) -> Named:
    arrays: list[Any] = [np.ascontiguousarray(array).reshape(1, *array.shape) for array in named]
    return type(named)(*arrays)


def _single(named: Named) -> Named:
    singles: list[Any] = [array[0] for array in named]
    return type(named)(*singles)


def _stacked(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Return batches of one as one batch; of records `np.concatenate` would make plain tuples."""
    if arrays[0].dtype.names is None:
        return np.concatenate(arrays)
    stacked = np.empty((len(arrays), *arrays[0].shape[1:]), arrays[0].dtype)
    for i, array in enumerate(arrays):
        stacked[i] = array[0]
    return stacked


def _padded(arrays: Sequence[Records]) -> list[Records]:
    """Return arrays (1, touches, n) as long as the longest of them, with zeros at the end."""
    longest = max(array.shape[2] for array in arrays)
    missing = [longest - array.shape[2] for array in arrays]
    return [
        np.pad(array, ((0, 0), (0, 0), (0, each))) if each else array
        for array, each in zip(arrays, missing, strict=True)
    ]


def _plausible(
    sensor: Sensor, touches: tuple[Touch, ...], chosen: RatePlan, rate: Hertz, weights: Floats, bank: Floats
) -> Plausible | None:
    """Return what the world `plausible` adds, as a batch of one sensor; None if it is nothing."""
    step = 1.0 / (rate * chosen.oversampling)
    exact = np.zeros(padded(chosen.count))
    exact[: chosen.count] = _exact(sensor.string, chosen, step)
    single = plausible_of(sensor, touches, rate=rate, step=step, bank=bank, weights=weights, exact=exact)
    return None if single is None else _batched(single)


def _refuse_negative(frames: Samples) -> None:
    if frames < 0:
        raise InputError(f"{frames} frames", "0 or more")


def _bank(sensor: Sensor, chosen: RatePlan, step: float) -> Floats:
    """Return the rows of the bank that belong to the string, its modes at rest."""
    string, half, count = sensor.string, padded(chosen.count), chosen.count
    omega = mode_frequencies(string, count)
    n = np.arange(1, count + 1)
    wave = n * pi / string.length
    turn = omega * step
    sigma = decay_rates(string, sensor.losses, omega / (2.0 * pi))
    if (sigma >= 0.9 * omega).any():
        raise InputError(f"sensor {sensor.name}: losses", "modes that oscillate", "lower the loss factors")
    bank = np.zeros((rows(0), 2 * half))
    for first, share in ((0, cos), (half, sin)):
        modes = slice(first, first + count)
        bank[OMEGA2_TENSION, modes] = wave**2 / string.linear_density
        bank[OMEGA2_BENDING, modes] = bending_stiffness(string) * wave**4 / string.linear_density
        bank[DECAY, modes] = sigma
        bank[STRETCH, modes] = n**2 * np.minimum(turn / np.sin(turn), 1.0 / np.sin(0.5 * turn) ** 2)
        for d, driver in enumerate(sensor.drivers):
            blur = np.exp(-0.5 * (wave * driver.aperture) ** 2) * share(driver.angle)
            bank[DRIVE_1 + d, modes] = np.sin(wave * driver.drive) * blur
            bank[SENSE_1 + d, modes] = np.sin(wave * driver.sense) * blur
        end = (string.tension + bending_stiffness(string) * wave**2) * wave * share(sensor.pickups.angle)
        bank[END_1, modes] = end
        bank[END_2, modes] = -end * np.cos(n * pi)
    bank[FRAME, :count] = -string.linear_density * (1.0 - np.cos(n * pi)) / wave
    shift = sum(end_shifts(string, end, omega) for end in sensor.ends)
    for modes in (slice(count), slice(half, half + count)):
        bank[OMEGA2_BENDING, modes] += 2.0 * omega * np.real(shift)
        bank[DECAY, modes] += np.imag(shift)
    return bank


def _constants(
    sensor: Sensor, scene: Scene, chosen: RatePlan, rate: Hertz, seed: int, tolerance: float
) -> Records:
    string, linear, axial = sensor.string, scene.tension_law == "linear", stretch_stiffness(sensor.string)
    return record_of(
        Constants,
        step=1.0 / (rate * chosen.oversampling),
        length=string.length,
        tension=string.tension,
        mass=0.5 * string.linear_density * string.length,
        tension_gain=pi**2 / (4.0 * string.length),
        tension_per_stretch=0.0 if linear else axial * pi**2 / (4.0 * string.length**2),
        axial_stiffness=axial,
        tension_per_force=string.tension_per_force,
        drift=sensor.drift,
        drift_rate=sensor.drift_rate,
        frame_acceleration=sensor.shake,
        stretch_tolerance=tolerance,
        oversampling=chosen.oversampling,
        seed=seed,
        linear_law=int(linear),
    )


def _drivers(sensor: Sensor, scene: Scene, step: float) -> Records:
    drivers = np.zeros(2, dtype_of(DriverParameters))
    for d, driver in enumerate(sensor.drivers):
        drivers[d] = _driver(driver, step, on=scene.drivers[d])
    return drivers


def _driver(driver: Ebow, step: float, *, on: bool) -> Records:
    g, k = tan(pi * min(driver.centre * step, 0.45)), 1.0 / driver.quality
    gain = driver.gain / driver.limit if driver.limit > 0.0 else 0.0
    scale = 1.0 / (1.0 + g * (g + k))
    limit = driver.limit * driver.level
    return record_of(DriverParameters, g=g, k=k, gain=gain, limit=limit, scale=scale, on=float(on))


def _pickup(sensor: Sensor, rate: Hertz) -> Records:
    pickups, low = sensor.pickups, tan(pi * sensor.pickups.low / rate)
    g = tan(pi * min(pickups.high, 0.45 * rate) / rate)
    return record_of(
        PickupParameters,
        own_1=pickups.own[0],
        own_2=pickups.own[1],
        gain_1=pickups.gain[0],
        gain_2=pickups.gain[1],
        low_cut=low / (1.0 + low),
        g=g,
        k=2.0**0.5,
        noise=pickups.hiss,
        air_1=pickups.air[0],
        air_2=pickups.air[1],
        scale=1.0 / (1.0 + g * (g + 2.0**0.5)),
    )


def _outside(scene: Scene) -> Audio:
    if scene.outside is None:
        return np.zeros(0, dtype=np.float32)
    samples = np.asarray(scene.outside.samples, dtype=np.float32)
    if samples.ndim != 1 or samples.size == 0 or not np.isfinite(samples).all():
        raise InputError(f"an outside sound of shape {samples.shape}", "finite mono samples, (n,)")
    return samples * np.float32(scene.outside.level)


def _touches(sensor: Sensor, touches: tuple[Touch, ...], chosen: RatePlan, rate: Hertz) -> dict[str, Any]:
    """Return the fields of `Parameters` that belong to the touches."""
    string, step = sensor.string, 1.0 / (rate * chosen.oversampling)
    weights = np.zeros((len(touches), padded(chosen.count)))
    compliance = np.zeros((len(touches), TABLE_PLACES))
    records = np.zeros(len(touches), dtype_of(TouchParameters))
    keys = np.zeros(
        (len(touches), max((len(touch.motion) for touch in touches), default=1)), dtype_of(KeyRecord)
    )
    exact = _exact(string, chosen, step)
    offset = offset_of(sensor)
    for t, touch in enumerate(touches):
        material = touch.material
        _refuse_outside(touch, sensor)
        k1, k2, width = surface_of(string, touch)
        records[t] = record_of(
            TouchParameters,
            k1=k1,
            k2=k2,
            beta=material.loss,
            tangential_ratio=mindlin_ratio(material.poisson_ratio),
            static_friction=material.friction_static,
            kinetic_friction=material.friction_kinetic,
            stribeck_speed=material.stribeck_speed,
            roughness=material.roughness,
            roughness_length=material.roughness_length,
            rolls=float(touch.rolls),
            keys=len(touch.motion),
        )
        for i, key in enumerate(touch.motion):
            keys[t, i] = (key.time, key.position + offset, key.force, key.clearance, key.across)
        edges = edges_of(string, touch)
        if edges > 0.0:
            weights[t, : chosen.count] = _edge_weights(string, exact, edges)
            compliance[t] = _edge_compliance(string, edges)
            continue
        weights[t, : chosen.count] = exact * _blur(string.length, width, chosen.count)
        compliance[t] = _compliance(sensor, width)
    return {"touches": records, "keys": keys, "weights": weights, "compliance": compliance}


def _exact(string: StringParams, chosen: RatePlan, step: float) -> Floats:
    """Return the weight of each mode's shape at a point."""
    return np.sqrt(touch_weights(mode_frequencies(string, chosen.count), step, chosen.beta))


def _refuse_outside(touch: Touch, sensor: Sensor) -> None:
    low, high = reach(sensor, touch.law.width)
    for key in touch.motion:
        if not low <= key.position <= high:
            raise InputError(f"a touch at {key.position:g} m", f"{low:g} to {high:g} m")


def _blur(length: float, width: float, count: int) -> Floats:
    """Return the share of each mode that a touch of a width feels, a Gaussian of the same variance."""
    wave = np.arange(1, count + 1) * pi / length
    return np.exp(-((wave * width) ** 2) / 24.0)


def _edge_weights(string: StringParams, exact: Floats, width: float) -> Floats:
    """Return the weight of each mode in the mean height of two edges.

    Between edges far apart so little is left to the modes beyond the bank that the weights which are exact at
    a point would give way by more than the string does: these are taken as exact as they may be, for touches
    of the middle three fifths as in `monochord.physics.twin.rate`.
    """
    n = np.arange(1, exact.size + 1)
    share = np.cos(0.5 * width * n * pi / string.length)
    place = np.linspace(0.0, 1.0, TABLE_PLACES)
    inside = np.abs(place - 0.5) < 0.3
    static = 2.0 * share**2 / (string.linear_density * string.length)
    static /= mode_frequencies(string, exact.size) ** 2
    shape, whole = np.sin(np.outer(place[inside], n) * pi) ** 2, _edge_compliance(string, width)[inside]
    for power in EDGE_POWERS:
        if np.all(shape @ (static * exact ** (2.0 * power)) <= whole):
            return exact**power * share
    return share


@lru_cache(maxsize=64)
def _edge_compliance(string: StringParams, width: Metres) -> Floats:
    """Return the static compliance along the string, in m/N, of a touch on two edges."""
    inside = 0.5 * width + 1e-6 * string.length
    place = np.clip(np.linspace(0.0, string.length, TABLE_PLACES), inside, string.length - inside)
    near, far = place - 0.5 * width, place + 0.5 * width
    same_edge = mutual_compliance(string, near, near) + mutual_compliance(string, far, far)
    return 0.25 * same_edge + 0.5 * mutual_compliance(string, near, far)


@lru_cache(maxsize=64)  # 7 ms, and an object that is led by hand comes with each of its motions
def _compliance(sensor: Sensor, width: float) -> Floats:
    """Return the static compliance along the string, in m/N, of a touch of a width in m."""
    string = sensor.string
    place = np.linspace(0.0, 1.0, TABLE_PLACES)
    point = np.zeros(TABLE_PLACES)
    point[1:-1] = static_compliance(string, place[1:-1] * string.length)
    omega = mode_frequencies(string, WIDTH_MODES)
    lost = (1.0 - _blur(string.length, width, WIDTH_MODES) ** 2) * 2.0
    lost /= string.linear_density * string.length * omega**2
    return point - np.sin(np.outer(place, np.arange(1, WIDTH_MODES + 1)) * pi) ** 2 @ lost


def _plucked(sensor: Sensor, pluck: Pluck | None, chosen: RatePlan) -> Floats:
    """Return the displacement in m of every mode of the bank at the start."""
    half = padded(chosen.count)
    q = np.zeros(2 * half)
    if pluck is None:
        return q
    length, place = sensor.string.length, pluck.position + offset_of(sensor)
    if not 0.0 < place < length:
        raise InputError(f"a pluck at {place:g} m", f"between 0 and {length:g} m")
    n = np.arange(1, chosen.count + 1)
    share = np.sin(n * pi * place / length) * length**2 / (place * (length - place))
    triangle = 2.0 * pluck.height * share / (n * pi) ** 2
    q[: chosen.count] = triangle * cos(pluck.angle)
    q[half : half + chosen.count] = triangle * sin(pluck.angle)
    return q


def _new_contacts(
    sensor: Sensor, touches: tuple[Touch, ...], time: float, bank: Floats
) -> tuple[Records, Records]:
    """Return states and motions of new objects: where they are at a time, but off all of the string.

    Their depth, and with it the first contact, follows from the next control update.
    """
    far = CLEARANCE_OF_NEW + float(np.abs(bank[Q, : bank.shape[1] // 2]).sum())
    contact = np.zeros(len(touches), dtype_of(ContactState))
    contact["time_off"], contact["eta"] = 1.0, -far
    motion = np.zeros(len(touches), dtype_of(Motion))
    for t, touch in enumerate(touches):
        times = [key.time for key in touch.motion]
        for name in ("position", "force", "clearance", "across"):
            motion[name][t] = np.interp(time, times, [getattr(key, name) for key in touch.motion])
    motion["position"] += offset_of(sensor)
    motion["depth"] = -far
    return contact, motion
