"""The touches of the twin: laid on the string, foreseen, solved together and remembered."""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin import friction, motion, press, roughness, string
from monochord.physics.twin.memory import (
    ACROSS,
    ALIKE,
    ALONG,
    ALONG_FORCE,
    ALONG_SPEED,
    ASIDE,
    AXIAL,
    BELOW,
    BESIDE,
    DAMP,
    ETA,
    FINE,
    GRIP,
    GRIPS,
    HEIGHT,
    HOLD,
    K1,
    K2,
    KINETIC,
    LAG,
    LAG_ALONG,
    LEAST,
    LEFT,
    LEFT_ALONG,
    LENGTH,
    LOAD,
    LOSS,
    MARK,
    MARK_ALONG,
    MASS,
    MEAN,
    NEW_ETA,
    NEW_S,
    NOW,
    PATH,
    PATH_ALONG,
    PULL_ALONG,
    READ,
    READ_ALONG,
    REST,
    ROLL,
    ROLLED,
    ROLLS,
    ROUGH,
    ROUGH_LENGTH,
    SEED,
    SIDE,
    SIDE_FORCE,
    SINCE,
    SLIP,
    SLOW,
    SLOW_ALONG,
    SPEEDING,
    STATE,
    STATIC,
    STEP,
    STRIBECK,
    SURFACE,
    SWEEPS,
    SWING,
    TANGENT,
    TENSION,
    TICK,
    TUNED,
    Z_ALONG,
    Z_NEW,
    Z_NEW_ALONG,
    S,
    Sensor,
    State,
    Z,
)
from monochord.physics.twin.part import called, part


@called
def lay(sensor: Sensor, state: State, size: int, t: int) -> None:
    """Lay a touch on the string for a tick: its depth, its modes' shapes and its bristles."""
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
            roughness.surface(sensor.integers[SEED], t),
            scale * own[PATH],
            scale * (own[PATH_ALONG] + own[ROLL]),
        )


@part
def rub(
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


@part
def foresee(bank: Floats, size: int, step: float, touch: Floats, own: Floats, found: Floats) -> float:
    """Guess what the touch at hand will do in a sample, and return what that adds to the stretch sum."""
    below, ease, cross, square = string.foreseen(bank, size)
    gap = found[SURFACE] - below
    k1, k2, rest, loss = touch[K1], touch[K2], own[REST], touch[LOSS] / step
    s = press.guess(gap, ease, own[S], own[ETA], k1, k2)
    found[NEW_S], _, load = press.press(gap, ease, s, own[S], own[ETA], k1, k2, rest, loss)
    found[LOAD] = load
    return load * (2.0 * cross + load * square)


@part
def prepare(sensor: Sensor, state: State, size: int, past: float) -> float:
    """Move the touches on to a share of their tick; return what they are to add to the stretch sum."""
    bank, count, step = state.bank, sensor.touches.shape[0], sensor.scalars[STEP]
    added = 0.0
    for t in range(count):
        asked, ahead, found, own = state.asked[t], state.ahead[t], state.solved[t], state.contact[t]
        travel = ahead[motion.PLACE] - asked[motion.PLACE]
        if travel != 0.0:
            string.slide(bank, size, string.row_of(t))
        if travel != 0.0 or count > 1:
            string.take(bank, size, string.row_of(t))
        rolls = sensor.touches[t, ROLLS]
        found[SURFACE] = (
            asked[motion.DEPTH] + past * (ahead[motion.DEPTH] - asked[motion.DEPTH]) + own[HEIGHT]
        )
        found[ALONG_SPEED] = (1.0 - rolls) * travel / (TICK * step)
        found[ROLLED] = rolls * travel / TICK
        found[SIDE_FORCE] = 0.0
        added += foresee(bank, size, step, sensor.touches[t], own, found)
    return added


@part
def place_all(sensor: Sensor, state: State, size: int) -> None:
    """Find where the string would be at every touch, and what a newton at each gives it at each."""
    bank, mutual = state.bank, state.mutual
    count = sensor.touches.shape[0]
    for t in range(count):
        row, found = string.row_of(t), state.solved[t]
        if count > 1:
            string.take(bank, size, row)
        found[BELOW], found[BESIDE], mutual[0, t, t], mutual[1, t, t] = string.placed(bank, size)
        for o in range(t):
            below, aside = string.between(bank, size, row, string.row_of(o))
            mutual[0, t, o], mutual[0, o, t] = below, below
            mutual[1, t, o], mutual[1, o, t] = aside, aside


@part
def touch_one(sensor: Sensor, state: State, t: int, turn: int) -> float:
    """Solve one touch under the others' forces; return by how much its own changed, in N."""
    solved, mutual, own, touch = state.solved, state.mutual, state.contact[t], sensor.touches[t]
    found = solved[t]
    below, aside = found[BELOW], found[BESIDE]
    for o in range(sensor.touches.shape[0]):
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
        rub(sensor.scalars, touch, own, state.asked[t], found, aside, mutual[1, t, t])
    return abs(found[LOAD] - before) + abs(found[SIDE_FORCE] - before_side)


@part
def touch_all(sensor: Sensor, state: State, size: int, turn: int) -> float:
    """Solve all touches together, given the free positions, and let them push; return the stretch sum.

    Friction is solved in the first turn and held in those that follow.
    """
    bank, solved, count = state.bank, state.solved, sensor.touches.shape[0]
    place_all(sensor, state, size)
    for _ in range(SWEEPS):
        change, most = 0.0, 0.0
        for t in range(count):
            change = max(change, touch_one(sensor, state, t, turn))
            most = max(most, solved[t, LOAD])
        if count == 1 or change <= ALIKE * most:
            break
    spread = 0.0
    for t in range(count):
        if count > 1:
            string.take(bank, size, string.row_of(t))
        kept = 0.0 if t == 0 else 1.0
        spread = string.pushed(bank, size, solved[t, LOAD], solved[t, SIDE_FORCE], kept)
    return spread


@part
def remember(touch: Floats, own: Floats, found: Floats, step: float, seed: int, t: int) -> None:
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
            own[HEIGHT] = touch[ROUGH] * roughness.height(
                roughness.surface(seed, t), scale * own[PATH], scale * along
            )
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
