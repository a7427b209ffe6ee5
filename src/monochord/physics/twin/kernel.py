"""The whole sensor, sample by sample: the parts put together, compiled, over one sensor or many at once.

One sample: the drivers' forces are held; every mode is carried exactly; then touches and the string's
stretch are solved together. The stretch enters as an extra tension at the mean of old and new position (a
discrete gradient, so that energy is kept), which makes the touches' equations scalar once it is known; it
is found by repeating, and settles within two or three rounds because it is small.
"""

import sys
from collections.abc import Callable
from functools import cache

import numpy as np

from monochord.physics.twin import bank as layout
from monochord.physics.twin import (
    ebow,
    friction,
    memory,
    motion,
    part,
    pickup,
    press,
    roughness,
    sounding,
    string,
    touching,
)
from monochord.physics.twin.memory import (
    AGREED,
    AXIAL,
    COIL_1,
    COIL_2,
    DRIFT,
    DRIFT_RATE,
    FAR,
    FINER,
    FRESH,
    GATE,
    HOLD,
    KICK,
    LAW,
    LENGTH,
    MASS,
    MOST,
    NEAR,
    QUIET,
    REACH,
    RETUNE,
    RISE,
    ROUNDS,
    SEED,
    SETTLED,
    SHAKE,
    SINCE,
    SLACK,
    SLOPE,
    SPREAD,
    STEP,
    STRETCH,
    SWITCH,
    TELLING,
    TENSION,
    TICK,
    TUNED,
    Integers,
    Out,
    Sensor,
    State,
)


@part.called
def _ask(sensor: Sensor, state: State, index: int) -> tuple[float, bool, bool]:
    """Read the touches' motion; return the tension it asks for, whether one moves, and whether one did."""
    scalars, step = sensor.scalars, sensor.scalars[STEP]
    moves, moved = False, False
    tension = scalars[TENSION] + motion.drifted(
        scalars[DRIFT], scalars[DRIFT_RATE], index * step, scalars[TENSION]
    )
    for t in range(sensor.touches.shape[0]):
        now, ahead = state.asked[t], state.ahead[t]
        for c in range(5):
            moved = moved or now[c] != ahead[c]
            now[c] = ahead[c]
        motion.asked(sensor.keys[t], sensor.counts[t], (index + TICK) * step, ahead)
        for c in range(motion.SPEED + 1):
            moves = moves or ahead[c] != now[c]
        if state.contact[t, SINCE] >= HOLD:
            continue
        if sensor.integers[LAW] == 1:
            tension += scalars[RISE] * now[motion.LOAD]
        elif now[motion.LOAD] > 0.0:
            place = now[motion.PLACE]
            tension += motion.geometric_rise(
                now[motion.LOAD], place, scalars[LENGTH], scalars[TENSION], scalars[AXIAL]
            )
    return tension, moves, moved


@part.called
def _look(sensor: Sensor, state: State, size: int, index: int) -> None:
    """At a tick: read the touches' motion and prepare the string for the steps up to the next."""
    scalars, bank, memory = sensor.scalars, state.bank, state.memory
    tension, moves, moved = _ask(sensor, state, index)
    fresh = moves or moved or memory[FRESH] > 0.0
    memory[FRESH] = 0.0
    if abs(tension - memory[TUNED]) > RETUNE * scalars[TENSION]:
        memory[KICK] = string.tune(bank, size, tension, scalars[MASS], scalars[REACH], scalars[STEP])
        memory[TUNED] = tension
        fresh = True
    if fresh:
        for t in range(sensor.touches.shape[0]):
            touching.lay(sensor, state, size, t)
    most = TICK * scalars[STEP] / SWITCH
    for d in range(2):
        gate, wanted = state.coils[d, GATE], sensor.gates[d]
        if gate != wanted:
            moves = True
            state.coils[d, GATE] = gate + min(most, max(-most, wanted - gate))
    if moves:
        memory[QUIET] = 0.0
        memory[SETTLED] = 0.0


@part.part
def _agree(sensor: Sensor, state: State, size: int, guess: float, taken: float) -> float:
    """Find tension and touches that agree, from a guess of the stretch sum; return the extra tension in N.

    A miss comes back by nearly the same share from step to step, which tells the next guess; should that go
    astray, a bracket is halved. `taken` is the tension that the propagators hold already.
    """
    scalars, bank, memory = sensor.scalars, state.bank, state.memory
    tension, slope, spread = 0.0, memory[SLOPE], 0.0
    before, came, low, high = 0.0, 0.0, 0.0, np.inf
    for turn in range(MOST):
        if sensor.integers[LAW] == 0:
            tension = max(0.5 * scalars[STRETCH] * (memory[SPREAD] + guess) - taken, -SLACK / memory[KICK])
        spread = string.pulled(bank, size, tension, memory[KICK])
        memory[ROUNDS] += 1.0
        if sensor.touches.shape[0] > 0:
            spread = touching.touch_all(sensor, state, size, turn)
        if turn == 1 and abs(guess - before) > TELLING * spread:
            slope = (spread - came) / (guess - before)
        if sensor.integers[LAW] == 1 or abs(spread - guess) <= scalars[AGREED] * spread:
            break
        before, came = guess, spread
        if spread > guess:
            low = guess
        else:
            high = guess
        guess = (spread - slope * guess) / (1.0 - slope)
        if not low < guess < high:
            guess = 0.5 * (low + high) if high < np.inf else 2.0 * spread
    memory[SLOPE] = min(0.5, max(-0.5, slope))
    memory[SPREAD] = spread
    return tension


@part.part
def _step(sensor: Sensor, state: State, size: int, index: int) -> None:
    """Take one step of the whole sensor."""
    scalars, bank, memory = sensor.scalars, state.bank, state.memory
    first = ebow.drive(sensor.ebows[0], state.coils[0], memory[COIL_1])
    second = ebow.drive(sensor.ebows[1], state.coils[1], memory[COIL_2])
    shake = 0.0
    if sensor.sound.size > 0:
        shake = scalars[SHAKE] * sensor.sound[(index // sensor.integers[FINER]) % sensor.sound.size]
    guess, yields = string.carry(bank, size, first, second, shake)
    time = (index // TICK) * TICK * scalars[STEP]
    off = motion.drifted(scalars[DRIFT], scalars[DRIFT_RATE], time, scalars[TENSION])
    taken = memory[TUNED] - scalars[TENSION] - off
    if sensor.integers[LAW] == 0:
        guess -= yields * (scalars[STRETCH] * (memory[SPREAD] + guess) - 2.0 * taken)
    guess += touching.prepare(sensor, state, size, (index % TICK + 1.0) / TICK)
    tension = _agree(sensor, state, size, max(0.0, guess), taken)
    memory[COIL_1], memory[COIL_2], memory[NEAR], memory[FAR] = string.arrive(bank, size, tension)
    for t in range(sensor.touches.shape[0]):
        seed = sensor.integers[SEED]
        touching.remember(sensor.touches[t], state.contact[t], state.solved[t], scalars[STEP], seed, t)


@part.part
def _one(sensor: Sensor, state: State, out: Out, size: int, start: int) -> None:
    """Run one sensor for as many frames as `out` holds; `start` is the index of the first."""
    finer = sensor.integers[FINER]
    for frame in range(out.settled.size):
        for sub in range(finer):
            index = (start + frame) * finer + sub
            if index % TICK == 0:
                _look(sensor, state, size, index)
            _step(sensor, state, size, index)
        sounding.hear(sensor, state, out, frame, start + frame)


OTHERS = (layout, memory, sounding, touching, ebow, friction, motion, part, pickup, press, roughness, string)
PARTS = part.fingerprint((sys.modules[__name__], *OTHERS))


@cache
def kernel(size: int, parts: int = PARTS) -> Callable[[Sensor, State, Out, Integers, int, int], int]:
    """Compile the kernel for a bank of `size`; `parts` lets their cache know them by their text."""

    @part.COMPILE(cache=True, fastmath=part.FAST, error_model="numpy", nogil=True, _nrt=False)
    def run(many: Sensor, states: State, outs: Out, starts: Integers, first: int, stop: int) -> int:
        for i in range(first, stop):
            sensor = Sensor(
                many.scalars[i], many.integers[i], many.ebows[i], many.pickup[i], many.gates[i],
                many.sound[i], many.touches[i], many.keys[i], many.counts[i], many.weights[i], many.tables[i],
            )  # fmt: skip
            state = State(
                states.bank[i], states.contact[i], states.asked[i], states.ahead[i], states.coils[i],
                states.band[i], states.memory[i], states.solved[i], states.mutual[i],
            )  # fmt: skip
            out = Out(
                outs.microphones[i], outs.contact[i], outs.position[i], outs.force[i], outs.reaction[i],
                outs.slip[i], outs.across[i], outs.along[i], outs.friction[i], outs.settled[i],
            )  # fmt: skip
            _one(sensor, state, out, size, starts[i])
        return parts

    return run
