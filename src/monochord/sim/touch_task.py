"""A fingertip above a string, led by actions: its motion, its goals, and its reward."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import Literal

import numpy as np
from gymnasium.spaces import Box, Dict
from numpy.typing import ArrayLike

from monochord.core.errors import InputError
from monochord.core.ranges import Checked, Seed, Whole
from monochord.core.shapes import numbers
from monochord.core.types import Audio, Flags, Floats
from monochord.core.units import Metres, MetresPerSecond, Newtons, Seconds
from monochord.physics.twin.virtual_sensor import MAX_FORCE, VirtualSensor, advance_together
from monochord.physics.twin.world import World
from monochord.sim.observation import ObservationKind, Observer, observe
from monochord.sim.warm import Hop, StringSettings, warm_string

__all__ = ["Fingertips", "Task", "TouchSettings"]

Task = Literal["find", "hold", "follow"]
ALONG: MetresPerSecond = 0.05
DOWN: MetresPerSecond = 0.02
"""Speeds at an action of 1."""
REACH = 0.25, 0.75
"""Where the fingertip can be, in lengths of the string: the sensing range of `prototype`."""
GOALS = 0.3, 0.7
"""Where a goal can be, in lengths of the string."""
TRAVEL: Metres = 0.01
"""How far the hand can go up or down from where an episode begins; also the unit of that observation."""
OVERLOAD: Newtons = 5.0
"""An episode ends at this force, as a robot would stop."""
STIFFNESS = 600.0, 1800.0
"""Of the fingertip, in N/m, drawn evenly over its logarithm."""
PLACE_TOLERANCE: Metres = 0.01
"""Distance from the goal at which place is worth nothing."""
PIECE: Seconds = 5e-3
"""Longest time over which the fingertip's motion is taken as linear."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchSettings(Checked):
    """Settings of ``monochord/Touch-v0``.

    Parameters
    ----------
    task
        ``find``: come down from 2 to 6 mm, go to the goal, and press lightly, 0.3 to 0.6 N. ``hold``: press
        with 0.5 to 1.5 N on a string that goes up and down by up to 0.6 mm. ``follow``: press, and follow a
        goal that moves along the string at up to 4 cm/s.
    observation
        ``estimates`` of `model`, the last 0.1 s of ``sound``, or ``features``, those of `feature`.
    world
        ``ideal`` or ``plausible``, as of `mc.VirtualSensor`.
    builds
        Number of builds within the design's tolerances; each episode draws one. 0 is the design itself.
    first_build
        Seed of the first build, so that a policy can be tested on builds that it was not trained on.
    sensor, material, hop
        The sensor, the fingertip's material, and the duration of a step in s, 0.01 to 0.1.
    """

    task: Task = "follow"
    observation: ObservationKind = "estimates"
    world: World = "ideal"
    builds: Whole = 0
    first_build: Seed = 1
    sensor: str = "prototype"
    material: str = "plastic"
    model: str = "demo"
    feature: str = "fft_harmonic"
    hop: Hop = 0.02

    def string(self, build: int) -> StringSettings:
        """Return the string of a build, counted from 0."""
        return StringSettings(
            sensor=self.sensor,
            seed=build,
            build=self.first_build + build if self.builds else None,
            world=self.world,
            objects=(self.material,),
            observation=self.observation,
            model=self.model,
            feature=self.feature,
            hop=self.hop,
        )


class Fingertips:
    """Fingertips, each above a string of its own; all move one step at a time.

    Attributes
    ----------
    action_space
        Of one: speed along the string towards pickup 2, and speed down; 1 is 5 and 2 cm/s.
    observation_space
        Of one, a dictionary. ``touch``: what is observed of the string, see `monochord.sim.observation`.
        ``arm``: how far the hand has moved since the episode began, along the string in its lengths, and down
        in cm; where the string is, it does not know. ``goal``: place in lengths of the string, force in N.
    """

    def __init__(self, count: int, settings: TouchSettings) -> None:
        self.settings = settings
        first = warm_string(settings.string(0))
        self._pieces = ceil(settings.hop / PIECE - 1e-9)
        self.action_space = Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = Dict(
            touch=first.observer.space,
            arm=Box(-1.0, 1.0, (2,), np.float32),
            goal=Box(0.0, np.array([1.0, MAX_FORCE], np.float32), dtype=np.float32),
        )
        self._strings: list[tuple[VirtualSensor, Observer]] = [first.begun() for _ in range(count)]
        self._rows = np.stack([first.row] * count)
        self.length = np.full(count, first.sensor.sensor.string.length)
        self.time = np.zeros(count)
        self.place, self.start_place = np.zeros(count), np.zeros(count)
        """Place of the fingertip, in m from pickup 1."""
        self.travel = np.zeros(count)
        """How far the hand has come down, in m."""
        self._gap, self._stiffness = np.zeros(count), np.ones(count)
        self._goal, self._sway, self._bob = np.zeros((count, 2)), np.zeros((count, 3)), np.zeros((count, 3))
        self._begun = np.zeros(count, bool)
        self.truth: list[dict[str, float]] = [{} for _ in range(count)]

    def begin(self, number: int, rng: np.random.Generator) -> None:
        """Begin an episode of a fingertip."""
        settings, task = self.settings, self.settings.task
        warm = warm_string(settings.string(int(rng.integers(settings.builds)) if settings.builds else 0))
        self._strings[number], self._rows[number] = warm.begun(), warm.row
        length = self.length[number] = warm.sensor.sensor.string.length
        self.time[number] = self.travel[number] = 0.0
        self._stiffness[number] = np.exp(rng.uniform(*np.log(STIFFNESS)))
        self._gap[number] = rng.uniform(*((2e-3, 6e-3) if task == "find" else (1e-3, 2e-3)))
        force = rng.uniform(*((0.3, 0.6) if task == "find" else (0.5, 1.5)))
        swing = rng.uniform(0.005, 0.015) if task == "follow" else 0.0
        low, high = GOALS[0] * length + swing, GOALS[1] * length - swing
        self._goal[number] = rng.uniform(low, high), force
        self._sway[number] = swing, rng.uniform(0.1, 0.4), rng.uniform(0.0, 2.0 * pi)
        bob = rng.uniform(2e-4, 6e-4) if task == "hold" else 0.0
        self._bob[number] = bob, rng.uniform(0.2, 0.5), rng.uniform(0.0, 2.0 * pi)
        away = rng.uniform(-0.02, 0.02) if task == "find" else rng.uniform(-0.01, 0.01)
        place = self.goal()[number, 0] + away
        self.place[number] = self.start_place[number] = np.clip(place, REACH[0] * length, REACH[1] * length)
        self._begun[number], self.truth[number] = True, {}

    def goal(self) -> Floats:
        """Return place in m and force in N of each goal, (count, 2)."""
        moved = self._goal.copy()
        moved[:, 0] += _wave(self._sway, self.time)
        return moved

    def observer(self, number: int) -> Observer:
        """Return the observer of a string."""
        return self._strings[number][1]

    def height(self, number: int) -> Metres:
        """Return how far a fingertip is above the string at rest; below 0 it presses."""
        bob = _wave(self._bob, self.time)
        return float(self._gap[number] - self.travel[number] - bob[number])

    def observation(self) -> dict[str, Audio]:
        """Return the observations of all, (count, ...) by name."""
        arm = np.stack([(self.place - self.start_place) / self.length, self.travel / TRAVEL], axis=1)
        goal = self.goal() / np.stack([self.length, np.ones_like(self.length)], axis=1)
        return {
            "touch": self._rows.copy(),
            "arm": np.clip(arm, -1.0, 1.0).astype(np.float32),
            "goal": goal.astype(np.float32),
        }

    def step(self, actions: ArrayLike, numbers_of: Sequence[int] | None = None) -> tuple[Floats, Flags]:
        """Move fingertips by their actions for one step; the others wait.

        Parameters
        ----------
        actions
            (count, 2), -1 to 1; values beyond are taken as the nearest.
        numbers_of
            Which move; all by default.

        Returns
        -------
        rewards
            (count,), 0 to 1: half for the place and half for the force while the fingertip touches; 0 where
            the place is 1 cm off, or the force by as much as the goal's. 0 for those that wait.
        overloaded
            (count,), whether a force of 5 N was reached.

        Raises
        ------
        InputError
            For actions of another shape or that are not numbers, or before an episode has begun.
        """
        count = len(self._strings)
        chosen = list(range(count)) if numbers_of is None else list(numbers_of)
        moves = numbers(actions, float, "actions")
        if moves.shape != (count, 2) or not np.isfinite(moves[chosen]).all():
            given = f"actions of the shape {moves.shape}" if moves.shape != (count, 2) else "an action of NaN"
            raise InputError(given, f"({count}, 2) finite numbers, -1 to 1")
        if not self._begun[chosen].all():
            raise InputError("a step before an episode", "reset() first")
        rewards, overloaded = np.zeros(count), np.zeros(count, bool)
        if not chosen:
            return rewards, overloaded
        self._move(np.clip(moves, -1.0, 1.0), chosen)
        taken = self._advance([self._strings[number][0] for number in chosen])
        listening = [self._strings[number][1] for number in chosen]
        self._rows[chosen] = observe(listening, [sound for sound, _ in taken])
        goal = self.goal()
        for number, (_, labels) in zip(chosen, taken, strict=True):
            rewards[number] = self._reward(number, goal[number], labels)
            overloaded[number] = float(np.nan_to_num(labels["force"]).max()) >= OVERLOAD
        return rewards, overloaded

    def _move(self, moves: Floats, chosen: Sequence[int]) -> None:
        """Lead the strings' objects by the fingertips' motion over a step."""
        hop, steps = self.settings.hop, self._pieces
        share = np.arange(1, steps + 1) / steps
        low, high = REACH[0] * self.length, REACH[1] * self.length
        place = np.clip(self.place + ALONG * hop * moves[:, 0], low, high)
        travel = np.clip(self.travel + DOWN * hop * moves[:, 1], -TRAVEL, TRAVEL)
        places = self.place[:, np.newaxis] + np.outer(place - self.place, share)
        travels = self.travel[:, np.newaxis] + np.outer(travel - self.travel, share)
        times = self.time[:, np.newaxis] + hop * share
        heights = self._gap[:, np.newaxis] - travels - _wave(self._bob, times)
        forces = np.clip(-heights * self._stiffness[:, np.newaxis], 0.0, MAX_FORCE)
        for number in chosen:
            self._strings[number][0].lead(
                hop / steps,
                position=places[number : number + 1],
                force=forces[number : number + 1],
                clearance=np.maximum(heights[number : number + 1], 0.0),
            )
        self.place[chosen], self.travel[chosen] = place[chosen], travel[chosen]
        self.time[chosen] += hop

    def _advance(self, sensors: Sequence[VirtualSensor]) -> list[tuple[Audio, dict[str, Floats]]]:
        if len(sensors) == 1:
            return [sensors[0].advance(self.settings.hop)]
        return advance_together(sensors, self.settings.hop)

    def _reward(self, number: int, goal: Floats, labels: dict[str, Floats]) -> float:
        """Return the reward of a step, and keep its truth."""
        touched = labels["contact"][-1] > 0.0
        force = float(labels["force"][-1]) if touched else 0.0
        off = float(self.place[number] - goal[0])
        self.truth[number] = {
            "contact": float(touched),
            "position": float(self.place[number]),
            "force": force,
            "position_error": off,
            "force_error": force - float(goal[1]),
        }
        if not touched:
            return 0.0
        place_off, force_off = abs(off) / PLACE_TOLERANCE, abs(force - goal[1]) / goal[1]
        return 0.5 * max(1.0 - place_off, 0.0) + 0.5 * max(1.0 - float(force_off), 0.0)


def _wave(wave: Floats, time: Floats) -> Floats:
    """Return the sines of (amplitude, frequency, phase) at times, (count,) or (count, k)."""
    amplitude, frequency, phase = wave.T if time.ndim == 1 else wave.T[:, :, np.newaxis]
    return amplitude * np.sin(2.0 * pi * frequency * time + phase)
