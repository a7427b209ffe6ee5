"""What deviates of a sensor is as large as it says."""

from dataclasses import replace

import pytest
from tests.lab.tiny import tiny

from monochord.core.errors import InputError
from monochord.lab.assignment import assignments
from monochord.lab.deviation import Deviation
from monochord.lab.schedule import schedule
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency

PROTOTYPE = load_sensor("prototype")


def test_a_deviation_is_as_large_as_it_says() -> None:
    drifted = Deviation(pitch=-0.06).of_sensor(PROTOTYPE)
    string = replace(drifted.string, tension=drifted.string.tension + drifted.drift)
    assert open_frequency(string) / open_frequency(PROTOTYPE.string) == pytest.approx(0.94, abs=1e-9)
    warmer = Deviation(warming=20.0).of_sensor(PROTOTYPE).drift
    assert warmer == pytest.approx(20.0 * 0.115, abs=0.01)
    assert Deviation(snr=40.0).of_sensor(PROTOTYPE).pickups.hiss == pytest.approx(1e-3)
    assert [one.level for one in Deviation(drive=8.0).of_sensor(PROTOTYPE).drivers] == [8.0, 8.0]
    touch = assignments(tiny(deviation=Deviation(spring=1e5, linear=True)))[0]
    changed = touch.touch(schedule(touch).motion.keys)
    assert (changed.mount.compliance, changed.law.exponent) == (pytest.approx(1e-5), 1.0)
    dead = Deviation(dead_driver=2).of_sensor(PROTOTYPE).drivers
    assert (dead[0], dead[1].limit) == (PROTOTYPE.drivers[0], 0.0)
    microphones = replace(PROTOTYPE, pickups=replace(PROTOTYPE.pickups, own=(0.9, 0.8), gain=(1.0, 2.0)))
    swapped = Deviation(swapped=True).of_sensor(microphones)
    assert (swapped.pickups.own, swapped.pickups.gain) == (pytest.approx((0.2, 0.1)), (2.0, 1.0))
    again = Deviation(swapped=True).of_sensor(swapped).pickups
    assert (again.own, again.gain) == (pytest.approx((0.9, 0.8)), (1.0, 2.0))
    assert Deviation(dead_microphone=1).of_sensor(microphones).pickups.gain == (0.0, 2.0)
    gauge = Deviation(gauge=1.2).of_sensor(PROTOTYPE).string
    assert gauge.core_diameter == pytest.approx(1.2 * PROTOTYPE.string.core_diameter)
    assert open_frequency(gauge) == pytest.approx(open_frequency(PROTOTYPE.string))
    for share in (-0.25, 0.25):
        tuned = Deviation(tuning=share).of_sensor(replace(PROTOTYPE, drift=1.0))
        string = replace(tuned.string, tension=tuned.string.tension + tuned.drift)
        plain = replace(PROTOTYPE.string, tension=PROTOTYPE.string.tension + 1.0)
        assert open_frequency(string) / open_frequency(plain) == pytest.approx(1.0 + share, abs=1e-9)
    with pytest.raises(InputError):
        Deviation(pitch=0.1, warming=60.0).of_sensor(PROTOTYPE)  # beyond a quarter of the tension
