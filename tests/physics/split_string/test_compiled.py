"""The compiled kernel does the reference's arithmetic."""

import numpy as np
import pytest

from monochord.core.types import Contact, Floats
from monochord.physics.split_string import Drive, SplitString, compiled, reference, simulate
from monochord.physics.strings import load_string

APPENDIX = load_string("appendix").string


def state(drivers: int, nodes: int = 64, steps: int = 301) -> list[Floats]:
    random = np.random.default_rng(drivers)
    now, before = random.standard_normal((2, nodes)) * 1e-4
    now[[0, -1]] = before[[0, -1]] = 0.0
    loads = random.standard_normal((drivers, nodes)) * 1e-7
    return [now, before, loads, random.uniform(-1.0, 1.0, (drivers, steps)), np.empty((drivers, steps))]


@pytest.mark.parametrize("drivers", [1, 2])
def test_both_kernels_agree_to_rounding(drivers: int) -> None:
    results: list[Floats] = []
    for kernel in (reference.leapfrog, compiled.leapfrog):
        now, before, loads, signals, heard = state(drivers)
        nodes, weights = np.array([13, 40][:drivers]), np.array([0.25, 0.9][:drivers])
        kernel(now, before, (1.3, 0.349, -0.999), loads, signals, nodes, weights, heard)
        results.append(np.concatenate((now, before, heard.ravel())))
    assert np.abs(results[0]).max() > 1e-5
    assert results[1] == pytest.approx(results[0], rel=1e-12, abs=1e-17)


@pytest.mark.parametrize("contact", [Contact(position=0.2275, force=1.0), None])
def test_the_whole_simulation_agrees_to_rounding(contact: Contact | None) -> None:
    setup = SplitString(
        string=APPENDIX,
        contact=contact,
        nodes=96,
        time_step=5e-6,
        drive=Drive(start_frequencies=(700.0, 370.0), window=0.02, hop=0.01),
    )
    slow, fast = (simulate(setup, 0.06, route=route) for route in ("reference", "fdtd"))
    scale = np.abs(slow.microphones).max()
    assert scale > 0.1
    assert np.abs(fast.microphones - slow.microphones).max() < 1e-11 * scale
    assert fast.drive_frequencies == pytest.approx(slow.drive_frequencies, rel=1e-11)
