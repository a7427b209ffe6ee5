"""The bundled model and the switches tell a grip that swings at a node from a stroke across it."""

import numpy as np
import pytest

import monochord as mc
from monochord.core.types import Floats

STEP = 1e-3
FULL, STROKE = 0.5, 0.02
"""Time in s until the touch is pressed fully, and speed of the stroke in m/s."""
MISSED = pytest.mark.xfail(reason="docs/ROADMAP.md", raises=AssertionError)


def decided(place: float, force: Floats, across: Floats) -> float:
    """Return the share of windows after the press in which slip is decided, in the world ideal."""
    twin = mc.VirtualSensor("prototype", seed=0, world="ideal", objects=["plastic"])
    sound = [twin.advance(1.0)[0]]
    for begin in range(0, force.size, 10):
        part = slice(begin, begin + 10)
        rest = np.zeros((1, 10))
        keys = {"position": rest + place, "force": force[None, part], "clearance": rest}
        twin.lead(STEP, across=across[None, part], **keys)
        sound.append(twin.advance(10 * STEP)[0])
    heard = np.concatenate(sound, axis=1).astype(np.float32)
    updates = mc.listen(heard, model="demo", sensor="prototype", sample_rate=44100)
    return float(np.mean([each.decided["slip"] for each in updates if each.time > 1.0 + 2.0 * FULL]))


def moments() -> tuple[Floats, Floats]:
    """Every ms of two seconds, and a press that has its whole force after `FULL`."""
    time = np.linspace(STEP, 2.0, 2000)
    return time, np.minimum(time / FULL, 1.0)


@pytest.mark.parametrize("place", [0.2 / 3.0, 0.08, 0.1])
def test_at_a_node_a_swing_is_no_slip(place: float) -> None:
    time, pressed = moments()
    swing = np.where(time > FULL, 0.5 * np.sin(4.0 * np.pi * (time - FULL)), 0.0)
    assert decided(place, pressed + swing, np.zeros(time.size)) < 0.02


@pytest.mark.parametrize("place", [0.2 / 3.0, 0.08, pytest.param(0.1, marks=MISSED)])
def test_at_a_node_a_stroke_is_slip(place: float) -> None:
    time, pressed = moments()
    assert decided(place, pressed, np.where(time > FULL, STROKE, 0.0)) > 0.9
