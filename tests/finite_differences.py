"""A sensor by finite differences, which shares no line with the twin, for tests of what was learned there.

A stiff string on a grid, explicit in time; two drivers that feed back the velocity under a coil through a
first order band and a rational limiter; a touch that is a spring with a dashpot, stiffer the harder it
presses, and stretches the string; microphones that record the force on both supports.

Bilbao (2009), Numerical Sound Synthesis, chapters 6 and 7.
"""

from dataclasses import dataclass
from math import pi

import numba
import numpy as np
from scipy.signal import butter, sosfilt

from monochord.core.types import Audio, Floats

RATE, OVER, SEGMENTS = 44100, 12, 128
LENGTH, DENSITY, TENSION, DIAMETER, YOUNG = 0.2, 3.978e-4, 65.0, 0.254e-3, 2e11
REST, HELD, RAMP = 0.7, 0.6, 0.03
"""Seconds without and with a touch, and in which a touch grows and fades."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """Sound (2, n) and truth (n,): whether something touches, where in m, and with how many newtons.

    `length` is the string's in m.
    """

    sound: Audio
    contact: Floats
    position: Floats
    force: Floats
    length: float = LENGTH

    @property
    def touches(self) -> list[tuple[int, int]]:
        """The first frame and the last of each touch."""
        edges = np.flatnonzero(np.diff(self.contact, prepend=0.0, append=0.0)).tolist()
        return list(zip(edges[::2], edges[1::2], strict=True))

    def part(self, begin: int, end: int) -> "Take":
        """Return the frames from `begin` to `end`."""
        cut = slice(begin, end)
        return Take(
            sound=self.sound[:, cut],
            contact=self.contact[cut],
            position=self.position[cut],
            force=self.force[cut],
            length=self.length,
        )


def take(seed: int, touches: int, stiffness: tuple[float, float] = (8e4, 1e6)) -> Take:
    """Return a take of a sensor that is drawn by seed: drivers, microphones, losses, tuning and object.

    `stiffness` are the limits in N/m of the object's at 1 N.
    """
    random = np.random.default_rng(seed)
    tension = TENSION * (1.0 + random.uniform(-0.02, 0.02)) ** 2
    compliance = LENGTH / (YOUNG * pi * DIAMETER**2 / 4.0)
    hard = float(np.exp(random.uniform(*np.log(stiffness))))
    lossy = random.uniform(0.05, 0.4) / (2.0 * pi * 1500.0)
    count = round(RATE * (touches * (REST + HELD) + 1.0))
    contact, force, position = np.zeros(count), np.zeros(count), np.full(count, np.nan)
    tensions, places, springs = np.full(count, tension), np.full(count, 0.1), np.zeros(count)
    for number in range(touches):
        first = round(RATE * (1.0 + number * (REST + HELD)))
        own = slice(first, first + round(RATE * HELD))
        x, most = random.uniform(0.05, 0.15), random.uniform(0.15, 2.0)
        frames = np.arange(own.stop - own.start)
        pressed = most * np.minimum(1.0, np.minimum(frames, frames[::-1]) / (RAMP * RATE))
        bent = pressed * x * (LENGTH - x) / (tension * LENGTH)
        tensions[own] = tension + bent**2 * LENGTH / (2.0 * x * (LENGTH - x)) / compliance
        springs[own] = hard * np.cbrt(pressed)
        contact[own], position[own], force[own], places[own] = pressed > 0.02, x, pressed, x
    drivers = np.array(
        [
            [
                random.uniform(0.01, 0.025),
                random.uniform(0.015, 0.035),
                2.0 * pi * random.uniform(100.0, 600.0 + 1400.0 * far),
                2.0 * pi * random.uniform(1000.0 * (1 + far), 5000.0 + 3000.0 * far),
                random.uniform(0.03, 0.08),
                random.uniform(0.001, 0.008),
            ]
            for far in (0, 1)
        ]
    )
    drivers[1, :2] = LENGTH - drivers[1, :2]
    losses = random.uniform(5.0, 15.0), random.uniform(5e-5, 1.5e-4)
    ends = _run(tensions, places, springs, lossy, drivers, losses, seed)
    own, gains = random.uniform(0.8, 0.95, 2), random.uniform(0.7, 1.4, 2)
    heard = gains[:, None] * (own[:, None] * ends + (1.0 - own[:, None]) * ends[::-1])
    heard = sosfilt(butter(2, (40.0, 15000.0), "bandpass", fs=RATE, output="sos"), heard)
    heard *= random.uniform(0.1, 0.6) / np.abs(heard).max()
    sound = (heard + 3e-5 * random.standard_normal(heard.shape)).astype(np.float32)
    return Take(sound=sound, contact=contact, position=position, force=force)


@numba.njit
def _run(
    tensions: Floats,
    places: Floats,
    springs: Floats,
    lossy: float,
    drivers: Floats,
    losses: tuple[float, float],
    seed: int,
) -> Floats:
    np.random.seed(seed)  # noqa: NPY002  (inside the kernel there is no other)
    h, dt = LENGTH / SEGMENTS, 1.0 / (RATE * OVER)
    bend = YOUNG * pi * DIAMETER**4 / 64.0 / DENSITY / h**4
    push = dt * dt / (DENSITY * h)
    new, now, old = np.zeros(SEGMENTS + 1), np.zeros(SEGMENTS + 1), np.zeros(SEGMENTS + 1)
    bands = np.zeros((len(drivers), 2))
    ends = np.zeros((2, len(tensions)))
    for frame in range(len(tensions)):
        stretch, spring = tensions[frame] / DENSITY / h**2, springs[frame]
        for _ in range(OVER):
            for k in range(1, SEGMENTS):
                left = now[k - 2] if k > 1 else -now[1]
                right = now[k + 2] if k < SEGMENTS - 1 else -now[SEGMENTS - 1]
                curve, before = now[k + 1] - 2.0 * now[k] + now[k - 1], old[k + 1] - 2.0 * old[k] + old[k - 1]
                fourth = right - 4.0 * now[k + 1] + 6.0 * now[k] - 4.0 * now[k - 1] + left
                pull = stretch * curve - bend * fourth + 2.0 * losses[1] / h**2 * (curve - before) / dt
                held = 2.0 * now[k] - old[k] * (1.0 - losses[0] * dt) + dt * dt * pull
                new[k] = held / (1.0 + losses[0] * dt)
            for d in range(len(drivers)):
                coil, drive, low, high, gain, limit = drivers[d]
                k = int(coil / h)
                w = coil / h - k
                speed = ((1.0 - w) * (now[k] - old[k]) + w * (now[k + 1] - old[k + 1])) / dt
                bands[d, 0] += dt * high * (speed - bands[d, 0])
                bands[d, 1] += dt * low * (bands[d, 0] - bands[d, 1])
                wanted = gain * (bands[d, 0] - bands[d, 1])
                given = limit * wanted / (abs(wanted) + limit) + 1e-7 * (np.random.random() - 0.5)  # noqa: NPY002
                k = int(drive / h)
                w = drive / h - k
                new[k] += push * (1.0 - w) * given
                new[k + 1] += push * w * given
            if spring > 0.0:  # implicit in the new shape
                k = int(places[frame] / h)
                w = places[frame] / h - k
                there, earlier = (1.0 - w) * new[k] + w * new[k + 1], (1.0 - w) * old[k] + w * old[k + 1]
                rub = lossy * spring / (2.0 * dt)
                back = spring * there + rub * (there - earlier)
                back /= 1.0 + push * ((1.0 - w) ** 2 + w**2) * (spring + rub)
                new[k] -= push * (1.0 - w) * back
                new[k + 1] -= push * w * back
            old, now, new = now, new, old
        ends[0, frame] = tensions[frame] * now[1] / h
        ends[1, frame] = tensions[frame] * now[SEGMENTS - 1] / h
    return ends
