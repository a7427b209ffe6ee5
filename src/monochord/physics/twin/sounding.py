"""A frame of the twin: what the microphones hear and what is true, and whether the sound has settled."""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin import motion, pickup
from monochord.physics.twin.memory import (
    ACROSS,
    ALONG,
    BRIEF,
    BRIEF_1,
    BRIEF_2,
    CALM,
    FAR,
    FINER,
    HOLD,
    LONG,
    LONG_1,
    LONG_2,
    MEAN,
    NEAR,
    NOW,
    ON,
    QUIET,
    SAME,
    SEED,
    SETTLED,
    SILENCE,
    SINCE,
    SLIPPING,
    STATE,
    STEP,
    TENSION,
    TICK,
    TUNED,
    Out,
    Sensor,
    State,
)
from monochord.physics.twin.part import part


@part
def settle(memory: Floats, first: float, second: float, period: float) -> None:
    """Call the sound settled when brief and long levels of both channels have been alike for a while."""
    memory[BRIEF_1] += period / BRIEF * (first * first - memory[BRIEF_1])
    memory[BRIEF_2] += period / BRIEF * (second * second - memory[BRIEF_2])
    memory[LONG_1] += period / LONG * (first * first - memory[LONG_1])
    memory[LONG_2] += period / LONG * (second * second - memory[LONG_2])
    apart_1 = abs(memory[BRIEF_1] - memory[LONG_1]) > SAME * (memory[LONG_1] + SILENCE)
    apart_2 = abs(memory[BRIEF_2] - memory[LONG_2]) > SAME * (memory[LONG_2] + SILENCE)
    memory[QUIET] = 0.0 if apart_1 or apart_2 else memory[QUIET] + period
    if memory[QUIET] >= CALM:
        memory[SETTLED] = 1.0


@part
def hear(sensor: Sensor, state: State, out: Out, frame: int, index: int) -> None:
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
        out.reaction[t, frame] = own[NOW]
        out.slip[t, frame] = 1 if touching == 1 and slow > SLIPPING else 0
        out.across[t, frame] = own[ACROSS]
        out.along[t, frame] = own[ALONG]
        out.friction[t, frame] = int(own[STATE])
    settle(memory, first, second, sensor.scalars[STEP] * sensor.integers[FINER])
    out.settled[frame] = int(memory[SETTLED])
