"""The whole sensor, sample by sample: the parts put together, compiled, over one sensor or many at once.

One sample: the drivers' forces are held; every mode is carried exactly; then touches and the string's stretch are
solved together. The stretch enters as an extra tension at the mean of old and new position (a discrete gradient, so
that energy is kept), which makes the touches' equations scalar once it is known; it is found by repeating, and
settles within two or three rounds because it is small.
"""

import sys
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from monochord.physics.twin import bank as layout
from monochord.physics.twin import ebow, friction, motion, part, pickup, press, roughness, string
from monochord.types import Audio, Floats

Integers = NDArray[np.int64]
Flags = NDArray[np.uint8]

STEP, LENGTH, TENSION, MASS, REACH, STRETCH, AXIAL, RISE, DRIFT, DRIFT_RATE, SHAKE, AGREED = range(12)
"""Scalars: time step, L, T0, modal mass, pi^2/(4L), E A pi^2/(4 L^2), E A, k_T of the linear law, N off T0 and N/s of
drift, acceleration of the frame in m/s^2 at full scale of the outside sound, and the relative change of the stretch
sum at which its rounds end."""
FINER, SEED, LAW = range(3)
"""Integers: steps a frame, seed, and tension law (0 geometric, 1 linear)."""
K1, K2, LOSS, TANGENT, STATIC, KINETIC, STRIBECK, ROUGH, ROUGH_LENGTH, ROLLS = range(10)
"""Parameters of a touch: stiffness, Hunt-Crossley's beta, tangential over normal stiffness, friction, roughness."""
(
    S, ETA, Z, Z_ALONG, PULL_ALONG, SLIP, SIDE, PATH, HEIGHT, REST, GRIP, DAMP, NOW, SINCE, MEAN, ACROSS, ALONG, STATE,
    ON, PATH_ALONG, ROLL, LAG, LAG_ALONG, SLOW, SLOW_ALONG, MARK, MARK_ALONG, READ, READ_ALONG,
) = range(29)  # fmt: skip
"""Memory of a touch: contact (sqrt delta, eta), bristles, force along, last speed, place aside, path slid across,
height, residual compliance, stiffness and damping of the bristles, force now, time since it pressed, its mean, slip
speeds, state of friction, and whether it counted as touching; then the path slid along and the one rolled, both
paths after one pole and after two, the mark that their play leaves, and where the height was last
read."""
(
    TUNED,
    SPREAD,
    BRIEF_1,
    BRIEF_2,
    LONG_1,
    LONG_2,
    QUIET,
    SETTLED,
    COIL_1,
    COIL_2,
    SLOPE,
    NEAR,
    FAR,
    KICK,
    FRESH,
    ROUNDS,
) = range(16)
"""Memory of the sensor: tension of the propagator, stretch sum, levels, time at rest, flag, speeds at the coils, how
a miss of the guess comes back, forces on
the ends, largest kick of a mode, whether touches
must be laid anew, and how many rounds were done."""

(
    LOAD, SIDE_FORCE, ALONG_FORCE, NEW_S, NEW_ETA, Z_NEW, Z_NEW_ALONG, LEFT, LEFT_ALONG, GRIPS, ASIDE, BELOW, BESIDE,
    SURFACE, ALONG_SPEED, ROLLED, FOUND,
) = range(17)  # fmt: skip
"""What a step finds of a touch: its forces, contact, bristles, motion left to slide, state, place; then what it
started from: free place, surface and its motion."""

TICK = 32
"""Steps from one reading of the touches' motion to the next; between, they run linearly."""
TELLING = 1e-10
"""Relative difference of two guesses that tells how a miss comes back."""
ALIKE = 1e-12
"""Relative change of the largest force at which several touches have come to terms."""
MOST = 60
"""Most rounds of the stretch: two or three are usual, and a bracket is halved where they go astray."""
SLACK = 0.9
"""Share of the slack that a mode bears in a step at which the extra tension is held, should it fall so low."""
SWEEPS = 40
"""Most rounds of several touches among themselves."""
HOLD = 0.005
"""Seconds without force after which a touch counts as off, and time constant of its force."""
SWING, SPEEDING = 0.002, 0.003
"""Time constants in s of the two poles that take the swing off the path slid, and of sliding speeds."""
SLIPPING = 5e-4
"""Sliding speed in m/s from which a touch counts as slipping."""
BRIEF, LONG, SAME, CALM = 0.010, 0.050, 0.2, 0.020
"""Time constants of the two levels in s, how far they may differ, and for how long in s, to be settled."""
RETUNE = 1e-7
"""Relative change of the tension at which the propagators follow; what is less acts as an extra tension."""
FINE = 1e-8
"""Way over an object in m that leaves its height as it was."""
SILENCE = 1e-12
"""Level, in full scale squared, that counts as none."""
LEAST = 0.01
"""Press in N at which the bristles of a lighter touch are taken."""
SWITCH = 0.005
"""Seconds a driver takes to go on or off."""


class Sensor(NamedTuple):
    """What does not change while the twin runs; see `monochord.physics.twin.assemble` for where it comes from."""

    scalars: Floats
    integers: Integers
    ebows: Floats
    pickup: Floats
    gates: Floats
    sound: Audio
    touches: Floats
    keys: Floats
    counts: Integers
    weights: Floats
    tables: Floats


class State(NamedTuple):
    """What changes: the bank of modes (part of it only when the tension moves), and the parts' memories."""

    bank: Floats
    contact: Floats
    asked: Floats
    ahead: Floats
    coils: Floats
    band: Floats
    memory: Floats
    solved: Floats
    mutual: Floats


class Out(NamedTuple):
    """What is heard and what is true, per frame."""

    microphones: Audio
    contact: Flags
    position: Audio
    force: Audio
    slip: Flags
    across: Audio
    along: Audio
    friction: Flags
    settled: Flags


@part.called
def _lay(sensor: Sensor, state: State, size: int, t: int) -> None:
    """Lay a touch on the string for a tick: how deep it is asked to go, its modes' shapes, what its bristles hold."""
    scalars, touches, bank = sensor.scalars, sensor.touches, state.bank
    length, tension = scalars[LENGTH], state.memory[TUNED]
    now, ahead, own = state.asked[t], state.ahead[t], state.contact[t]
    k1, k2, row, ratio = touches[t, K1], touches[t, K2], string.row_of(t), scalars[TENSION] / tension
    others = 0.0
    for o in range(touches.shape[0]):
        if o != t:
            others += state.ahead[o, motion.LOAD] * motion.cross_compliance(
                ahead[motion.PLACE], state.ahead[o, motion.PLACE], length, tension
            )
    static = motion.between(sensor.tables[t], ahead[motion.PLACE] / length) * ratio
    ahead[motion.DEPTH] = motion.depth_of(ahead[motion.LOAD], k1, k2, static, others, ahead[motion.GAP])
    string.shape_at(bank, size, row, now[motion.PLACE] / length, sensor.weights[t])
    if ahead[motion.PLACE] != now[motion.PLACE]:
        string.shape_at(bank, size, row + 1, ahead[motion.PLACE] / length, sensor.weights[t])
        for i in range(size // 2):
            bank[(row + 1) * size + i] = (bank[(row + 1) * size + i] - bank[row * size + i]) / TICK
    if touches.shape[0] == 1:
        string.take(bank, size, row)
    modal = string.static_share(bank, size, row, tension, scalars[MASS])
    here = motion.between(sensor.tables[t], now[motion.PLACE] / length) * ratio
    own[REST] = max(0.0, here - modal)
    if own[S] > 0.0:
        own[ETA] = press.approach_at(own[S], k1, k2, own[REST])
    load = max(now[motion.LOAD], LEAST)
    normal = press.stiffness_at(press.root_of_compression(load, k1, k2), k1, k2)
    own[GRIP] = 1.0 / (1.0 / (touches[t, TANGENT] * normal) + own[REST])
    own[DAMP] = touches[t, LOSS] * load / scalars[STEP]
    if own[SINCE] >= HOLD and touches[t, ROUGH] > 0.0:
        scale = 1.0 / touches[t, ROUGH_LENGTH]
        own[HEIGHT] = touches[t, ROUGH] * roughness.height(
            sensor.integers[SEED] + 16 * t, scale * own[PATH], scale * (own[PATH_ALONG] + own[ROLL])
        )


@part.called
def _look(sensor: Sensor, state: State, size: int, index: int) -> None:
    """At a tick: read the touches' motion and prepare the string for the steps up to the next."""
    scalars, touches, bank, memory = sensor.scalars, sensor.touches, state.bank, state.memory
    step, length, nominal = scalars[STEP], scalars[LENGTH], scalars[TENSION]
    count = touches.shape[0]
    moving, fresh = False, memory[FRESH] > 0.0
    tension = nominal + scalars[DRIFT] + scalars[DRIFT_RATE] * index * step
    for t in range(count):
        now, ahead = state.asked[t], state.ahead[t]
        for c in range(5):
            fresh = fresh or now[c] != ahead[c]
            now[c] = ahead[c]
        motion.asked(sensor.keys[t], sensor.counts[t], (index + TICK) * step, ahead)
        for c in range(3):
            moving = moving or ahead[c] != now[c]
        if sensor.integers[LAW] == 1:
            tension += scalars[RISE] * now[motion.LOAD]
        elif now[motion.LOAD] > 0.0:
            tension += motion.geometric_rise(
                now[motion.LOAD], now[motion.PLACE], length, nominal, scalars[AXIAL]
            )
    if abs(tension - memory[TUNED]) > RETUNE * nominal:
        memory[KICK] = string.tune(bank, size, tension, scalars[MASS], scalars[REACH], step)
        memory[TUNED] = tension
        fresh = True
    if moving or fresh:
        memory[FRESH] = 0.0
        for t in range(count):
            _lay(sensor, state, size, t)
    for d in range(2):
        gate, wanted, most = state.coils[d, ebow.GATE], sensor.gates[d], TICK * step / SWITCH
        if gate != wanted:
            moving = True
            state.coils[d, ebow.GATE] = gate + min(most, max(-most, wanted - gate))
    if moving:
        memory[QUIET] = 0.0
        memory[SETTLED] = 0.0


@part.part
def _rub(
    scalars: Floats, touch: Floats, own: Floats, asked: Floats, found: Floats, aside: float, ease: float
) -> None:
    """Solve both bristles of one touch under the force in `found`, and leave what they give there."""
    load, step, length, axial = found[LOAD], scalars[STEP], scalars[LENGTH], scalars[AXIAL]
    soft = 0.0
    if axial > 0.0:
        soft = asked[motion.PLACE] * (length - asked[motion.PLACE]) / (axial * length)
    moved = asked[motion.SPEED] * step - (aside - own[SIDE])
    moved_along = found[ALONG_SPEED] * step + soft * own[PULL_ALONG]
    found[SIDE_FORCE], found[ALONG_FORCE], found[Z_NEW], found[Z_NEW_ALONG] = 0.0, 0.0, 0.0, 0.0
    found[LEFT], found[LEFT_ALONG], found[GRIPS] = moved, moved_along, float(friction.NONE)
    found[ASIDE] = aside
    if load <= 0.0:
        return
    speed, stiffness, damping = own[SLIP], own[GRIP], own[DAMP]
    z, z_along = own[Z], own[Z_ALONG]
    limit = friction.grip(speed, touch[STATIC], touch[KINETIC], touch[STRIBECK]) * load / stiffness
    share = friction.creeping(np.sqrt(z * z + z_along * z_along), limit)
    fade = share * speed * step / limit
    side, left, z_new = friction.bristle(z, moved, ease, stiffness, damping, fade)
    lengthwise, left_along, z_new_along = friction.bristle(
        z_along, moved_along, soft, stiffness, damping, fade
    )
    state = friction.STICK if share == 0.0 else (friction.CREEP if share < 1.0 else friction.SLIDE)
    cap, whole = touch[STATIC] * load, np.sqrt(side * side + lengthwise * lengthwise)
    if whole > cap:
        cut = cap / whole
        side, lengthwise, z_new, z_new_along = cut * side, cut * lengthwise, cut * z_new, cut * z_new_along
        left, left_along = moved - ease * side, moved_along - soft * lengthwise
        state = friction.SLIDE
    found[SIDE_FORCE], found[ALONG_FORCE], found[Z_NEW], found[Z_NEW_ALONG] = (
        side,
        lengthwise,
        z_new,
        z_new_along,
    )
    found[LEFT], found[LEFT_ALONG], found[GRIPS] = left, left_along, float(state)
    found[ASIDE] = aside + ease * side


@part.part
def _touch(sensor: Sensor, state: State, size: int, solved: Floats, mutual: Floats, turn: int) -> float:
    """Solve all touches together, given the free positions, and let them push; return the stretch sum."""
    bank, touches = state.bank, sensor.touches
    count = touches.shape[0]
    for t in range(count):
        row, found = string.row_of(t), solved[t]
        if count > 1:
            string.take(bank, size, row)
        found[BELOW], found[BESIDE], mutual[0, t, t], mutual[1, t, t] = string.placed(bank, size)
        for o in range(t):
            below, aside = string.between(bank, size, row, string.row_of(o))
            mutual[0, t, o], mutual[0, o, t] = below, below
            mutual[1, t, o], mutual[1, o, t] = aside, aside
    for _ in range(SWEEPS):
        change, most = 0.0, 0.0
        for t in range(count):
            own, touch, found = state.contact[t], touches[t], solved[t]
            below, aside = found[BELOW], found[BESIDE]
            for o in range(count):
                if o != t:
                    below += mutual[0, t, o] * solved[o, LOAD]
                    aside += mutual[1, t, o] * solved[o, SIDE_FORCE]
            before, before_side = found[LOAD], found[SIDE_FORCE]
            found[NEW_S], found[NEW_ETA], found[LOAD] = press.press(
                found[SURFACE] - below,
                mutual[0, t, t],
                found[NEW_S],
                own[S],
                own[ETA],
                touch[K1],
                touch[K2],
                own[REST],
                touch[LOSS] / sensor.scalars[STEP],
            )
            if turn == 0:
                _rub(sensor.scalars, touch, own, state.asked[t], found, aside, mutual[1, t, t])
            change = max(change, abs(found[LOAD] - before) + abs(found[SIDE_FORCE] - before_side))
            most = max(most, found[LOAD])
        if count == 1 or change <= ALIKE * most:
            break
    spread = 0.0
    for t in range(count):
        if count > 1:
            string.take(bank, size, string.row_of(t))
        kept = 0.0 if t == 0 else 1.0
        spread = string.pushed(bank, size, solved[t, LOAD], solved[t, SIDE_FORCE], kept)
    return spread


@part.part
def _foresee(bank: Floats, size: int, step: float, touch: Floats, own: Floats, found: Floats) -> float:
    """Guess what the touch at hand will do in a sample, and return what that adds to the stretch sum."""
    below, ease, cross, square = string.foreseen(bank, size)
    gap = found[SURFACE] - below
    k1, k2, rest, loss = touch[K1], touch[K2], own[REST], touch[LOSS] / step
    s = press.guess(gap, ease, own[S], own[ETA], k1, k2)
    found[NEW_S], _, load = press.press(gap, ease, s, own[S], own[ETA], k1, k2, rest, loss)
    found[LOAD] = load
    return load * (2.0 * cross + load * square)


@part.part
def _step(sensor: Sensor, state: State, size: int, solved: Floats, mutual: Floats, index: int) -> None:
    """Take one step of the whole sensor."""
    scalars, bank, memory = sensor.scalars, state.bank, state.memory
    count, step = sensor.touches.shape[0], scalars[STEP]
    linear = sensor.integers[LAW] == 1
    first = ebow.drive(sensor.ebows[0], state.coils[0], memory[COIL_1])
    second = ebow.drive(sensor.ebows[1], state.coils[1], memory[COIL_2])
    shake = 0.0
    if sensor.sound.size > 0:
        shake = scalars[SHAKE] * sensor.sound[(index // sensor.integers[FINER]) % sensor.sound.size]
    guess, yields = string.carry(bank, size, first, second, shake)
    drifted = scalars[DRIFT] + scalars[DRIFT_RATE] * ((index // TICK) * TICK) * step
    taken = memory[TUNED] - scalars[TENSION] - drifted
    if not linear:
        guess -= yields * (scalars[STRETCH] * (memory[SPREAD] + guess) - 2.0 * taken)
    past = (index % TICK + 1.0) / TICK
    for t in range(count):
        asked, ahead, found, own = state.asked[t], state.ahead[t], solved[t], state.contact[t]
        travel = ahead[motion.PLACE] - asked[motion.PLACE]
        if travel != 0.0:
            string.slide(bank, size, string.row_of(t))
        if travel != 0.0 or count > 1:
            string.take(bank, size, string.row_of(t))
        depth = asked[motion.DEPTH] + past * (ahead[motion.DEPTH] - asked[motion.DEPTH])
        found[SURFACE] = depth + own[HEIGHT]
        found[ALONG_SPEED] = 0.0 if sensor.touches[t, ROLLS] != 0.0 else travel / (TICK * step)
        found[ROLLED] = travel / TICK if sensor.touches[t, ROLLS] != 0.0 else 0.0
        found[SIDE_FORCE] = 0.0
        guess += _foresee(bank, size, step, sensor.touches[t], own, found)
    tension, slope, guess = 0.0, memory[SLOPE], max(0.0, guess)
    before, came, low, high = 0.0, 0.0, 0.0, np.inf
    for turn in range(MOST):
        if not linear:
            tension = max(0.5 * scalars[STRETCH] * (memory[SPREAD] + guess) - taken, -SLACK / memory[KICK])
        spread = string.pulled(bank, size, tension, memory[KICK])
        memory[ROUNDS] += 1.0
        if count > 0:
            spread = _touch(sensor, state, size, solved, mutual, turn)
        if turn == 1 and abs(guess - before) > TELLING * spread:
            slope = (spread - came) / (guess - before)
        agreed = linear or abs(spread - guess) <= scalars[AGREED] * spread
        if agreed:
            break
        before, came = guess, spread
        if spread > guess:
            low = guess
        else:
            high = guess
        guess = (spread - slope * guess) / (1.0 - slope)
        if not low < guess < high:
            guess = 0.5 * (low + high) if high < np.inf else 2.0 * spread
    guess = spread
    memory[SLOPE] = min(0.5, max(-0.5, slope))
    memory[SPREAD] = guess
    memory[COIL_1], memory[COIL_2], memory[NEAR], memory[FAR] = string.arrive(bank, size, tension)
    for t in range(count):
        _remember(sensor.touches[t], state.contact[t], solved[t], step, sensor.integers[SEED] + 16 * t)


@part.part
def _remember(touch: Floats, own: Floats, found: Floats, step: float, seed: int) -> None:
    """Keep what a touch has become, and let its path over the object and its labels follow."""
    load = found[LOAD]
    lost = found[LEFT] - (found[Z_NEW] - own[Z])
    lost_along = found[LEFT_ALONG] - (found[Z_NEW_ALONG] - own[Z_ALONG])
    own[S], own[ETA], own[NOW] = found[NEW_S], found[NEW_ETA], load
    own[Z], own[Z_ALONG], own[PULL_ALONG] = found[Z_NEW], found[Z_NEW_ALONG], found[ALONG_FORCE]
    own[SIDE], own[STATE] = found[ASIDE], found[GRIPS]
    own[SLIP] = np.sqrt(found[LEFT] ** 2 + found[LEFT_ALONG] ** 2) / step
    began = load > 0.0 and own[SINCE] >= HOLD
    own[SINCE] = 0.0 if load > 0.0 else own[SINCE] + step
    gone, gone_along = 0.0, 0.0
    if own[SINCE] < HOLD:
        own[PATH] += lost
        own[PATH_ALONG] += lost_along
        own[ROLL] += found[ROLLED]
        if began:
            own[LAG], own[SLOW], own[MARK] = own[PATH], own[PATH], own[PATH]
            own[LAG_ALONG], own[SLOW_ALONG], own[MARK_ALONG] = (
                own[PATH_ALONG],
                own[PATH_ALONG],
                own[PATH_ALONG],
            )
        along = own[PATH_ALONG] + own[ROLL]
        if abs(own[PATH] - own[READ]) + abs(along - own[READ_ALONG]) > FINE:
            scale = 1.0 / touch[ROUGH_LENGTH]
            own[HEIGHT] = touch[ROUGH] * roughness.height(seed, scale * own[PATH], scale * along)
            own[READ], own[READ_ALONG] = own[PATH], along
        keep = step / SWING
        own[LAG] += keep * (own[PATH] - own[LAG])
        own[SLOW] += keep * (own[LAG] - own[SLOW])
        own[LAG_ALONG] += keep * (own[PATH_ALONG] - own[LAG_ALONG])
        own[SLOW_ALONG] += keep * (own[LAG_ALONG] - own[SLOW_ALONG])
        gone, gone_along = friction.played(
            friction.PLAY, own[SLOW], own[SLOW_ALONG], own[MARK], own[MARK_ALONG]
        )
        own[MARK] += gone
        own[MARK_ALONG] += gone_along
    keep = step / SPEEDING
    own[ACROSS] += keep * (gone / step - own[ACROSS])
    own[ALONG] += keep * (gone_along / step - own[ALONG])
    own[MEAN] += step / HOLD * (load - own[MEAN])


@part.part
def _hear(sensor: Sensor, state: State, size: int, out: Out, frame: int, index: int) -> None:
    """Write one frame: microphones and labels."""
    memory, seed = state.memory, sensor.integers[SEED]
    taut = memory[TUNED] / sensor.scalars[TENSION]
    air = 0.0
    if sensor.sound.size > 0:
        air = float(sensor.sound[index % sensor.sound.size])
    first, second = pickup.mixed(sensor.pickup, taut * memory[NEAR], taut * memory[FAR], air)
    first = pickup.amplified(sensor.pickup, state.band[0], first)
    second = pickup.amplified(sensor.pickup, state.band[1], second)
    hiss = sensor.pickup[pickup.HISS]
    out.microphones[0, frame] = pickup.converted(first + hiss * pickup.bell(seed, 4 * index))
    out.microphones[1, frame] = pickup.converted(second + hiss * pickup.bell(seed, 4 * index + 2))
    past = ((index * sensor.integers[FINER]) % TICK) / TICK
    for t in range(sensor.touches.shape[0]):
        own, asked, ahead = state.contact[t], state.asked[t], state.ahead[t]
        touching = 1 if own[SINCE] < HOLD else 0
        if own[ON] != touching:
            own[ON] = float(touching)
            memory[QUIET] = 0.0
            memory[SETTLED] = 0.0
        slow = np.sqrt(own[ACROSS] ** 2 + own[ALONG] ** 2)
        out.contact[t, frame] = touching
        out.position[t, frame] = asked[motion.PLACE] + past * (ahead[motion.PLACE] - asked[motion.PLACE])
        out.force[t, frame] = own[MEAN] * touching
        out.slip[t, frame] = 1 if touching == 1 and slow > SLIPPING else 0
        out.across[t, frame] = own[ACROSS]
        out.along[t, frame] = own[ALONG]
        out.friction[t, frame] = int(own[STATE])
    _settle(memory, first, second, sensor.scalars[STEP] * sensor.integers[FINER])
    out.settled[frame] = int(memory[SETTLED])


@part.part
def _settle(memory: Floats, first: float, second: float, period: float) -> None:
    """Compare a brief and a long level of both channels; alike for a while, they are settled until a change."""
    memory[BRIEF_1] += period / BRIEF * (first * first - memory[BRIEF_1])
    memory[BRIEF_2] += period / BRIEF * (second * second - memory[BRIEF_2])
    memory[LONG_1] += period / LONG * (first * first - memory[LONG_1])
    memory[LONG_2] += period / LONG * (second * second - memory[LONG_2])
    apart_1 = abs(memory[BRIEF_1] - memory[LONG_1]) > SAME * (memory[LONG_1] + SILENCE)
    apart_2 = abs(memory[BRIEF_2] - memory[LONG_2]) > SAME * (memory[LONG_2] + SILENCE)
    memory[QUIET] = 0.0 if apart_1 or apart_2 else memory[QUIET] + period
    if memory[QUIET] >= CALM:
        memory[SETTLED] = 1.0


@part.part
def _one(sensor: Sensor, state: State, out: Out, size: int, start: int) -> None:
    """Run one sensor for as many frames as `out` holds; `start` is the index of the first."""
    finer = sensor.integers[FINER]
    for frame in range(out.settled.size):
        for sub in range(finer):
            index = (start + frame) * finer + sub
            if index % TICK == 0:
                _look(sensor, state, size, index)
            _step(sensor, state, size, state.solved, state.mutual, index)
        _hear(sensor, state, size, out, frame, start + frame)


PARTS = part.fingerprint(
    [sys.modules[__name__], layout, ebow, friction, motion, part, pickup, press, roughness, string]
)


@lru_cache(maxsize=None)
def kernel(size: int, parts: int = PARTS) -> Callable[[Sensor, State, Out, Integers, int, int], int]:
    """Compile the kernel for a bank of `size`; `parts` lets their cache know them by their text."""

    @njit(cache=True, fastmath=part.FAST, error_model="numpy", nogil=True, _nrt=False)
    def run(many: Sensor, states: State, outs: Out, starts: Integers, first: int, stop: int) -> int:
        for i in range(first, stop):
            sensor = Sensor(
                many.scalars[i], many.integers[i], many.ebows[i], many.pickup[i], many.gates[i], many.sound[i],
                many.touches[i], many.keys[i], many.counts[i], many.weights[i], many.tables[i],
            )  # fmt: skip
            state = State(
                states.bank[i], states.contact[i], states.asked[i], states.ahead[i], states.coils[i],
                states.band[i], states.memory[i], states.solved[i], states.mutual[i],
            )  # fmt: skip
            out = Out(
                outs.microphones[i], outs.contact[i], outs.position[i], outs.force[i], outs.slip[i],
                outs.across[i], outs.along[i], outs.friction[i], outs.settled[i],
            )  # fmt: skip
            _one(sensor, state, out, size, starts[i])
        return parts

    return run
