"""Simulated sound of the robot's motors and gripper in the sensor's frame, which must not look like slip."""

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import MetresPerSecond, Seconds
from monochord.dsp.noise import geared_motor

SLOWEST, FASTEST = 3.0, 60.0
"""Motor speed in revolutions per second at rest (position control), and at `FULL_SPEED` of the tool."""
FULL_SPEED: MetresPerSecond = 0.05
AT_REST = 0.1
"""Sound level at rest, relative to full speed."""
ELSEWHERE: tuple[Seconds, Seconds] = (0.1, 0.8)
"""Shortest and longest move of another motor, such as the gripper's, in s."""
INTERVAL: Seconds = 2.0
"""Mean time between two such moves, in s."""
SMOOTH: Seconds = 0.02
"""Time over which speeds are averaged, in s: gears do not start instantly."""


def motor_sound(random: np.random.Generator, path: Floats, sample_rate: int) -> Audio:
    """Return the sound (n,) float32 of motors moving a tool along a path (n, 3), x, y, z in m at every frame.

    The arm's motor turns in proportion to the tool's speed, with a level that goes as the square root of it.
    Another motor, unrelated to the string, runs now and then. Their rms at full speed is one. All levels are
    assumed.

    >>> rest = np.zeros((4410, 3))
    >>> motor_sound(np.random.default_rng(0), rest, 44100).shape
    (4410,)
    """
    count = len(path)
    width = max(1, round(SMOOTH * sample_rate))
    step = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1) * sample_rate
    total = np.cumsum(np.concatenate([np.zeros(width), step]))
    arm = np.minimum((total[width:] - total[:-width]) / width / FULL_SPEED, 1.0)
    other = np.zeros(count)
    at = random.exponential(INTERVAL)
    while at * sample_rate < count:
        length = random.uniform(*ELSEWHERE)
        first, last = round(at * sample_rate), min(round((at + length) * sample_rate), count)
        other[first:last] = np.sin(np.pi * np.arange(last - first) / max(1, last - first))
        at += length + random.exponential(INTERVAL)
    sound = np.zeros(count)
    for drive in (arm, other):
        speed = SLOWEST + drive * (FASTEST * random.uniform(0.5, 1.0) - SLOWEST)
        level = AT_REST + (1.0 - AT_REST) * np.sqrt(drive)
        motor = geared_motor(random, speed, float(sample_rate))
        sound += level * motor / np.sqrt(np.mean(motor**2))
    return sound.astype(np.float32)
