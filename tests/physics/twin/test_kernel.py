"""The compiled kernel, the same kernel without a compiler, and the readable step are one scheme."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from tests.physics.twin.built import FOAM, PLASTIC, SENSOR, inside, key, modes, touch
from tests.physics.twin.reference import advance_slowly

from monochord.physics.twin import (
    ContactLaw,
    End,
    Mount,
    MountMode,
    Outside,
    Pluck,
    Scene,
    advance,
    begin,
    hold,
    retouch,
)
from monochord.physics.twin import records as layout
from monochord.physics.twin.jit import fingerprint

ROOT = Path(__file__).parents[3]
NOISE = Outside(samples=np.random.default_rng(1).uniform(-0.2, 0.2, 1000).astype(np.float32))
PRESS, ACROSS = hold(0.08, 1.0, PLASTIC), hold(0.08, 0.8, PLASTIC, across=0.02)
BOUNCE = touch(key(0.0, 0.08, 0.0, 1e-4), key(1e-3, 0.08, 2.0), key(2e-3, 0.08, 0.0, 1e-3))
PLUCK = Pluck(position=0.07, height=5e-4, angle=0.4)
MOUNT = Mount(modes=(MountMode(frequency=700.0), MountMode(mass=0.004, frequency=2500.0)), compliance=3e-6)
LAYER = ContactLaw(exponent=1.25, layer=2e-6)
SCENES = {
    "free": Scene(pluck=PLUCK, drivers=(False, False)),
    "ebows": Scene(pluck=PLUCK),
    "slides across": Scene(touches=(ACROSS,)),
    "slides along": Scene(touches=(touch(key(0.0, 0.08, 0.8), key(0.03, 0.082, 0.8), rolls=False),)),
    "rolls": Scene(touches=(touch(key(0.0, 0.08, 0.8), key(0.03, 0.085, 0.8)),)),
    "bounces": Scene(touches=(BOUNCE,)),
    "two": Scene(touches=(PRESS, hold(0.12, 0.5, FOAM))),
    "two at one place": Scene(touches=(PRESS, hold(0.08, 0.5, PLASTIC))),
    "linear": Scene(touches=(PRESS,), tension_law="linear"),
    "outside and drift": Scene(touches=(PRESS,), outside=NOISE),
    "yields, pulls and hums": Scene(touches=(replace(ACROSS, mount=MOUNT, law=LAYER),), pluck=PLUCK),
    "flat": Scene(touches=(replace(PRESS, law=ContactLaw(flat=2e-3)),)),
    "wide": Scene(touches=(replace(PRESS, law=ContactLaw(flat=2e-3, width=2e-3, layer=1e-6)),), pluck=PLUCK),
    "turns and slides": Scene(
        touches=(
            replace(
                touch(key(0.0, 0.08, 0.8), key(0.03, 0.082, 0.8), rolls=False),
                law=ContactLaw(exponent=1.3, arm=0.02),
                mount=MOUNT,
            ),
        )
    ),
    "two that turn": Scene(
        touches=(
            replace(PRESS, law=ContactLaw(flat=1e-3, width=1e-3)),
            replace(hold(0.12, 0.5, FOAM), law=ContactLaw(arm=0.02)),
        )
    ),
    "bounces in its mount": Scene(touches=(replace(BOUNCE, mount=MOUNT, law=LAYER),)),
    "two mounted": Scene(
        touches=(replace(PRESS, mount=MOUNT), replace(hold(0.12, 0.5, FOAM), law=LAYER)), outside=NOISE
    ),
}
SENSORS = {
    "outside and drift": replace(SENSOR, drift=0.25 * SENSOR.string.tension, drift_rate=1.0),  # at its limit
    "turns and slides": replace(SENSOR, press_tension=0.3),
    "yields, pulls and hums": replace(
        SENSOR,
        ends=(End(compliance=1e-6, admittance=1e-2, frequency=1500.0), End(compliance=5e-7)),
        drivers=tuple(replace(coil, bias=0.4, pull=60.0, level=3.0) for coil in SENSOR.drivers),
        pickups=replace(
            SENSOR.pickups, distortion=(0.01, -0.005), hum=(0.01, 0.02), feed=(0.5, -0.2), residual=True
        ),
    ),
}
"""Sensors of scenes that are not `SENSOR`."""
FRAMES = 150
SKIPPED = {"two": 75, "two that turn": 75, "two at one place": 120, "two mounted": 120}
"""Frames of the first that the kernel alone advances: two touches take the readable step many rounds."""


# Of two touches, one scene in the quick tests: they take the readable step many rounds.
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=pytest.mark.slow) if n in {"two", "two at one place", "two that turn"} else n
        for n in SCENES
    ],
)
def test_kernel_equals_the_readable_step(name: str) -> None:
    # Over some hundred frames sums in another order grow to some 1e-12 of the amplitude, and to 1e-7 where
    # an object slides and sticks; the kernel's rounds end at 1e-12 of the stretch.
    sensor = SENSORS.get(name, SENSOR)
    skipped = SKIPPED.get(name, 0)
    twin = advance(begin(sensor, SCENES[name], seed=5, tolerance=1e-12), skipped)[1]
    quick, after = advance(twin, FRAMES - skipped)
    slow, after_slowly = advance_slowly(twin, FRAMES - skipped)
    np.testing.assert_allclose(quick.microphones, slow.microphones, rtol=0.0, atol=2e-7)
    np.testing.assert_allclose(quick.labels.force, slow.labels.force, rtol=2e-6, atol=1e-7)
    np.testing.assert_allclose(quick.labels.reaction, slow.labels.reaction, rtol=2e-6, atol=2e-6)
    for label in ("contact", "slip", "friction", "settled", "position"):
        np.testing.assert_array_equal(getattr(quick.labels, label), getattr(slow.labels, label))
    for row in (layout.Q, layout.V):
        found, true = modes(after)[row], modes(after_slowly)[row]
        np.testing.assert_allclose(found, true, rtol=0.0, atol=1e-6 * np.abs(true).max())
    # Two objects at one place share their load in many small rounds, which end a little apart.
    for field in inside(after, "contact").dtype.names:
        found, true = inside(after, "contact")[field], inside(after_slowly, "contact")[field]
        np.testing.assert_allclose(found, true, rtol=1e-6, atol=1e-6, err_msg=field)
    if after.plausible is not None:
        for field in ("q", "v"):
            found, true = inside(after, "mount_modes")[field], inside(after_slowly, "mount_modes")[field]
            np.testing.assert_allclose(found, true, rtol=0.0, atol=1e-6 * np.abs(true).max(), err_msg=field)


def test_the_readable_step_goes_on_from_the_kernel() -> None:
    twin = begin(SENSOR, SCENES["slides across"], tolerance=1e-12)
    whole = advance(twin, 100)[0].microphones
    first, half_way = advance(twin, 90)
    second = advance_slowly(half_way, 10)[0]
    joined = np.concatenate([first.microphones, second.microphones], axis=1)
    np.testing.assert_allclose(joined, whole, atol=2e-7)


def test_default_agreement_is_far_below_what_is_heard() -> None:
    twin = begin(SENSOR, SCENES["ebows"])
    quick, slow = advance(twin, 400)[0].microphones, advance_slowly(twin, 400)[0].microphones
    np.testing.assert_allclose(quick, slow, atol=1e-5 * np.abs(slow).max())


@pytest.mark.parametrize(("before", "after"), [(1, 0), (2, 1), (1, 2)])
def test_kernel_equals_the_readable_step_after_other_touches(before: int, after: int) -> None:
    touches = (PRESS, hold(0.12, 0.5, PLASTIC))
    twin = advance(begin(SENSOR, Scene(touches=touches[:before]), seed=3, tolerance=1e-12), 2000)[1]
    twin = retouch(twin, touches[:after])
    quick, slow = advance(twin, 40)[0], advance_slowly(twin, 40)[0]
    np.testing.assert_allclose(quick.microphones, slow.microphones, rtol=0.0, atol=2e-6)
    assert not quick.labels.settled.any()


def test_a_step_takes_two_or_three_iterations() -> None:
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),)))
    after = advance(twin, 5000)[1]
    assert 1.0 <= inside(after, "memory").iterations / (5000 * twin.plan.oversampling) < 4.0


WITHOUT_COMPILER = """
import sys
import warnings
import numpy as np
from tests.physics.twin.test_kernel import SCENES, SENSOR, SENSORS
from monochord.physics.twin import advance, begin
warnings.simplefilter("ignore")  # integers of the random bits overflow, as they are meant to
sensor = SENSORS.get(sys.argv[1], SENSOR)
take, after = advance(begin(sensor, SCENES[sys.argv[1]], seed=5), 70)
np.save(sys.argv[2], np.concatenate([take.microphones, take.labels.force, take.labels.across]))
"""


@pytest.mark.parametrize("name", ["slides across", "two", "yields, pulls and hums", "turns and slides"])
@pytest.mark.slow
def test_the_kernel_runs_without_a_compiler_too(name: str, tmp_path: Path) -> None:
    path = tmp_path / "take.npy"
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(["src", "."])}
    subprocess.run([sys.executable, "-c", WITHOUT_COMPILER, name, str(path)], check=True, env=plain, cwd=ROOT)
    take = advance(begin(SENSORS.get(name, SENSOR), SCENES[name], seed=5), 70)[0]
    compiled = np.concatenate([take.microphones, take.labels.force, take.labels.across])
    np.testing.assert_allclose(np.load(path), compiled, rtol=1e-5, atol=1e-7)


def test_a_fingerprint_follows_the_text(tmp_path: Path) -> None:
    module = ModuleType("drawn")
    module.__file__ = str(tmp_path / "drawn.py")
    prints: list[int] = []
    for text in ("x = 1\n", "x = 2\n", "x = 1\n"):
        Path(module.__file__).write_text(text, encoding="utf-8")
        prints.append(fingerprint([module]))
    assert prints[0] == prints[2] != prints[1]
    assert 0 <= prints[0] < 1 << 62
