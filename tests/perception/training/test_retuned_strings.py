"""Training on sessions whose strings are tuned otherwise: features and forces relative to each own string."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.lab.tiny import session, tiny

from monochord.capture.recording.from_files import from_files
from monochord.core.types import Signal, Window
from monochord.datasets.build import build_dataset
from monochord.datasets.store import Dataset
from monochord.evaluation.replay import Selection
from monochord.lab.offline import make
from monochord.perception.features.base import RecurrentExtractor
from monochord.perception.model import load
from monochord.perception.model.network import quantity
from monochord.perception.model.state import ModelState
from monochord.perception.model.stepping import model_input, read_all
from monochord.perception.training.examples import examples_of, stream_of, training_data
from monochord.perception.training.rows import DatasetFeature
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import read_in_turn, with_design_forces
from monochord.perception.tuning.sessions import (
    estimate_tension,
    force_scales,
    retuned_strings,
    tension_estimator,
)
from monochord.physics.sensors import RULER_STD, SensorTuning, load_sensor, sensor_toml
from monochord.physics.theory import open_frequency

DESIGN = load_sensor("prototype").string
OWN = 0.95
"""Tuning of the second and third session, as a share of the design's pitch."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Three sessions: of the design, of it recorded as tuned 5 % lower, and of one so tuned unrecorded."""
    folder, paths = tmp_path_factory.mktemp("tuned"), list[Path]()
    recorded, unknown = folder / "recorded.toml", folder / "unknown.toml"
    recorded.write_text(
        sensor_toml("prototype", SensorTuning(open_frequency=OWN * 1010.565)), encoding="utf-8"
    )
    unknown.write_text(_own_design(), encoding="utf-8")
    for name, sensor in (("a", "prototype"), ("b", str(recorded)), ("c", str(unknown))):
        (folder / name).mkdir()
        made = make(session("hold_000", tiny(sensor=sensor)), folder / name)
        paths.append(made.path.rename(folder / f"{name}.mcap"))
    return build_dataset(paths, folder / "dataset", listen=estimate_tension)


def _own_design() -> str:
    """Return the file of a design like the prototype's, tuned lower."""
    from importlib.resources import files

    text = (files("monochord.physics.sensors") / "prototype.toml").read_text(encoding="utf-8")
    return f"{text}\n[override]\ntension = {OWN**2 * DESIGN.tension}\n"


def test_each_session_has_its_tension(dataset: Dataset) -> None:
    first, second, third = dataset.manifest.parts
    assert (first.tuned, second.tuned, third.tuned) == ("heard", "recorded", "heard")
    assert first.tension == pytest.approx(DESIGN.tension, rel=0.01)
    for part in (second, third):
        assert part.tension == pytest.approx(OWN**2 * DESIGN.tension, rel=0.01)


def test_sound_of_a_string_that_is_not_named_is_of_the_models_design(
    dataset: Dataset, tmp_path: Path
) -> None:
    number = 2
    sound = np.ascontiguousarray(dataset.audio(number))
    soundfile.write(tmp_path / "take.wav", sound.T, 44100, subtype="FLOAT")
    (tmp_path / "take.csv").write_text("time,contact\n0,0\n")
    from_files(tmp_path / "take.wav", tmp_path / "take.csv", tmp_path / "take.mcap")
    for listen, tuned in ((estimate_tension, None), (tension_estimator(DESIGN), "heard")):
        (part,) = build_dataset([tmp_path / "take.mcap"], tmp_path / f"{tuned}", listen=listen).manifest.parts
        assert part.tuned == tuned
    assert part.tension == pytest.approx(OWN**2 * DESIGN.tension, rel=0.01)


def test_those_that_are_off_are_relative_to_their_own(dataset: Dataset) -> None:
    strings = retuned_strings(dataset, DESIGN)
    assert [*strings] == [1, 2]  # the first is near enough to be read as of the design, as it is live
    scales = force_scales(dataset, DESIGN)
    assert (scales[dataset.session == 0] == 1.0).all()
    assert scales[dataset.session == 1] == pytest.approx(OWN**3, rel=0.01)
    signal = Signal(sample_rate=44100, channels=2, string=DESIGN)
    rows = DatasetFeature.prepared(dataset, signal, "reading", {}, dataset.path / "features")
    numbers = np.flatnonzero((dataset.label("contact") == 1.0) & (dataset.label("settled") == 1.0))
    features, session_of = rows.of(numbers), dataset.session[numbers]
    column = {name: number for number, name in enumerate(rows.extractor.columns)}
    for number in range(3):
        mine = features[session_of == number]
        assert len(mine) > 3
        error = (
            DESIGN.length * mine[:, column["position"]]
            - dataset.label("position")[numbers][session_of == number]
        )
        assert np.median(np.abs(error)) < 1e-3
        assert abs(np.median(mine[:, column["open"]])) < 12.0
    again = DatasetFeature.prepared(dataset, signal, "reading", {}, dataset.path / "features").of(numbers)
    np.testing.assert_array_equal(features, again)


def test_an_evaluation_gives_the_string_that_live_has_or_that_was_heard(dataset: Dataset) -> None:
    for tuned in (False, True):
        selection = Selection(dataset=dataset, rows=np.arange(len(dataset)), string=DESIGN, tuned=tuned)
        strings = [selection.signal_of(number).string for number in range(3)]
        assert strings[1] == replace(DESIGN, tension=dataset.manifest.parts[1].tension)
        assert (strings[0] == DESIGN) is not tuned
        ratio = strings[2].tension / DESIGN.tension if strings[2] else 0.0
        assert ratio == pytest.approx(OWN**2 if tuned else 1.0, rel=0.01)


def test_forces_are_as_of_the_designs_tension(dataset: Dataset, tmp_path: Path) -> None:
    lesson: dict[str, Any] = {
        "dataset": str(dataset.path),
        "cache": str(tmp_path),
        "feature": {"name": "reading"},
        "heads": {"contact": {}, "force": {}},
    }
    settings = TrainingSettings.read(lesson)
    split = _whole(dataset)
    data = training_data(settings, dataset, split)
    examples = examples_of(data, split.train, "train")
    mine = (examples.session == 1) & examples.masks["force"]
    assert mine.any()
    expected = (
        dataset.label("force")[examples.rows[mine]] / force_scales(dataset, DESIGN)[examples.rows[mine]]
    )
    np.testing.assert_allclose(examples.labels["force"][mine], expected)


def test_a_model_is_calibrated_on_each_own_string(dataset: Dataset) -> None:
    """Read by the design's pitch, strings that are 5 % lower would have places tens of millimetres off."""
    model = load("demo")
    rows = np.flatnonzero((dataset.label("contact") == 1.0) & (dataset.label("settled") == 1.0))
    outputs = read_in_turn(model, dataset, stream_of(dataset, np.arange(len(dataset)))).outputs
    record = model.definition.heads["position"]
    places = np.array([quantity(outputs[row]["position"], record)[0] for row in rows.tolist()])
    assert np.abs(places - dataset.label("position")[rows]).max() < 5e-3
    forces = with_design_forces(model, dataset).label("force")
    np.testing.assert_allclose(forces * force_scales(dataset, DESIGN), dataset.label("force"))


def test_features_and_outputs_are_what_a_stream_of_every_tick_hears(dataset: Dataset) -> None:
    """Heads learn from the memory that they meet live, though the dataset has a fifth of its windows."""
    model, manifest = load("demo"), dataset.manifest
    signal = Signal(sample_rate=44100, channels=2, string=DESIGN)
    rows = np.arange(manifest.parts[0].windows)
    features = DatasetFeature.prepared(dataset, signal, "reading", {}, dataset.path / "features").of(rows)
    outputs = read_in_turn(model, dataset, rows).outputs
    extractor = model.prepared.extractor
    assert isinstance(extractor, RecurrentExtractor)
    memory, state, audio = extractor.begin(), ModelState(), dataset.audio(0)
    for number, at in enumerate(range(0, int(dataset.start[rows[-1]]) + 1, round(0.02 * 44100))):
        window = Window(samples=audio[:, at : at + manifest.window].copy(), start=at, sample_rate=44100)
        spectrum = extractor.analyser.analyse(window.samples)
        memory, row = extractor.step(memory, spectrum, at / 44100)
        (reading,) = read_all([model_input(model.prepared, state, window)])
        state = reading.state
        if number % 5 == 0:
            np.testing.assert_array_equal(features[number // 5], row)
            assert outputs.get(number // 5, {}) == reading.outputs


def test_a_measured_length_is_that_of_positions_and_forces(dataset: Dataset) -> None:
    """All else equal, the touches of a string that is longer by 1 % lie further out by 1 %."""
    parts = tuple(replace(part, measured_length=0.202) for part in dataset.manifest.parts)
    longer = replace(dataset, manifest=replace(dataset.manifest, parts=parts))
    strings = retuned_strings(longer, DESIGN)
    assert [round(open_frequency(string) / open_frequency(DESIGN), 2) for string in strings.values()] == [
        1.0,
        OWN,
        OWN,
    ]
    model = load("demo")
    own, other = with_design_forces(model, longer), with_design_forces(model, dataset)
    np.testing.assert_allclose(1.01 * own.label("position"), other.label("position"))
    np.testing.assert_allclose(1.01**3 * own.label("force"), other.label("force"), rtol=1e-6)
    signal = Signal(sample_rate=44100, channels=2, string=DESIGN)
    rows, few = (
        [
            DatasetFeature.prepared(each, signal, "reading", {}, dataset.path / "features")
            for each in (longer, dataset)
        ],
        np.flatnonzero(dataset.label("settled") == 1.0)[::7],
    )
    np.testing.assert_allclose(rows[0].of(few), rows[1].of(few), rtol=1e-5)
    for tuned in (False, True):
        selection = Selection(dataset=longer, rows=few, string=DESIGN, tuned=tuned)
        lengths = [selection.signal_of(number).string for number in range(3)]
        assert [string.length for string in lengths if string] == ([0.202] * 3 if tuned else [0.2] * 3)
        assert (selection.signal_of(1).length_std == RULER_STD) is tuned


def _whole(dataset: Dataset) -> Any:
    from monochord.datasets.split import split_dataset

    split = split_dataset(dataset, by="session", seed=0)
    return replace(split, parts={**split.parts, "train": np.arange(len(dataset))})
