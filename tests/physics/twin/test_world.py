"""The world `plausible`: drawn from its ranges by seed alone, each effect a switch; and the twin in it."""

from collections.abc import Callable
from dataclasses import fields, replace
from hashlib import sha256
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest
from tests.physics.twin.built import PLASTIC, key, modes, touch

from monochord.core.errors import InputError
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Mount, Pluck, Scene, advance, begin, hold
from monochord.physics.twin import records as layout
from monochord.physics.twin.variation import build, day
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.world import (
    Effects,
    World,
    only,
    plausible_build,
    plausible_day,
    plausible_touch,
    sensor_of,
)

DESIGN = load_sensor("prototype")
PRESS = hold(0.08, 1.0, PLASTIC)
BUILDS = [plausible_build(DESIGN, seed) for seed in range(300)]
TOUCHES = [plausible_touch(PRESS, seed) for seed in range(300)]
NAMES = [field.name for field in fields(Effects)]
OF_TOUCHES = {"mount", "law", "layer", "shape"}
OF_DAYS = {"tuning", "temperature"}


def even(values: Any, low: float, high: float, *, log: bool = False) -> None:
    """Values lie in a range, evenly over it or its logarithm: by chance one in 10,000 such checks fails."""
    values = np.asarray(values)
    assert values.min() >= low * (1.0 - 1e-9) if low > 0.0 else values.min() >= low
    assert values.max() <= high * (1.0 + 1e-9)
    share = np.log(values / low) / np.log(high / low) if log else (values - low) / (high - low)
    assert kstest(share, "uniform").pvalue > 1e-4


def decibels(values: Any) -> Any:
    return 20.0 * np.log10(np.abs(values))


@pytest.mark.parametrize(
    ("of", "low", "high", "log"),
    [
        (lambda s: s.string.length / DESIGN.string.length, 0.99, 1.01, False),
        (lambda s: s.measured_length - s.string.length, -5e-4, 5e-4, False),
        (lambda s: s.press_tension, 0.0, 0.3, False),
        (lambda s: s.drivers[0].level, 0.5, 8.0, True),
        (lambda s: s.drivers[1].bias, -0.5, 0.5, False),
        (lambda s: s.drivers[1].pull, 2.0, 40.0, True),
        (lambda s: 1.0 / s.ends[0].compliance, 3e5, 3e7, True),
        (lambda s: s.ends[1].admittance, 1e-4, 1e-2, True),
        (lambda s: decibels(s.pickups.distortion[0]), -70.0, -40.0, False),
        (lambda s: decibels(s.pickups.distortion[1]), -70.0, -40.0, False),
        (lambda s: decibels(0.1 / s.pickups.hiss), 30.0, 60.0, False),
        (lambda s: decibels(s.pickups.hum[1]), -80.0, -50.0, False),
        (lambda s: decibels(s.pickups.feed[0] * 2e-3), -80.0, -50.0, False),
    ],
)
def test_builds_fill_their_ranges(of: Callable[[Any], float], low: float, high: float, *, log: bool) -> None:
    even([of(one) for one in BUILDS], low, high, log=log)


def test_signs_and_mains_come_in_both_kinds() -> None:
    for kinds in (
        [one.pickups.distortion[0] > 0.0 for one in BUILDS],
        [one.pickups.feed[1] > 0.0 for one in BUILDS],
        [one.pickups.mains == 50.0 for one in BUILDS],
    ):
        assert 0.4 < np.mean(kinds) < 0.6


def test_days_are_retuned_and_warmed() -> None:
    tension = DESIGN.string.tension
    even([plausible_day(DESIGN, s, only("tuning")).drift - day(DESIGN, s).drift for s in range(300)],
         -0.06 * tension, 0.06 * tension)  # fmt: skip
    still = replace(DESIGN, changes=replace(DESIGN.changes, creep=0.0))
    warmed = [plausible_day(still, s, only("temperature")).drift for s in range(300)]
    assert np.std(warmed) == pytest.approx(0.955 * 8.0 * 0.1145, rel=0.15)
    assert np.abs(warmed).max() < 20.1 * 0.1145
    assert plausible_day(still, 1).changes == still.changes


def test_a_longer_string_sounds_at_its_pitch_and_keeps_its_coils() -> None:
    for one in BUILDS[:20]:
        assert open_frequency(one.string) == pytest.approx(open_frequency(DESIGN.string), rel=1e-9)
        assert one.drivers[0].sense == DESIGN.drivers[0].sense
        behind = DESIGN.string.length - DESIGN.drivers[1].sense
        assert one.string.length - one.drivers[1].sense == pytest.approx(behind)


def test_objects_fill_their_ranges() -> None:
    even([one.law.exponent for one in TOUCHES], 1.0, 1.5)
    even([one.law.layer / PLASTIC.roughness for one in TOUCHES], 0.28, 0.57, log=True)
    even([one.law.layer_load for one in TOUCHES], 3e-3, 3e-2, log=True)
    flat, edge = [one.law.flat is not None for one in TOUCHES], [one.radius is not None for one in TOUCHES]
    assert 0.13 < np.mean(flat) < 0.27
    assert 0.13 < np.mean(edge) < 0.27
    assert not np.any(np.logical_and(flat, edge))
    even([one.law.flat for one in TOUCHES if one.law.flat], 2e-4, 4e-3, log=True)
    for one in TOUCHES:
        radius = PLASTIC.radius if one.radius is None else one.radius
        assert one.law.width == (one.law.flat or 0.0)
        assert one.law.arm == (0.0 if one.law.flat else radius)


@pytest.mark.parametrize(
    ("world", "checksum"),
    [
        ("ideal", "f1c1589fcc390c6eacd54034e7941fe461242d23214e8b38684f96a12c8f005e"),
        ("plausible", "3e99379b35752a1547a5f6ba22ff8179684e6a4514a3d13afaca9794cab61ff5"),
    ],
)
def test_a_world_draws_what_it_always_has(world: World, checksum: str) -> None:
    assert fingerprint_of_draws(world) == checksum


def fingerprint_of_draws(world: World) -> str:
    """A checksum of sensors and touches of a world, to eleven digits."""

    def digits(value: Any) -> Any:
        if isinstance(value, float):
            return f"{value:.11e}"
        return [digits(one) for one in value] if isinstance(value, tuple | list) else repr(value)

    rows: list[Any] = []
    for name, seed in product(("prototype", "long"), range(20)):
        one = sensor_of(load_sensor(name), world, build=seed, day=seed + 1)
        string, ups = one.string, one.pickups
        rows.append([string.length, string.linear_density, string.tension, string.core_diameter, one.drift,
                     one.drift_rate, one.measured_length, one.press_tension])  # fmt: skip
        rows += [[d.sense, d.drive, d.aperture, d.centre, d.quality, d.gain, d.limit, d.angle, d.level,
                  d.bias, d.pull] for d in one.drivers]  # fmt: skip
        rows += [[end.compliance, end.admittance, end.frequency, end.quality] for end in one.ends]
        rows.append([ups.own, ups.gain, ups.angle, ups.hiss, ups.distortion, ups.hum, ups.mains, ups.feed,
                     ups.residual])  # fmt: skip
    for name, seed in product(("plastic", "wood", "allen_key", "metal_tube", "foam"), range(20)):
        press = plausible_touch(hold(0.08, 1.0, load_material(name)), seed, world=world)
        modes_ = [(mode.mass, mode.frequency, mode.quality) for mode in press.mount.modes]
        law = press.law
        rows.append([modes_, press.mount.compliance, press.mount.kind, law.exponent, law.flat, law.width,
                     law.arm, law.layer, law.layer_load, press.radius])  # fmt: skip
    return sha256(repr([digits(row) for row in rows]).encode()).hexdigest()


def test_width_and_turning_are_switches_of_the_shape_that_is_drawn() -> None:
    for seed in range(40):
        whole = plausible_touch(PRESS, seed)
        for name, field in (("width", "width"), ("turning", "arm")):
            without = plausible_touch(PRESS, seed, replace(Effects(), **{name: False}))
            assert without == replace(whole, law=replace(whole.law, **{field: 0.0}))
        assert plausible_touch(PRESS, seed, only("turning")).law.arm == PLASTIC.radius


@pytest.mark.parametrize("name", [name for name in NAMES if name not in {"width", "turning"}])
def test_each_effect_is_a_switch_that_leaves_the_others(name: str) -> None:
    alone, without = only(name), replace(Effects(), **{name: False})
    if name in OF_TOUCHES:
        objects = [replace(PRESS, material=load_material(material)) for material in material_names()]
        drawn = [[plausible_touch(one, s, e) for one in objects for s in range(8)]
                 for e in (alone, without, Effects())]  # fmt: skip
        parts = {
            "mount": lambda t: t.mount,
            "law": lambda t: t.law.exponent,
            "layer": lambda t: (t.law.layer, t.law.layer_load),
            "shape": lambda t: (t.law.flat, t.radius),
        }
        usual = PRESS
    elif name in OF_DAYS:
        assert plausible_day(DESIGN, 3, alone) != day(DESIGN, 3)
        assert plausible_day(DESIGN, 3, without) != plausible_day(DESIGN, 3)
        return
    else:
        drawn = [[plausible_build(DESIGN, s, e) for s in range(8)] for e in (alone, without, Effects())]
        parts = {
            "ends": lambda s: s.ends,
            "length": lambda s: (s.string, s.measured_length),
            "tension_law": lambda s: s.press_tension,
            "level": lambda s: ([d.level for d in s.drivers], s.pickups.gain),
            "asymmetry": lambda s: [d.bias for d in s.drivers],
            "magnets": lambda s: [d.pull for d in s.drivers],
            "distortion": lambda s: s.pickups.distortion,
            "noise": lambda s: s.pickups.hiss,
            "hum": lambda s: (s.pickups.hum, s.pickups.mains),
            "feed_through": lambda s: s.pickups.feed,
            "residual": lambda s: s.pickups.residual,
        }
        usual = DESIGN
    for part, of in parts.items():
        only_it, all_but_it, whole = ([of(one) for one in many] for many in drawn)
        off = [of(usual)] * len(whole)
        assert only_it == (whole if part == name else off)
        assert all_but_it == (off if part == name else whole)
        assert whole != off


def test_each_material_has_a_mount_of_its_own() -> None:
    wood = replace(PRESS, material=load_material("wood"))
    assert plausible_touch(wood, 5).mount != plausible_touch(PRESS, 5).mount


def test_the_ideal_world_is_the_design_with_its_tolerances() -> None:
    assert sensor_of(DESIGN) == DESIGN
    assert sensor_of(DESIGN, build=2) == build(DESIGN, 2)
    assert sensor_of(DESIGN, build=2, day=3) == day(build(DESIGN, 2), 3)
    assert sensor_of(DESIGN, "plausible", effects=only()) == DESIGN
    assert plausible_touch(PRESS, 1, world="ideal") == PRESS
    assert plausible_touch(PRESS, 1, only()) == PRESS
    wrong: Any = "real"
    with pytest.raises(InputError, match="real"):
        sensor_of(DESIGN, wrong)


def test_what_a_touch_states_it_keeps() -> None:
    held = replace(PRESS, mount=Mount(compliance=1e-6), radius=3e-3)
    drawn = [plausible_touch(held, seed) for seed in range(40)]
    assert {one.mount for one in drawn} == {held.mount}
    assert {(one.radius, one.law.flat) for one in drawn} == {(3e-3, None)}
    rolls = touch(key(0.0, 0.08, 1.0), key(1.0, 0.09, 1.0))
    assert all(plausible_touch(rolls, seed).law.flat is None for seed in range(40))


@pytest.mark.parametrize("name", sensor_names())
def test_every_design_can_be_built_in_it(name: str) -> None:
    for seed in range(10):
        sensor = sensor_of(load_sensor(name), "plausible", build=seed, day=seed)
        assert open_frequency(sensor.string) > 0.0  # refused otherwise, as it is made


# The kernel of many modes takes long to compile.
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n == "long" else n for n in sensor_names()]
)
def test_every_design_can_be_touched_in_it(name: str) -> None:
    design = load_sensor(name)
    touches = tuple(
        plausible_touch(hold((0.3 + 0.1 * i) * design.string.length, 0.5, load_material(material)), i)
        for i, material in enumerate(("plastic", "foam"))
    )
    twin = begin(sensor_of(design, "plausible", build=1, day=1), Scene(touches=touches), seed=1)
    take, after = advance(twin, 500)
    assert np.isfinite(take.microphones).all()
    assert np.abs(modes(after)[layout.Q]).sum() < design.string.length


def test_presses_in_it_are_what_was_asked_for() -> None:
    # Ends, magnets and mounts that yield leave the force at rest within some percent.
    for seed in range(3):
        sensor = sensor_of(DESIGN, "plausible", build=seed, day=seed)
        pressed = plausible_touch(PRESS, seed)
        twin = begin(sensor, Scene(touches=(pressed,), drivers=(False, False)), seed=seed)
        force = advance(twin, 22050)[0].labels.force[0, -1]
        assert force == pytest.approx(1.0, rel=0.06)


def test_preamplifiers_are_turned_down_for_the_louder_driver() -> None:
    for seed in range(4):
        sensor = plausible_build(DESIGN, seed, only("level"))
        louder = max(1.0, *(driver.level for driver in sensor.drivers))
        assert sensor.pickups.gain == pytest.approx([gain / louder for gain in DESIGN.pickups.gain])
        sound = advance(begin(sensor, Scene(pluck=Pluck(position=0.04, height=1e-4))), 22050)[0].microphones
        assert np.mean(np.abs(sound[:, 11025:]) >= 1.0) == 0.0


def test_an_untouched_string_sounds_in_it_and_at_its_pitch() -> None:
    for seed in range(2):
        sensor = sensor_of(DESIGN, "plausible", build=seed, day=seed)
        pluck = Pluck(position=0.2 * sensor.string.length, height=1e-4)
        sound = advance(begin(sensor, Scene(pluck=pluck, drivers=(False, False))), 8820)[0].microphones[0]
        taut = replace(sensor.string, tension=sensor.string.tension + sensor.drift)
        spectrum = np.abs(np.fft.rfft(sound * np.hanning(8820)))
        low = round(0.2 * 300.0)
        peak = (low + np.argmax(spectrum[low : round(0.2 * 1600.0)])) / 0.2
        assert peak == pytest.approx(open_frequency(taut), rel=0.01)


def test_a_virtual_sensor_lives_in_a_world() -> None:
    sounds = []
    for name in ("ideal", "plausible"):
        twin = VirtualSensor("prototype", seed=2, build=1, day=1, world=name)
        twin.press(0.08, 1.0)
        sound, labels = twin.advance(0.3)
        assert labels["contact"][-1] == 1.0
        assert labels["position"][-1] == pytest.approx(0.08, abs=1e-6)
        sounds.append(sound)
    assert np.abs(sounds[0] - sounds[1]).max() > 0.01
    wrong: Any = "real"
    with pytest.raises(InputError, match="world"):
        VirtualSensor(world=wrong)
