"""Every script in examples/ runs and prints what its physics says."""

import re
import runpy
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import monochord as mc
from monochord.front.collect import CollectedSessions

EXAMPLES = Path(__file__).parents[1] / "examples"
Output = Callable[[str], str]


@pytest.fixture
def output(small: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Output:
    """Return the function that runs a script as `python` would, and returns its output."""
    collect = mc.collect

    def kept(plan: str, out: Path) -> CollectedSessions:
        out.mkdir()
        for file in small.glob("*.mcap"):  # of the plan that several scripts collect
            shutil.copy2(file, out)
        return collect(plan, out)

    def run(name: str) -> str:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    monkeypatch.setattr(mc, "collect", kept)
    return run


def test_locate_a_touch(output: Output) -> None:
    lines = output("locate_a_touch.py").splitlines()
    assert lines[0] == "touched at 227.50 mm"
    positions = [float(x) for x in re.findall(r": ([\d.]+) ", "\n".join(lines[1:]))]
    assert len(positions) >= 4
    assert positions[0] == pytest.approx(227.5, abs=0.1)
    assert positions[-3:] == pytest.approx([227.5] * 3, abs=0.5)


def test_design_a_sensor(output: Output) -> None:
    *rows, achieved = [
        [float(x) for x in re.findall(r"-?\d+\.?\d*", line)]
        for line in output("design_a_sensor.py").splitlines()[2:]
    ]
    lengths, slopes = [row[0] for row in rows], [row[1] for row in rows]
    assert lengths == [100.0, 200.0, 300.0, 400.0]
    for length, slope in zip(lengths, slopes, strict=True):  # f/x: falls with the square of the length
        assert slope * length**2 == pytest.approx(slopes[0] * lengths[0] ** 2, rel=0.01)
    for noise, built, contact in (np.reshape(row[3:], (3, 2)) for row in rows):
        assert (noise < [0.1, 0.1]).all()  # um, mN: what no sensor reaches
        assert (noise < built).all()
        assert (built < contact).all()
    limits, errors = np.array(rows[1][-2:]), np.array(achieved[-2:])
    assert (0.5 * limits < errors).all()
    assert (errors < 10.0 * limits).all()


def test_follow_a_stream(output: Output) -> None:
    pattern = r"truth: +([\d.]+) mm +estimate: ([\d.]+) \+- [\d.]+ mm$"
    rows = re.findall(pattern, output("follow_a_stream.py"), re.MULTILINE)
    errors = [abs(float(truth) - float(estimate)) for truth, estimate in rows]
    assert len(errors) >= 10
    assert sorted(errors)[len(errors) // 2] < 1.0


def test_press_and_follow(output: Output) -> None:
    text = output("press_and_follow.py")
    events = re.findall(r"^([\d.]+) s  (contact|slip) (begins|ends)$", text, re.MULTILINE)
    assert [(name, change) for _, name, change in events] == [
        ("contact", "begins"), ("slip", "begins"), ("slip", "ends"), ("contact", "ends")
    ]  # fmt: skip
    times = [float(time) for time, _, _ in events]
    assert times == pytest.approx([0.7, 1.3, 1.7, 2.0], abs=0.2)
    rows = re.findall(r"([\d.]+) \+- [\d.]+ mm, .*\(truth ([\d.]+) mm\)$", text, re.MULTILINE)
    assert len(rows) > 5
    errors = sorted(abs(float(estimate) - float(truth)) for estimate, truth in rows)
    assert errors[len(errors) // 2] < 1.0


def test_touch_the_twin(output: Output) -> None:
    lines = output("touch_the_twin.py").splitlines()[1:]
    rows = [[float(number) for number in re.findall(r"-?[\d.]+", line)] for line in lines]
    touched, sliding, force, speed, settled = np.array(rows)[:, 3:8].T
    assert touched[[0, 4, 12]].tolist() == [0.0, 100.0, 0.0]
    assert force[5] == pytest.approx(1.0, abs=0.05)
    assert sliding[[5, 7]].tolist() == [0.0, 100.0]
    assert speed[7] == pytest.approx(20.0, abs=2.0)
    assert settled[5] >= 95.0


def test_grasp_by_sound(output: Output) -> None:
    *rows, sunk, end = output("grasp_by_sound.py").splitlines()
    grips = [float(re.findall(r"([\d.]+) N", row)[0]) for row in rows]
    assert grips == sorted(grips)
    assert len(grips) >= 2
    (drop,) = (float(number) for number in re.findall(r"[\d.]+", sunk))
    grip, needed = (float(number) for number in re.findall(r"[\d.]+", end))
    assert drop < 15.0
    assert needed < grip < 2.0 * needed


def test_build_a_dataset(output: Output) -> None:
    head, *rows, batch, force, noise = output("build_a_dataset.py").splitlines()
    assert head.split()[0] == "simulated"
    counts = np.array([re.findall(r"\d+", row) for row in rows], float)
    assert [row.split()[0] for row in rows] == ["train", "validation", "test"]
    assert counts.sum() > 400
    assert (counts[:, [0, 1, 3]].sum(axis=0) > 50).all()  # static, sliding, untouched
    assert batch == "a batch of 64 windows, 2 microphones, 4410 frames"
    weakest, strongest = (float(number) for number in re.findall(r"[\d.]+", force))
    assert 0.05 < weakest < 0.6 < strongest < 2.5
    loudest, quietest = (int(number) for number in re.findall(r"\d+", noise))
    assert 5 <= loudest < 8
    assert 22 < quietest <= 25


@pytest.mark.slow
def test_train_a_model(output: Output) -> None:
    pytest.importorskip("torch")
    validation, test = output("train_a_model.py").splitlines()
    assert float(re.findall(r"[\d.]+", validation)[0]) < 5.0
    error, count = (float(number) for number in re.findall(r"[\d.]+", test))
    assert error < 5.0
    assert count >= 10


@pytest.mark.slow
def test_evaluate_an_estimator(output: Output) -> None:
    head, *rows = output("evaluate_an_estimator.py").splitlines()
    assert head.split()[0] == "simulated"
    assert [row.split()[0] for row in rows] == ["clean", "hum", "white"]
    for row in rows:
        answered, error = re.findall(r"([\d.]+)% +([\d.]+) mm", row)[0]
        assert float(answered) > 60.0
        assert float(error) < 1.0


@pytest.mark.slow
def test_study_a_feature(output: Output) -> None:
    rows = re.findall(r"^(\w+): R\^2 (-?[\d.]+)", output("study_a_feature.py"), re.MULTILINE)
    assert [head for head, _ in rows] == ["position", "force"]
    assert float(dict(rows)["position"]) > 0.5


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_train_a_policy(output: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["train_a_policy.py", "40960"])  # a quarter of the usual training
    pattern = r"^(\w+): return ([\d.]+) \+- [\d.]+, off by ([\d.]+) mm and ([\d.]+) N$"
    rows = re.findall(pattern, output("train_a_policy.py"), re.MULTILINE)
    (reflex, policy) = ([float(number) for number in numbers] for _, *numbers in rows)
    assert [name for name, *_ in rows] == ["reflex", "policy"]
    assert reflex[0] > 150.0
    assert reflex[1] < 1.0
    assert policy[0] > 100.0


def test_every_example_is_run_above() -> None:
    run = re.findall(r'output\("(\w+\.py)"\)', Path(__file__).read_text(encoding="utf-8"))
    assert sorted(run) == sorted(script.name for script in EXAMPLES.glob("*.py"))
