"""The grasp between two strings: what the scene does, and that the reflex catches."""

import re
from pathlib import Path

import numpy as np
import pytest

import monochord as mc
from monochord.sim.grasp import CAUGHT, OBJECTS, GraspScene, grasp, slip_reflex


@pytest.fixture(scope="module")
def scene() -> GraspScene:
    return GraspScene()


def test_a_grip_above_what_is_needed_holds_and_one_below_drops(scene: GraspScene) -> None:
    needed = scene.reset(3, "tube").needed
    held = grasp(scene, lambda _: 1.15 * needed, 3, "tube")
    lost = grasp(scene, lambda _: 0.8 * needed, 3, "tube")
    assert held.needed == lost.needed == needed
    assert held.caught
    assert held.drop < 0.2 * CAUGHT
    assert held.time == pytest.approx(3.6)
    assert not lost.caught


def test_an_episode_is_the_same_again_and_another_seed_another(scene: GraspScene) -> None:
    def heard(seed: int) -> tuple[float, list[float]]:
        state = scene.reset(seed, "dowel")
        values: list[float] = []
        while state.time < 0.7:
            state = scene.step(1.0)
            values += [update.contact.value for update in state.updates if update.contact.valid]
        return state.needed, values

    first, again, other = heard(1), heard(1), heard(2)
    assert first == again
    assert len(first[1]) > 20
    assert first[0] != other[0]


def test_a_step_is_20_ms_with_the_truth_of_both_fingers(scene: GraspScene) -> None:
    state = scene.reset(5, "bottle")
    assert (state.time, state.drop) == (0.0, 0.0)
    times: list[float] = []
    for _ in range(45):
        state = scene.step(2.0)
        times.append(state.time)
    assert np.diff(times) == pytest.approx(np.full(44, 0.02))
    for update in state.updates:
        assert update.truth["position"] == pytest.approx(0.1, abs=2e-3)
        assert update.truth["force"] == pytest.approx(2.0, rel=0.15)
        assert update.decided["contact"]


def test_seeds_draw_all_objects(scene: GraspScene) -> None:
    drawn: set[str] = set()
    for seed in range(12):
        scene.reset(seed)
        drawn.add(scene.object)
    assert drawn == set(OBJECTS)


def test_what_cannot_be_is_refused() -> None:
    scene = GraspScene()
    with pytest.raises(mc.InputError, match=r"a step before the first reset: expected reset\(seed\) first"):
        scene.step(1.0)
    with pytest.raises(mc.InputError, match="object 'egg': expected one of bottle, dowel, tube"):
        scene.reset(0, "egg")
    scene.reset(0)
    for grip in (-0.1, 6.1, np.nan):
        with pytest.raises(mc.InputError, match="grip"):
            scene.step(grip)


def test_the_page_runs_as_shown(capsys: pytest.CaptureFixture[str]) -> None:
    page = Path(__file__).parents[2] / "docs" / "how-to" / "simulate-a-robot.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    exec("\n".join(blocks), {})  # noqa: S102  (the page's own code)
    *places, end = capsys.readouterr().out.splitlines()
    errors = [
        abs(float(found) - float(truth))
        for found, truth in re.findall(r"([\d.]+) \+- .*truth ([\d.]+) mm", "\n".join(places))
    ]
    assert len(errors) > 30
    assert np.median(errors) < 0.5
    assert re.fullmatch(r"sunk by [\d.]+ mm, [\d.]+ N hold it, [\d.]+ N would", end)


def test_a_reflex_begins_each_episode_anew(scene: GraspScene) -> None:
    reflex = slip_reflex(threshold=-1.0)  # slip is heard at once, and always
    first, again = (grasp(scene, reflex, seed=4, name="dowel").grip for _ in range(2))
    assert first == again > 1.0
