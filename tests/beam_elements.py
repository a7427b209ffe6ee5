"""A sensor of beam elements, which shares no line with the twin nor with the finite differences beside it.

The string is a tensioned beam of cubic elements. A touch is part of it: an object's mass on a mount, joined
to the string by a spring that is linear in motion and grows with the press, and by a dashpot. Between two
presses the whole is linear but for its drivers, so that a matrix carries it exactly from sample to sample. A
driver feeds back the velocity under a coil, late by whole samples and cut off hard. Length, tension, losses,
object, drivers, noise and microphones are drawn by seed.

Petyt (1990), Introduction to Finite Element Vibration Analysis, chapter 3.
"""

from dataclasses import dataclass
from math import pi
from typing import Literal

import numba
import numpy as np
from scipy.linalg import eigh, expm
from tests.finite_differences import HELD, RATE, REST, Take

from monochord.core.types import Floats

LENGTH, DENSITY, TENSION, DIAMETER, YOUNG = 0.2, 3.978e-4, 65.0, 0.254e-3, 2e11
BENDING = YOUNG * pi * DIAMETER**4 / 64.0
ELEMENTS, MODES = 120, 32
STEPS, STEP = 6, 0.005
"""Steps in which a press comes and goes, and seconds that each lasts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Beam:
    """A string of `elements`, pinned at both ends; its last degree of freedom is the object's."""

    length: float
    elements: int = ELEMENTS

    def matrices(self) -> tuple[Floats, Floats, Floats]:
        """Return mass, bending stiffness and stiffness by unit tension, (m, m) without object and ends."""
        h = self.length / self.elements
        mass = np.array(
            [
                [156.0, 22.0 * h, 54.0, -13.0 * h],
                [22.0 * h, 4.0 * h * h, 13.0 * h, -3.0 * h * h],
                [54.0, 13.0 * h, 156.0, -22.0 * h],
                [-13.0 * h, -3.0 * h * h, -22.0 * h, 4.0 * h * h],
            ]
        )
        bend = np.array(
            [
                [12.0, 6.0 * h, -12.0, 6.0 * h],
                [6.0 * h, 4.0 * h * h, -6.0 * h, 2.0 * h * h],
                [-12.0, -6.0 * h, 12.0, -6.0 * h],
                [6.0 * h, 2.0 * h * h, -6.0 * h, 4.0 * h * h],
            ]
        )
        pull = np.array(
            [
                [36.0, 3.0 * h, -36.0, 3.0 * h],
                [3.0 * h, 4.0 * h * h, -3.0 * h, -h * h],
                [-36.0, -3.0 * h, 36.0, -3.0 * h],
                [3.0 * h, -h * h, -3.0 * h, 4.0 * h * h],
            ]
        )
        scaled = mass * DENSITY * h / 420.0, bend * BENDING / h**3, pull / (30.0 * h)
        every = np.zeros((3, 2 * self.elements + 2, 2 * self.elements + 2))
        for k in range(self.elements):
            at = slice(2 * k, 2 * k + 4)
            for whole, own in zip(every, scaled, strict=True):
                whole[at, at] += own
        mass, bend, pull = every
        return mass, bend, pull

    def shape(self, x: float) -> Floats:
        """Return the row (2 elements + 2,) whose product with the shape is its deflection at x."""
        h = self.length / self.elements
        k = min(int(x / h), self.elements - 1)
        s = x / h - k
        row = np.zeros(2 * self.elements + 2)
        row[2 * k : 2 * k + 4] = (
            1.0 - 3.0 * s**2 + 2.0 * s**3,
            h * (s - 2.0 * s**2 + s**3),
            3.0 * s**2 - 2.0 * s**3,
            h * (s**3 - s**2),
        )
        return row


@dataclass(frozen=True, slots=True, kw_only=True)
class Object:
    """What touches: its mass in kg on a mount in N/m, and its contact's spring by force, limit and loss."""

    mass: float = 0.1
    mount: float = 1e6
    softness: float = 1e-6
    hardest: float = 5e6
    loss: float = 0.2

    def spring(self, force: float) -> float:
        """Return the contact's stiffness: rough surfaces under the bodies' own, one after the other."""
        return 1.0 / (self.softness / force + 1.0 / self.hardest) if force > 0.0 else 0.0


class Basis:
    """The lowest modes of a string under tension with what touches it at x, and what they do at places."""

    def __init__(self, beam: Beam, tension: float, x: float, spring: float, thing: Object) -> None:
        mass, bend, pull = beam.matrices()
        stiff = bend + tension * pull
        size = len(mass) + 1
        self.mass, self.stiff = np.zeros((2, size, size))
        self.mass[:-1, :-1], self.stiff[:-1, :-1] = mass, stiff
        self.mass[-1, -1], self.stiff[-1, -1] = thing.mass, thing.mount
        self.press = np.append(beam.shape(x), -1.0)
        self.stiff += spring * np.outer(self.press, self.press)
        free = np.delete(np.arange(size), (0, size - 3))
        values, modes = eigh(
            self.stiff[np.ix_(free, free)], self.mass[np.ix_(free, free)], subset_by_index=(0, MODES - 1)
        )
        self.omega = np.sqrt(values)
        self.modes = np.zeros((size, MODES))
        self.modes[free] = modes
        self.dashpot = thing.loss * spring / (2.0 * pi * 1500.0)

    def propagator(self, losses: tuple[float, float], inputs: Floats) -> tuple[Floats, Floats]:
        """Return what carries deflections and velocities of the modes over a sample, and what forces add."""
        decay = np.diag(2.0 * (losses[0] + losses[1] * self.omega**2))
        own = self.press @ self.modes
        state = np.zeros((2 * MODES + inputs.shape[0], 2 * MODES + inputs.shape[0]))
        state[:MODES, MODES : 2 * MODES] = np.eye(MODES)
        state[MODES : 2 * MODES, :MODES] = -np.diag(self.omega**2)
        state[MODES : 2 * MODES, MODES : 2 * MODES] = -decay - self.dashpot * np.outer(own, own)
        state[MODES : 2 * MODES, 2 * MODES :] = (inputs @ self.modes).T
        over = np.asarray(expm(state / RATE), np.float64)
        return over[: 2 * MODES, : 2 * MODES].copy(), over[: 2 * MODES, 2 * MODES :].copy()

    def carried(self, state: Floats, other: "Basis") -> Floats:
        """Return a state of another basis in this one."""
        across = self.modes.T @ self.mass @ other.modes
        return np.concatenate((across @ state[:MODES], across @ state[MODES:]))

    @property
    def ends(self) -> Floats:
        """Of each mode the force on both supports, (2, modes)."""
        return np.stack((self.stiff[0] @ self.modes, self.stiff[-3] @ self.modes))


def take(seed: int, touches: int, law: Literal["linear", "geometric"] = "linear") -> Take:
    """Return a take of a sensor that is drawn by seed; `law` says how a press raises the tension."""
    random = np.random.default_rng(seed)
    beam = Beam(length=LENGTH * (1.0 + random.uniform(-0.017, 0.017)))
    length, tension = beam.length, TENSION * (1.0 + random.uniform(-0.02, 0.02)) ** 2
    rise = random.uniform(0.15, 0.6)
    thing = Object(
        mass=float(np.exp(random.uniform(*np.log((0.005, 0.3))))),
        mount=float(np.exp(random.uniform(*np.log((2e5, 1e7))))),
        softness=float(np.exp(random.uniform(*np.log((2e-7, 3e-6))))),
        hardest=float(np.exp(random.uniform(*np.log((1e6, 1e7))))),
        loss=random.uniform(0.05, 0.4),
    )
    losses = random.uniform(6.0, 16.0), random.uniform(2e-9, 2e-8)
    coils = np.array(
        [
            [random.uniform(0.010, 0.022), random.uniform(0.016, 0.034)],
            [length - random.uniform(0.010, 0.022), length - random.uniform(0.008, 0.022)],
        ]
    )
    late = np.array([random.integers(1, 4), random.integers(1, 3)])
    smooth = np.exp(
        -2.0 * pi * np.array([random.uniform(4000.0, 12000.0), random.uniform(6e3, 1.6e4)]) / RATE
    )
    coupled = np.exp(
        -2.0 * pi * np.array([random.uniform(100.0, 400.0), random.uniform(500.0, 1500.0)]) / RATE
    )
    gain, limit = random.uniform(0.04, 0.1, 2), random.uniform(0.001, 0.005, 2)
    inputs = np.zeros((2, 2 * beam.elements + 3))
    senses = np.zeros_like(inputs)
    for d in range(2):
        inputs[d, :-1], senses[d, :-1] = beam.shape(coils[d, 1]), beam.shape(coils[d, 0])
    drivers = np.stack((late.astype(float), smooth, coupled, gain, limit), axis=1)
    parts, labels = list[Floats](), list[tuple[int, float, float, float]]()
    now = Basis(beam, tension, length / 2.0, 0.0, thing)
    state, memory = np.zeros(2 * MODES), np.zeros((2, 16))

    def play(seconds: float, x: float, force: float) -> None:
        nonlocal now, state
        count = round(seconds * RATE)
        more = rise * force
        if law == "geometric" and force > 0.0:
            more = (
                YOUNG * pi * DIAMETER**2 / 4.0 * force**2 * x * (length - x) / (2.0 * (tension * length) ** 2)
            )
        basis = Basis(beam, tension + more, x, thing.spring(force), thing)
        state = basis.carried(state, now)
        over, drive = basis.propagator(losses, inputs)
        noise = 1e-7 * random.standard_normal((count, 2))
        parts.append(_run(over, drive, senses @ basis.modes, basis.ends, state, memory, drivers, noise))
        labels.append((count, force, x, force))
        now = basis

    play(1.0, length / 2.0, 0.0)
    for _ in range(touches):
        x, most = random.uniform(0.05, 0.15), random.uniform(0.15, 2.0)
        ramp = (np.arange(STEPS) + 0.5) / STEPS
        for share in ramp:
            play(STEP, x, most * share)
        play(HELD - 2 * STEPS * STEP, x, most)
        for share in ramp[::-1]:
            play(STEP, x, most * share)
        play(REST, x, 0.0)
    ends = np.concatenate(parts, axis=1)
    own, gains = random.uniform(0.75, 0.95, 2), random.uniform(0.7, 1.4, 2)
    heard = gains[:, None] * (own[:, None] * ends + (1.0 - own[:, None]) * ends[::-1])
    heard *= random.uniform(0.1, 0.6) / np.abs(heard).max()
    quiet = float(np.std(heard)) * 10.0 ** (-random.uniform(40.0, 60.0) / 20.0)
    sound = (heard + quiet * random.standard_normal(heard.shape)).astype(np.float32)
    force, position = (np.repeat([row[k] for row in labels], [row[0] for row in labels]) for k in (1, 2))
    contact = (force > 0.02).astype(float)
    position = np.where(contact > 0.0, position, np.nan)
    return Take(sound=sound, contact=contact, position=position, force=force, length=length)


@numba.njit
def _run(
    over: Floats,
    drive: Floats,
    senses: Floats,
    ends: Floats,
    state: Floats,
    memory: Floats,
    drivers: Floats,
    noise: Floats,
) -> Floats:
    """Return the end forces (2, frames), and leave the state as it is in the end.

    `memory` (2, 16) holds of each driver its filters' two states and what it has yet to give.
    """
    modes = senses.shape[1]
    heard = np.zeros((2, len(noise)))
    given = np.zeros(2)
    for frame in range(len(noise)):
        for d in range(2):
            late, smooth, coupled, gain, limit = drivers[d]
            speed = senses[d] @ state[modes:]
            memory[d, 0] = smooth * memory[d, 0] + (1.0 - smooth) * speed
            memory[d, 1] = coupled * memory[d, 1] + (1.0 - coupled) * memory[d, 0]
            given[d] = memory[d, 2] + noise[frame, d]
            for k in range(2, 2 + int(late)):
                memory[d, k] = memory[d, k + 1]
            memory[d, 1 + int(late)] = min(max(gain * (memory[d, 0] - memory[d, 1]), -limit), limit)
        state[:] = over @ state + drive @ given
        heard[:, frame] = ends @ state[:modes]
    return heard
