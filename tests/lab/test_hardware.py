"""The hardware suite changes one thing at a time, and nothing of the touches."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from tests.lab.tiny import tiny

from monochord.core.errors import InputError
from monochord.lab.deviation import Deviation
from monochord.lab.hardware import CONDITIONS, Condition, chosen_conditions, plan_of, render_suite
from monochord.lab.plan import Assignment, assignments
from monochord.lab.schedule import schedule
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency
from monochord.physics.twin.trajectory import Trajectory

PROTOTYPE = load_sensor("prototype")
CHANGED = {
    "clean": set[str](),
    "distortion": {"pickups"},
    "SNR": {"pickups"},
    "+20": {"drift"},
    "-20": {"drift"},
    "drive": {"drivers"},
    "spring": {"mount"},
    "linear": {"law"},
    "yielding": {"ends"},
    "motors": {"motors"},
    "tuning": {"drift"},
    "driver": {"drivers"},
    "microphone": {"pickups"},
    "microphones": {"pickups"},
    "gauge": {"string"},
    "foam": {"material"},
    "two": {"second"},
}
"""What differs from the clean condition, by the first word of a condition's name."""


def depths(motion: Trajectory) -> np.ndarray:
    """The tool's place where each move ends; taps are of a force, so of another depth at another pitch."""
    ends = np.array([phase.stop for phase in motion.phases if phase.kind != "tap"])
    return motion.path(ends)


def sessions(condition: Condition) -> list[Assignment]:
    return assignments(plan_of(condition, "prototype"))


@pytest.mark.parametrize("condition", CONDITIONS, ids=lambda condition: condition.name)
def test_one_thing_differs_and_the_touches_are_the_same(condition: Condition) -> None:
    own, clean = sessions(condition), sessions(CONDITIONS[0])
    if condition.builds:
        for protocol in ("hold", "slide"):
            builds = [one.build for one in own if one.group.protocol == protocol]
            assert len(set(builds)) == condition.builds
        cells, others = (sorted(map(tuple, np.concatenate([one.cells() for one in each]).tolist()))
                         for each in (own, clean))  # fmt: skip
        assert cells == others
        return
    differs: set[str] = set()
    for one, other in zip(own, clean, strict=True):
        motion, still = schedule(one).motion, schedule(other).motion
        np.testing.assert_allclose(depths(motion), depths(still), atol=1e-9)
        pairs = [(one.sensor(), other.sensor()), (one.touch(still.keys), other.touch(still.keys))]
        for first, second in [*pairs, (one.group, other.group)]:
            differs |= {
                each.name for each in fields(first) if getattr(first, each.name) != getattr(second, each.name)
            }
    assert differs == CHANGED[condition.name.split()[0]]


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
    with pytest.raises(InputError):
        Deviation(pitch=0.1, warming=60.0).of_sensor(PROTOTYPE)  # beyond a quarter of the tension


def test_a_suite_is_rendered_once_and_another_seed_apart(tmp_path: Path) -> None:
    clean = chosen_conditions(["clean"])
    (folder,) = render_suite(clean, "prototype", tmp_path, quick=True, workers=1).values()
    files = sorted(folder.glob("*.mcap"))
    assert [file.stem for file in files] == ["held_plastic_000", "sliding_plastic_000"]
    stamps = [file.stat().st_mtime_ns for file in files]
    calls: list[tuple[int, int]] = []
    render_suite(
        clean, "prototype", tmp_path, quick=True, workers=1, progress=lambda _, *at: calls.append(at)
    )
    assert [file.stat().st_mtime_ns for file in files] == stamps
    assert calls[-1] == (len(files), len(files))
    (other,) = render_suite(clean, "prototype", tmp_path, quick=True, workers=1, seed=1).values()
    assert other != folder
    assert other.joinpath(files[0].name).read_bytes() != files[0].read_bytes()
