"""What a prompt says of the objects that a program gets: three short lines at most, with units."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import monochord as mc
from monochord.core.notebook import COLUMNS
from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.lab.assignment import assignments
from monochord.lab.offline import make
from monochord.lab.plans import load_plan
from monochord.perception.data import LabelledData

TOUCHED = mc.VirtualSensor("prototype", seed=1)
TOUCHED.press(0.08, 1.0, material="plastic")
SOUND = TOUCHED.advance(0.5)[0]


@cache
def update() -> mc.Update:
    sensor = mc.VirtualSensor("prototype", seed=1)
    last = None
    for last in mc.listen(sensor, seconds=1.0):
        if last.time == 0.5:
            sensor.press(0.08, 1.0, material="plastic")
    assert last is not None
    return last


SHORT: dict[str, tuple[Callable[[], Any], tuple[str, ...]]] = {
    "sensor": (lambda: TOUCHED, ("prototype", "ideal", "200.0 mm", "80.0 mm with 1.00 N", "44100 Hz")),
    "untouched": (
        lambda: mc.VirtualSensor("long", world="plausible", build=1),
        ("long", "plausible", "touch: none"),
    ),
    "update": (update, ("contact", "position 8", " mm", " N", "truth")),
    "window": (lambda: update().window, ("4410 frames", "44100 Hz")),
    "model": (lambda: mc.load("demo"), ("prototype", "200 mm", "position (m)", "force (N)", "simulated")),
    "definition": (lambda: mc.load("demo").definition, ("position", "reading")),
    "table": (lambda: mc.load("demo").predict(SOUND, sensor="prototype"), ("41 windows", "0.4 s")),
    "rows": (lambda: mc.features(SOUND, sensor="prototype"), ("41 windows", "300", "mic 1 own 1 level")),
    "tuned": (lambda: mc.tune("twin", seconds=1.0, speed=0.0), ("prototype", " Hz +- ", " N +- ")),
    "identified": (
        lambda: mc.identify(mc.VirtualSensor("prototype", seed=1), length=0.2),
        ("prototype", " Hz", " mm", " N", "no answer"),
    ),
    "design": (lambda: mc.design(gauge=0.254e-3), (" mm of ", " N, ", " Hz", " ms")),
    "preset": (lambda: mc.load_sensor("prototype"), ("200 mm at 65 N", "50 to 150 mm")),
    "string": (lambda: mc.load_string("appendix"), ("650 mm", "65 N")),
    "material": (lambda: mc.load_material("plastic"), ("2.5 GPa", " mm")),
    "sound": (lambda: mc.simulate("appendix", route="modal", seconds=0.1), ("0.1 s", "Hz")),
    "block": (lambda: mc.Block(samples=np.zeros((2, 512), np.float32), start=0), ("(2, 512)",)),
}


def check(text: str) -> None:
    lines = text.splitlines()
    assert 1 <= len(lines) <= 3, text
    assert max(map(len, lines)) <= COLUMNS, text
    assert " object at 0x" not in text
    assert "array(" not in text


@pytest.mark.parametrize("name", SHORT)
def test_an_object_says_what_it_is_in_three_lines(name: str) -> None:
    make_it, facts = SHORT[name]
    text = repr(make_it())
    check(text)
    for fact in facts:
        assert fact in text, text


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> LabelledData:
    folder = tmp_path_factory.mktemp("sessions")
    quick = load_plan("quick")
    plan = replace(quick, groups=(replace(quick.groups[0], sessions=1, grid=(3, 2)),))
    dataset = build_dataset([make(assignments(plan)[0], folder).path], folder / "dataset")
    split_dataset(dataset, by="time").write(dataset.path / "split.json")
    return mc.load_dataset(dataset.path)


def test_so_do_those_of_the_learning_path(data: LabelledData, tmp_path: Path) -> None:
    session = mc.read_session(next(data.dataset.path.parent.glob("*.mcap")))
    report = mc.evaluate(sessions=[session.path], estimator="closed_form", baselines=False)
    shown = {
        "session": (session, (" s", "prototype", "44100 Hz")),
        "description": (session.description, ("prototype", "simulated")),
        "audio": (session.audio, ("44100 Hz", " s of 2 channels")),
        "data": (data, ("windows", "100 ms", "simulated")),
        "dataset": (data.dataset, ("windows",)),
        "split": (data.split, ("by time", "train")),
        "report": (report, ("closed_form", " mm off, ", " answered")),
    }
    for thing, facts in shown.values():
        check(repr(thing))
        for fact in facts:
            assert fact in repr(thing), repr(thing)


def test_features_of_sessions_are_those_of_their_own_string(data: LabelledData) -> None:
    with pytest.raises(mc.InputError, match=r"of a string of 0\.2 m.* 0\.65 m .*name their sensor"):
        data.arrays(sensor="long")


def test_a_calibrated_model_shows_itself_as_a_model_does(data: LabelledData) -> None:
    session = next(data.dataset.path.parent.glob("*.mcap"))
    model = mc.calibrate("demo", [session])
    check(repr(model))
    assert "position (m)" in repr(model)
