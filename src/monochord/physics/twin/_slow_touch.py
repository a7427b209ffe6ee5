"""A touch in the readable reference: how it presses, rubs and slides on."""

from collections.abc import Callable
from math import exp, floor, hypot, sqrt

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin import bank as layout
from monochord.physics.twin import friction, motion, roughness
from monochord.physics.twin import memory as k
from monochord.physics.twin.memory import Sensor, State

ALIKE = 1e-14
"""Relative change at which tension, and several touches among themselves, have settled."""
MOST = 200
"""Most repetitions of either."""
GAUSS = ((-sqrt(0.6), 5.0 / 18.0), (0.0, 8.0 / 18.0), (sqrt(0.6), 5.0 / 18.0))
"""Nodes and weights: exact for the mean of a polynomial of degree five."""
BITS = (1 << 64) - 1


def touched(
    sensor: Sensor, state: State, bank: Floats, q: Floats, ease: Floats, found: Floats, *, rubbing: bool
) -> Floats:
    """Solve all touches in turn until none changes, and note what was found; return their modal force.

    Friction is solved in the first round of tension only, with `rubbing`, and held in those that follow.
    """
    half, step = q.size // 2, sensor.scalars[k.STEP]
    shapes = [bank[layout.SHAPE + layout.EACH * t, :half] for t in range(len(found))]
    press = sum((one[k.LOAD] * shape for one, shape in zip(found, shapes, strict=True)), np.zeros(half))
    rub = sum((one[k.SIDE_FORCE] * shape for one, shape in zip(found, shapes, strict=True)), np.zeros(half))
    for _ in range(MOST):
        before = found[:, [k.LOAD, k.SIDE_FORCE]].copy()
        for one, shape, own, touch, asked in zip(
            found, shapes, state.contact, sensor.touches, state.asked, strict=True
        ):
            press = press - shape * one[k.LOAD]
            below = float(shape @ (q[:half] + ease[:half] * press))
            one[k.NEW_S], one[k.NEW_ETA], one[k.LOAD] = _pressed(
                one[k.SURFACE] - below, float(shape**2 @ ease[:half]), own, touch, step
            )
            press = press + shape * one[k.LOAD]
            if rubbing:
                rub = rub - shape * one[k.SIDE_FORCE]
                aside = float(shape @ (q[half:] + ease[half:] * rub))
                _rubbed(sensor.scalars, touch, own, asked, one, aside, float(shape**2 @ ease[half:]))
                rub = rub + shape * one[k.SIDE_FORCE]
        change = np.abs(found[:, [k.LOAD, k.SIDE_FORCE]] - before)
        if len(found) <= 1 or change.max() <= ALIKE * found[:, k.LOAD].max():
            break
    return np.concatenate([press, rub])


def foreseen(
    touch: Floats, own: Floats, one: Floats, bank: Floats, t: int, q_free: Floats, step: float
) -> Floats:
    """Return the modal force of a touch that presses alone on a string that moves freely, (modes,) in N."""
    half = q_free.size // 2
    shape = bank[layout.SHAPE + layout.EACH * t, :half]
    gap = one[k.SURFACE] - float(shape @ q_free[:half])
    _, _, load = _pressed(gap, float(shape**2 @ bank[layout.PUSH_Q, :half]), own, touch, step)
    one[k.LOAD] = load
    return np.concatenate([shape * load, np.zeros(half)])


def _pressed(gap: float, ease: float, own: Floats, touch: Floats, step: float) -> tuple[float, float, float]:
    """Solve eta + ease force(eta) = gap for one touch; return s, eta and the force held over the step.

    The force is the rise of stored energy over that of eta, that is the mean elastic force over eta, and what
    Hunt and Crossley add while the object stays; when it leaves within the step, all stored is given.
    """
    k1, k2, rest, loss = (float(x) for x in (touch[k.K1], touch[k.K2], own[k.REST], touch[k.LOSS] / step))
    s_old, eta_old = float(own[k.S]), float(own[k.ETA])
    if gap <= 0.0 and s_old == 0.0:
        return 0.0, gap, 0.0

    def force_to(s: float) -> float:
        work = way = 0.0
        for node, weight in GAUSS:
            between = 0.5 * (s + s_old) + 0.5 * (s - s_old) * node
            slope = 2.0 * between + rest * between * (2.0 * k1 + 3.0 * k2 * between)
            work, way = work + weight * slope * _elastic(between, k1, k2), way + weight * slope
        mean = work / way if eta_old >= 0.0 else work * s / (way * s - eta_old)
        both = _elastic(s, k1, k2) + _elastic(s_old, k1, k2)
        return max(0.0, mean + 0.5 * loss * both * (s * s - s_old * s_old))

    if gap <= 0.0 or (s_old > 0.0 and ease * force_to(0.0) >= gap):
        given = s_old**4 * (0.5 * k1 + 0.4 * k2 * s_old) + 0.5 * rest * _elastic(s_old, k1, k2) ** 2
        lowest = gap - ease * given / eta_old
        eta = halved(lambda eta: eta + ease * given / (eta_old - eta) - gap, lowest, 0.0)
        return 0.0, eta, given / (eta_old - eta)
    s = halved(lambda s: approach(s, k1, k2, rest) + ease * force_to(s) - gap, 0.0, sqrt(gap))
    return s, approach(s, k1, k2, rest), force_to(s)


def _elastic(s: float, k1: float, k2: float) -> float:
    """Return the elastic force in N at a compression s^2."""
    return k1 * s**2 + k2 * s**3


def approach(s: float, k1: float, k2: float, rest: float) -> float:
    """Return eta in m: the compression s^2 and the give of the modes left out."""
    return s**2 + rest * _elastic(s, k1, k2)


def compressed(force: float, k1: float, k2: float) -> float:
    """Return s where the elastic force has a given value."""
    if force <= 0.0:
        return 0.0
    most = (force / k2) ** (1.0 / 3.0) if k2 > 0.0 else sqrt(force / k1)
    return halved(lambda s: _elastic(s, k1, k2) - force, 0.0, 1.01 * most)


def halved(rising: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a rising function between two numbers, to their last digit."""
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if rising(middle) > 0.0:
            high = middle
        else:
            low = middle


def _rubbed(
    scalars: Floats, touch: Floats, own: Floats, asked: Floats, one: Floats, aside: float, ease: float
) -> None:
    """Solve the bristles across and along the string under the touch's force, which is known by now."""
    load = one[k.LOAD]
    step, length, axial = scalars[k.STEP], scalars[k.LENGTH], scalars[k.AXIAL]
    place = asked[motion.PLACE]
    give = place * (length - place) / (axial * length) if axial > 0.0 else 0.0
    moved_across = asked[motion.SPEED] * step - (aside - own[k.SIDE])
    moved_along = one[k.ALONG_SPEED] * step + give * own[k.PULL_ALONG]
    across, along = [k.SIDE_FORCE, k.Z_NEW, k.LEFT], [k.ALONG_FORCE, k.Z_NEW_ALONG, k.LEFT_ALONG]
    one[across], one[along] = (0.0, 0.0, moved_across), (0.0, 0.0, moved_along)
    one[k.GRIPS], one[k.ASIDE] = friction.NONE, aside
    if load <= 0.0:
        return
    static, kinetic = touch[k.STATIC], touch[k.KINETIC]
    stiffness, speed = own[k.GRIP], own[k.SLIP]
    coefficient = kinetic + (static - kinetic) * exp(-((speed / touch[k.STRIBECK]) ** 2))
    longest = coefficient * load / stiffness
    stretched = hypot(own[k.Z], own[k.Z_ALONG]) / longest
    t = min(1.0, max(0.0, (stretched - friction.BREAKAWAY) / (1.0 - friction.BREAKAWAY)))
    creep = 3.0 * t**2 - 2.0 * t**3
    fade = creep * speed * step / longest
    damping = min(own[k.DAMP], 4.0 * stiffness / fade) if fade > 0.0 else own[k.DAMP]
    both = ((across, own[k.Z], moved_across, ease), (along, own[k.Z_ALONG], moved_along, give))
    for names, z, moved, yielding in both:
        # force = stiffness z_new + damping (z_new - z), z_new = (z + moved - yielding force) / (1 + fade)
        held = (stiffness + damping) / (1.0 + fade)
        force = (held * (z + moved) - damping * z) / (1.0 + yielding * held)
        left = moved - yielding * force
        one[names] = force, (z + left) / (1.0 + fade), left
    one[k.GRIPS] = friction.STICK if creep == 0.0 else friction.CREEP if creep < 1.0 else friction.SLIDE
    whole = hypot(one[k.SIDE_FORCE], one[k.ALONG_FORCE])
    if whole > static * load:
        for names, _, moved, yielding in both:
            force, z = one[names[:2]] * static * load / whole
            one[names] = force, z, moved - yielding * force
        one[k.GRIPS] = friction.SLIDE
    one[k.ASIDE] = aside + ease * one[k.SIDE_FORCE]


def remember(touch: Floats, own: Floats, one: Floats, step: float, seed: int) -> None:
    """Keep what a touch has become; its place on the object goes on by what the bristles lost."""
    lost = one[[k.LEFT, k.LEFT_ALONG]] - (one[[k.Z_NEW, k.Z_NEW_ALONG]] - own[[k.Z, k.Z_ALONG]])
    for memory, name in (
        (k.S, k.NEW_S), (k.ETA, k.NEW_ETA), (k.NOW, k.LOAD), (k.Z, k.Z_NEW), (k.Z_ALONG, k.Z_NEW_ALONG),
        (k.PULL_ALONG, k.ALONG_FORCE), (k.SIDE, k.ASIDE), (k.STATE, k.GRIPS),
    ):  # fmt: skip
        own[memory] = one[name]
    own[k.SLIP] = hypot(one[k.LEFT], one[k.LEFT_ALONG]) / step
    touches = one[k.LOAD] > 0.0
    place, lag = [k.PATH, k.PATH_ALONG], [k.LAG, k.LAG_ALONG]
    slow, mark = [k.SLOW, k.SLOW_ALONG], [k.MARK, k.MARK_ALONG]
    begins = touches and own[k.SINCE] >= k.HOLD
    own[k.SINCE] = 0.0 if touches else own[k.SINCE] + step
    gone = np.zeros(2)
    if own[k.SINCE] < k.HOLD:
        own[place] += lost
        own[k.ROLL] += one[k.ROLLED]
        if begins:
            own[lag], own[slow], own[mark] = own[place], own[place], own[place]
        along = own[k.PATH_ALONG] + own[k.ROLL]
        if abs(own[k.PATH] - own[k.READ]) + abs(along - own[k.READ_ALONG]) > k.FINE:
            own[k.HEIGHT] = height(touch, own, seed)
            own[k.READ], own[k.READ_ALONG] = own[k.PATH], along
        own[lag] += step / k.SWING * (own[place] - own[lag])
        own[slow] += step / k.SWING * (own[lag] - own[slow])
        far = float(np.hypot(*(own[slow] - own[mark])))
        if far > friction.PLAY:
            gone = (own[slow] - own[mark]) * (1.0 - friction.PLAY / far)
        own[mark] += gone
    own[[k.ACROSS, k.ALONG]] += step / k.SPEEDING * (gone / step - own[[k.ACROSS, k.ALONG]])
    own[k.MEAN] += step / k.HOLD * (one[k.LOAD] - own[k.MEAN])


def height(touch: Floats, own: Floats, seed: int) -> float:
    """Return a surface's height in m where it touches: octaves of random heights at whole numbers."""
    across = own[k.PATH] / touch[k.ROUGH_LENGTH]
    along = (own[k.PATH_ALONG] + own[k.ROLL]) / touch[k.ROUGH_LENGTH]
    total = 0.0
    for octave in range(roughness.OCTAVES):
        column, row = floor(across * 2**octave), floor(along * 2**octave)
        heights = [
            [
                (bits(own_key(seed, octave), ((column + i) << 24) + row + j) >> 11) / 2**52 - 1.0
                for j in (0, 1)
            ]
            for i in (0, 1)
        ]
        x, y = across * 2**octave - column, along * 2**octave - row
        x, y = 3.0 * x**2 - 2.0 * x**3, 3.0 * y**2 - 2.0 * y**3
        total += 0.5**octave * float(np.array([1.0 - x, x]) @ np.array(heights) @ np.array([1.0 - y, y]))
    return touch[k.ROUGH] * roughness.LEVEL * total


def own_key(seed: int, index: int) -> int:
    """Return a seed that nothing else of a neighbouring seed or index has."""
    return bits(seed, roughness.KEYS + index) >> 2


def bits(seed: int, index: int) -> int:
    """Return 64 bits by SplitMix64."""
    x = (seed * 0x9E3779B97F4A7C15 + index) & BITS
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & BITS
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & BITS
    return x ^ (x >> 31)
