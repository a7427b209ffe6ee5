"""Mounts by class: their shares, and spring and modes that fit each other."""

import numpy as np
import pytest
from scipy.stats import binomtest, kstest

from monochord.physics.setup import MountKind
from monochord.physics.twin.held import CLASSES, drawn_mount

MOUNTS = [drawn_mount("plastic", seed) for seed in range(1000)]


def test_classes_come_as_often_as_stated() -> None:
    assert sum(one.share for one in CLASSES.values()) == pytest.approx(1.0)
    for kind, allowed in CLASSES.items():
        count = sum(mount.kind == kind for mount in MOUNTS)
        assert binomtest(count, len(MOUNTS), allowed.share).pvalue > 1e-3


@pytest.mark.parametrize("kind", CLASSES)
def test_spring_and_modes_fit_each_other(kind: MountKind) -> None:
    (low, high), (light, heavy) = CLASSES[kind].stiffness, CLASSES[kind].mass
    own = [mount for mount in MOUNTS if mount.kind == kind]
    springs = np.array([1.0 / mount.compliance for mount in own])
    assert kstest(np.log(springs / low) / np.log(high / low), "uniform").pvalue > 1e-4
    modes = [mode for mount in own for mode in mount.modes]
    mass, frequency = (np.array([getattr(mode, name) for mode in modes]) for name in ("mass", "frequency"))
    stiffness = mass * (2.0 * np.pi * frequency) ** 2
    for values, least, most in ((mass, light, heavy), (stiffness, low, high), (frequency, 300.0, 5000.0)):
        assert values.min() >= least * (1.0 - 1e-9)
        assert values.max() <= most * (1.0 + 1e-9)
    assert {len(mount.modes) for mount in own} == {1, 2, 3}
