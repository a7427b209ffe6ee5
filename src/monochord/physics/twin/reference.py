"""The twin's step written to be read: plain NumPy, one thing after the other, roots by halving a bracket.

It is the scheme of `monochord.physics.twin.kernel`, on the same arrays, some thousand times slower. It shares
the names of rows and columns with the parts, and no arithmetic: each formula is written down a second time.
The force of a touch is found from its equation alone and the tension by repetition until nothing changes,
where the kernel guesses, corrects and stops early.
"""

from dataclasses import replace
from math import hypot, pi, sqrt

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Samples
from monochord.physics.twin import bank as layout
from monochord.physics.twin import memory as k
from monochord.physics.twin import motion, pickup, roughness
from monochord.physics.twin._slow_touch import (
    ALIKE,
    MOST,
    approach,
    bits,
    compressed,
    foreseen,
    halved,
    height,
    own_key,
    remember,
    touched,
)
from monochord.physics.twin.memory import Out, Sensor, State
from monochord.physics.twin.stream import Labels, Take, Twin


def advance_slowly(twin: Twin, frames: Samples) -> tuple[Take, Twin]:
    """Return what `monochord.physics.twin.stream.advance` returns, by the readable way.

    Parameters
    ----------
    twin
        A twin at an instant, as `begin` or `advance` gave it; it is not changed.
    frames
        How many frames, some thousand at most for patience: a step takes about a millisecond.

    Returns
    -------
    tuple
        The sound with its labels, and the twin after it. They differ from the kernel's by its early stop.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> from monochord.physics.twin import Ebow, Pluck, Scene, Sensor, begin
    >>> coils = Ebow(sense=0.02, drive=0.03), Ebow(sense=0.18, drive=0.17)
    >>> sensor = Sensor(name="p", string=load_string("prototype").string, drivers=coils, range=(0.05, 0.15))
    >>> take, twin = advance_slowly(begin(sensor, Scene(pluck=Pluck(position=0.07, height=1e-4))), 3)
    >>> take.microphones.shape, twin.start
    ((2, 3), 3)
    """
    sensor = Sensor(*(array[0] for array in twin.fixed))
    state = State(*(array[0].copy() for array in twin.moving))
    bank = state.bank.reshape(layout.rows(len(twin.scene.touches)), -1)
    out = _silence(len(twin.scene.touches), frames)
    finer = int(sensor.integers[k.FINER])
    for frame in range(frames):
        for index in range((twin.start + frame) * finer, (twin.start + frame + 1) * finer):
            if index % k.TICK == 0:
                _look(sensor, state, bank, index)
            _step(sensor, state, bank, index)
        _hear(sensor, state, bank, out, frame, twin.start + frame)
    heard, *labels = out
    take = Take(microphones=heard, labels=Labels(**dict(zip(Out._fields[1:], labels, strict=True))))
    return take, replace(twin, start=twin.start + frames, moving=tuple(array[None] for array in state))


def _silence(touches: int, frames: int) -> Out:
    one = (touches, frames)
    return Out(
        microphones=np.zeros((2, frames), np.float32),
        contact=np.zeros(one, np.uint8),
        position=np.zeros(one, np.float32),
        force=np.zeros(one, np.float32),
        reaction=np.zeros(one, np.float32),
        slip=np.zeros(one, np.uint8),
        across=np.zeros(one, np.float32),
        along=np.zeros(one, np.float32),
        friction=np.zeros(one, np.uint8),
        settled=np.zeros(frames, np.uint8),
    )


def _look(sensor: Sensor, state: State, bank: Floats, index: int) -> None:
    """At a tick: where touches will be at the next, how taut that makes the string, how far it gives way."""
    step, length, nominal, mass, reach = sensor.scalars[[k.STEP, k.LENGTH, k.TENSION, k.MASS, k.REACH]]
    place, load, gap = motion.PLACE, motion.LOAD, motion.GAP
    touches = range(len(sensor.touches))
    time = (index + k.TICK) * step
    gates_moving = bool((state.coils[:, k.GATE] != sensor.gates).any())
    for t in touches:
        state.asked[t] = state.ahead[t]
        keys = sensor.keys[t, : sensor.counts[t]]
        columns = keys[:, motion.TIME + 1 :].T
        state.ahead[t, : motion.DEPTH] = [np.interp(time, keys[:, motion.TIME], column) for column in columns]
    moving = gates_moving or bool((state.asked[:, : motion.DEPTH] != state.ahead[:, : motion.DEPTH]).any())

    tension = nominal + _drifted(sensor.scalars, index)
    for t in touches:
        if state.contact[t, k.SINCE] < k.HOLD:
            tension += _rise(sensor, state.asked[t, load], state.asked[t, place])
    if abs(tension - state.memory[k.TUNED]) > k.RETUNE * nominal:
        _tune(bank, tension, mass, reach, step)
        state.memory[k.TUNED], state.memory[k.KICK] = tension, bank[layout.KICK_Q].max()

    squares = bank[layout.PULL] * tension + bank[layout.BEND]
    for t in touches:
        own, (k1, k2) = state.contact[t], sensor.touches[t, [k.K1, k.K2]]
        now, ahead = state.asked[t], state.ahead[t]
        places = np.linspace(0.0, length, sensor.tables.shape[1])
        ahead_gives, now_gives = (
            np.interp([ahead[place], now[place]], places, sensor.tables[t]) * nominal / tension
        )
        others = sum(
            state.ahead[o, load]
            * min(ahead[place], state.ahead[o, place])
            * (length - max(ahead[place], state.ahead[o, place]))
            / (tension * length)
            for o in touches
            if o != t
        )
        s = compressed(ahead[load], k1, k2)
        ahead[motion.DEPTH] = s * s + ahead_gives * ahead[load] + others - ahead[gap]
        row = layout.SHAPE + layout.EACH * t
        half = bank.shape[1] // 2
        n = np.arange(1, half + 1)
        bank[row, :half] = sensor.weights[t] * np.sin(n * pi * now[place] / length)
        then = sensor.weights[t] * np.sin(n * pi * ahead[place] / length)
        bank[row + 1, :half] = (then - bank[row, :half]) / k.TICK
        ringing = squares[:half] > 0.0
        shape = bank[row, :half][ringing]
        own[k.REST] = max(0.0, now_gives - float(np.sum(shape**2 / (mass * squares[:half][ringing]))))
        if own[k.S] > 0.0:
            own[k.ETA] = approach(own[k.S], k1, k2, own[k.REST])
        usual = max(now[load], k.LEAST)
        normal = k1 + 1.5 * k2 * compressed(usual, k1, k2)
        own[k.GRIP] = 1.0 / (1.0 / (sensor.touches[t, k.TANGENT] * normal) + own[k.REST])
        own[k.DAMP] = sensor.touches[t, k.LOSS] * usual / step
        if own[k.SINCE] >= k.HOLD:
            own[k.HEIGHT] = height(sensor.touches[t], own, surface(sensor, t))

    most = k.TICK * step / k.SWITCH
    gates = state.coils[:, k.GATE]
    state.coils[:, k.GATE] = gates + np.clip(sensor.gates - gates, -most, most)
    if moving:
        state.memory[[k.QUIET, k.SETTLED]] = 0.0


def _drifted(scalars: Floats, index: int) -> float:
    """Return how far the tension has drifted at a step, in N, a quarter of it at most."""
    drift = scalars[k.DRIFT] + scalars[k.DRIFT_RATE] * index * scalars[k.STEP]
    return float(np.clip(drift, -0.25 * scalars[k.TENSION], 0.25 * scalars[k.TENSION]))


def surface(sensor: Sensor, t: int) -> int:
    """Return the seed of a touch's surface."""
    return own_key(int(sensor.integers[k.SEED]), roughness.OCTAVES + t)


def _rise(sensor: Sensor, force: float, place: float) -> float:
    """Return k_T F, or solve T^2 (T - T0) = E A F^2 x (L - x) / (2 L^2) for T - T0, in N."""
    if sensor.integers[k.LAW] == 1:
        return float(sensor.scalars[k.RISE]) * force
    length, nominal, axial = sensor.scalars[[k.LENGTH, k.TENSION, k.AXIAL]]
    right = axial * force**2 * place * (length - place) / (2.0 * length**2)
    return halved(lambda rise: (nominal + rise) ** 2 * rise - right, 0.0, right / nominal**2)


def _tune(bank: Floats, tension: float, mass: float, reach: float, step: float) -> None:
    """Write down how each mode goes over one step of its closed solution."""
    square = bank[layout.PULL] * tension + bank[layout.BEND]
    rings = square > 0.0
    square, sigma, stretch = square[rings], bank[layout.SIGMA, rings], bank[layout.STRETCH, rings]
    ring = np.sqrt(square - sigma**2)
    decay = np.exp(-sigma * step)
    cosine, sine = decay * np.cos(ring * step), decay * np.sin(ring * step) / ring
    bank[layout.Q_Q, rings], bank[layout.Q_V, rings] = cosine + sigma * sine, sine
    bank[layout.V_Q, rings], bank[layout.V_V, rings] = -square * sine, cosine - sigma * sine
    bank[layout.PUSH_Q, rings] = (1.0 - cosine - sigma * sine) / (mass * square)
    bank[layout.PUSH_V, rings] = sine / mass
    bank[layout.KICK_Q, rings] = bank[layout.PUSH_Q, rings] * stretch * reach
    bank[layout.KICK_V, rings] = bank[layout.PUSH_V, rings] * stretch * reach


def _step(sensor: Sensor, state: State, bank: Floats, index: int) -> None:
    """Take one step: hold the drivers' forces, let every mode go, then find tension and touches together."""
    scalars, memory, count = sensor.scalars, state.memory, len(sensor.touches)
    step = scalars[k.STEP]
    shake = 0.0
    if sensor.sound.size:
        shake = scalars[k.SHAKE] * sensor.sound[(index // sensor.integers[k.FINER]) % sensor.sound.size]
    forces = [_driven(sensor.ebows[d], state.coils[d], memory[k.COIL_1 + d]) for d in (0, 1)]
    push = bank[layout.DRIVE_1] * forces[0] + bank[layout.DRIVE_2] * forces[1] + bank[layout.FRAME] * shake
    q, v = bank[layout.Q].copy(), bank[layout.V].copy()
    q_free = bank[layout.Q_Q] * q + bank[layout.Q_V] * v + bank[layout.PUSH_Q] * push
    v_free = bank[layout.V_Q] * q + bank[layout.V_V] * v + bank[layout.PUSH_V] * push

    past = (index % k.TICK + 1.0) / k.TICK
    found = np.zeros((count, k.FOUND))
    for t, one in enumerate(found):
        travel = (state.ahead[t, motion.PLACE] - state.asked[t, motion.PLACE]) / k.TICK
        if travel != 0.0:
            bank[layout.SHAPE + layout.EACH * t] += bank[layout.SHAPE + layout.EACH * t + 1]
        rolls = sensor.touches[t, k.ROLLS] != 0.0
        one[k.ALONG_SPEED], one[k.ROLLED] = (0.0, travel) if rolls else (travel / step, 0.0)
        depth, depth_ahead = state.asked[t, motion.DEPTH], state.ahead[t, motion.DEPTH]
        one[k.SURFACE] = depth + past * (depth_ahead - depth) + state.contact[t, k.HEIGHT]

    taken = memory[k.TUNED] - scalars[k.TENSION] - _drifted(scalars, index - index % k.TICK)
    free = float(bank[layout.STRETCH] @ q_free**2)
    spread, tension, q_next, held = free, 0.0, q_free, np.zeros_like(q)
    if sensor.integers[k.LAW] == 0:
        tension = 0.5 * scalars[k.STRETCH] * (memory[k.SPREAD] + free) - taken
        spread -= (
            2.0 * tension * float((bank[layout.STRETCH] * bank[layout.KICK_Q]) @ (q_free * (q_free + q)))
        )
    for t, one in enumerate(found):
        alone = (
            foreseen(sensor.touches[t], state.contact[t], one, bank, t, q_free, step) * bank[layout.PUSH_Q]
        )
        spread += float(bank[layout.STRETCH] @ (alone * (2.0 * q_free + alone)))
    spread = max(0.0, spread)
    for turn in range(MOST):
        if sensor.integers[k.LAW] == 0:
            tension = 0.5 * scalars[k.STRETCH] * (memory[k.SPREAD] + spread) - taken
            tension = max(tension, -k.SLACK / memory[k.KICK])
        pull = bank[layout.KICK_Q] * tension
        q_pulled, ease = (q_free - pull * q) / (1.0 + pull), bank[layout.PUSH_Q] / (1.0 + pull)
        held = touched(sensor, state, bank, q_pulled, ease, found, rubbing=turn == 0)
        q_next = q_pulled + ease * held
        before, spread = spread, float(bank[layout.STRETCH] @ q_next**2)
        if abs(spread - before) <= ALIKE * spread:
            break
    memory[k.SPREAD] = spread
    bank[layout.V] = v_free + bank[layout.PUSH_V] * held - bank[layout.KICK_V] * tension * (q_next + q)
    bank[layout.Q] = q_next
    memory[k.COIL_1] = bank[layout.SENSE_1] @ bank[layout.V]
    memory[k.COIL_2] = bank[layout.SENSE_2] @ bank[layout.V]
    for t, one in enumerate(found):
        remember(sensor.touches[t], state.contact[t], one, step, surface(sensor, t))


def _driven(parameters: Floats, memory: Floats, velocity: float) -> float:
    """Return a driver's force in N: band filter (trapezoidal rule), limit, and half a step of foresight."""
    warp, damp, sensitivity, limit, _ = parameters
    rise, fall, before, gate = memory
    band = (rise + warp * (velocity - fall)) / (1.0 + warp * (warp + damp))
    low = fall + warp * band
    heard = damp * band
    memory[:] = 2.0 * band - rise, 2.0 * low - fall, heard, gate
    if limit == 0.0 or gate == 0.0:
        return 0.0
    half = 0.5 * float(np.clip(sensitivity * (1.5 * heard - 0.5 * before), -20.0, 20.0))
    fraction = 11.0
    for odd in (9.0, 7.0, 5.0, 3.0, 1.0):
        fraction = odd + half * half / fraction
    return gate * limit * 2.0 * (half / fraction) / (1.0 + (half / fraction) ** 2)


def _bell(seed: int, index: int) -> float:
    """Return the sum of eight uniform numbers, shifted and scaled to no mean and unit variance."""
    words = [(bits(seed, index + half) >> 16 * piece) & 0xFFFF for half in (0, 1) for piece in range(4)]
    return (sum(words) - 8 * 32767.5) * sqrt(12.0 / 8.0) / 65536.0


def _hear(sensor: Sensor, state: State, bank: Floats, out: Out, frame: int, index: int) -> None:
    """Write one frame: what the microphones give, and what is true."""
    memory, parameters, seed = state.memory, sensor.pickup, int(sensor.integers[k.SEED])
    taut = memory[k.TUNED] / sensor.scalars[k.TENSION]
    near, far = taut * (bank[layout.END_1] @ bank[layout.Q]), taut * (bank[layout.END_2] @ bank[layout.Q])
    air = float(sensor.sound[index % sensor.sound.size]) if sensor.sound.size else 0.0
    heard = [0.0, 0.0]
    for c, (own, other) in enumerate(((near, far), (far, near))):
        share = parameters[pickup.OWN_1 + c]
        raw = (
            parameters[pickup.GAIN_1 + c] * (share * own + (1.0 - share) * other)
            + parameters[pickup.AIR_1 + c] * air
        )
        heard[c] = _amplified(parameters, state.band[c], raw)
        noisy = heard[c] + parameters[pickup.HISS] * _bell(seed, 4 * index + 2 * c)
        out.microphones[c, frame] = np.clip(noisy, -1.0, 1.0)
    past = ((index * sensor.integers[k.FINER]) % k.TICK) / k.TICK
    for t in range(len(sensor.touches)):
        own = state.contact[t]
        touching = own[k.SINCE] < k.HOLD
        if own[k.ON] != touching:
            own[k.ON], memory[k.QUIET], memory[k.SETTLED] = touching, 0.0, 0.0
        now, ahead = state.asked[t, motion.PLACE], state.ahead[t, motion.PLACE]
        out.contact[t, frame] = touching
        out.position[t, frame] = now + past * (ahead - now)
        out.force[t, frame] = own[k.MEAN] * touching
        out.reaction[t, frame] = own[k.NOW]
        out.slip[t, frame] = touching and hypot(own[k.ACROSS], own[k.ALONG]) > k.SLIPPING
        out.across[t, frame], out.along[t, frame] = own[k.ACROSS], own[k.ALONG]
        out.friction[t, frame] = own[k.STATE]
    period = sensor.scalars[k.STEP] * sensor.integers[k.FINER]
    calm = True
    for value, brief, lasting in zip(heard, (k.BRIEF_1, k.BRIEF_2), (k.LONG_1, k.LONG_2), strict=True):
        memory[brief] += period / k.BRIEF * (value**2 - memory[brief])
        memory[lasting] += period / k.LONG * (value**2 - memory[lasting])
        calm &= abs(memory[brief] - memory[lasting]) <= k.SAME * (memory[lasting] + k.SILENCE)
    memory[k.QUIET] = memory[k.QUIET] + period if calm else 0.0
    if memory[k.QUIET] >= k.CALM:
        memory[k.SETTLED] = 1.0
    out.settled[frame] = memory[k.SETTLED]


def _amplified(parameters: Floats, memory: Floats, signal: float) -> float:
    """Return a signal after the preamplifier: a high-pass of one pole and a low-pass of two, trapezoidal."""
    slow, band_memory, low_memory = memory
    step = parameters[pickup.LOW_CUT] * (signal - slow)
    passed = signal - (slow + step)
    warp, damp = parameters[pickup.HIGH_WARP], parameters[pickup.HIGH_DAMP]
    band = (band_memory + warp * (passed - low_memory)) / (1.0 + warp * (warp + damp))
    low = low_memory + warp * band
    memory[:] = slow + 2.0 * step, 2.0 * band - band_memory, 2.0 * low - low_memory
    return low
