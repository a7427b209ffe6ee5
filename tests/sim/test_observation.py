"""What a policy observes of a string: the same in an environment as in the live loop."""

from typing import Any, get_args

import numpy as np
import pytest

import monochord as mc
from monochord.core.errors import InputError
from monochord.physics.sensors import with_sensor
from monochord.sim.observation import ESTIMATES, ObservationKind, estimates_row, observe, observer
from monochord.sim.warm import StringSettings, warm_string

HOP = 0.02
SIGNAL = with_sensor(mc.Signal(sample_rate=44100, channels=2), mc.load_sensor("prototype"))


def press(twin: mc.VirtualSensor, step: int) -> None:
    """Lead a twin's fingertip over the next hop: down on the string, then along it."""
    force = np.clip(0.1 * (step + np.array([0.5, 1.0])), 0.0, 1.0)
    twin.lead(HOP / 2, position=0.08 + 4e-4 * max(step - 10, 0), force=force, clearance=0.0)


def test_a_warm_copy_observes_what_listen_tells_of_a_string_that_was_never_copied() -> None:
    warm = warm_string(StringSettings(world="plausible", build=3, seed=3))
    sensor, listening = warm.begun()
    rows: list[Any] = []
    for step in range(25):
        press(sensor, step)
        rows.append(observe([listening], [sensor.advance(HOP)[0]])[0])

    twin = mc.VirtualSensor("prototype", world="plausible", build=3, seed=3, objects=["plastic"])
    begun = round((warm.sensor.time - 0.1) / HOP)
    told: list[Any] = []
    for number, update in enumerate(mc.listen(twin, hop=HOP, seconds=warm.sensor.time + 25 * HOP)):
        told.append(estimates_row(update.estimates, update.tracked, update.decided, 0.2))
        if number >= begun:
            press(twin, number - begun)
    assert np.array_equal(told[begun], warm.row)
    assert np.array_equal(told[begun + 1 :], rows)
    assert rows[-1][ESTIMATES.index("position stated")] == 1.0


def test_a_warm_string_is_left_as_it_was() -> None:
    warm = warm_string(StringSettings())
    runs: list[Any] = []
    for force in (0.0, 2.0, 0.0):
        sensor, listening = warm.begun()
        for _ in range(5):
            sensor.lead(HOP, position=0.08, force=force, clearance=0.0 if force else 3e-3)
            runs.append(observe([listening], [sensor.advance(HOP)[0]])[0])
    assert np.array_equal(runs[:5], runs[10:])
    assert not np.array_equal(runs[:5], runs[5:10])


@pytest.mark.parametrize("kind", get_args(ObservationKind))
def test_many_observers_see_what_each_sees_alone(kind: ObservationKind) -> None:
    sounds = np.random.default_rng(1).normal(0.0, 0.05, (4, 3, 2, 882)).astype(np.float32)
    together = [observer(kind, SIGNAL) for _ in range(3)]
    alone = [each.copy() for each in together]
    for step in sounds:
        rows = observe(together, step)
        assert np.array_equal(
            rows, [observe([each], [sound])[0] for each, sound in zip(alone, step, strict=True)]
        )
        assert all(each.space.contains(row) for each, row in zip(together, rows, strict=True))


def test_sound_is_the_last_tenth_of_a_second() -> None:
    sound = np.random.default_rng(1).uniform(-1.0, 1.0, (2, 20 * 882)).astype(np.float32)
    listening = observer("sound", SIGNAL)
    hops = np.split(sound, 20, axis=1)
    rows = [observe([listening], [hop])[0] for hop in hops]
    assert np.array_equal(rows[-1], sound[:, -4410:])
    assert np.array_equal(
        observe([listening], [2.0 * sound[:, :4410]])[0], np.clip(2.0 * sound[:, :4410], -1, 1)
    )


def test_features_are_those_of_the_window_alone() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    twin.press(0.08, 1.0)
    sound, _ = twin.advance(0.6)
    listening = observer("features", SIGNAL)
    row = observe([listening], [sound[:, -4410:]])[0]
    assert np.array_equal(row, mc.features(sound[:, -4410:])[0])
    assert np.abs(row).max() < 50.0  # far from the bound


def test_what_is_withheld_is_nought_and_what_is_unknown_half() -> None:
    stated = {
        "position": mc.Estimate(value=0.08, std=1e-3, unit="m"),
        "force": mc.Estimate.abstain("N", "too uncertain"),
        "slip": mc.Estimate(value=0.25, std=0.4, unit=""),
    }
    contact = {"contact": mc.Estimate(value=0.75, std=0.4, unit="")}
    row = dict(zip(ESTIMATES, estimates_row(contact, stated, {"slip": False}, 0.2).tolist(), strict=True))
    assert row == pytest.approx({
        "contact": 0.75, "touched": 0.5, "slip": 0.25, "sliding": 0.0,
        "position": 0.4, "position error": 0.005, "position stated": 1.0,
        "force": 0.0, "force error": 0.0, "force stated": 0.0,
    })  # fmt: skip
    far = {"force": mc.Estimate(value=30.0, std=50.0, unit="N")}
    assert estimates_row({}, far, {}, 0.2)[-3:].tolist() == [10.0, 10.0, 1.0]


def test_what_cannot_be_observed_is_refused() -> None:
    with pytest.raises(InputError, match="observation 'smell'"):
        observer("smell", SIGNAL)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="22050 Hz"):
        observer("estimates", mc.Signal(sample_rate=22050, channels=2))
    with pytest.raises(InputError, match="objects"):
        StringSettings(objects=7)  # pyright: ignore[reportArgumentType]
