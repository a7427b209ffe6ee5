"""A test that holds what was trained on is refused; noise and files are what they say."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.split import Split, split_dataset
from monochord.datasets.store import Dataset
from monochord.evaluation.harness import (
    PAGE,
    RESULTS,
    SCORES,
    TABLE,
    Trained,
    audited,
    evaluate,
    noise,
    refuse_trained_on,
    refuse_unwritable,
    room_recordings,
    suite,
    write_folder,
)
from monochord.evaluation.replay import Course
from monochord.evaluation.results import Results
from monochord.evaluation.results import read_results
from monochord.evaluation.scorecard import scorecard
from monochord.perception.estimators.closed_form import ClosedForm
from monochord.physics.sensors import load_sensor

Oracle = Callable[..., Results]
STRING = load_sensor("prototype").string


def course(dataset: Dataset, rows: np.ndarray | None = None) -> Course:
    return Course(dataset=dataset, rows=np.arange(len(dataset)) if rows is None else rows, string=STRING)


def test_a_session_that_was_trained_on_is_refused_whatever_its_name(dataset: Dataset) -> None:
    checksum = dataset.manifest.parts[1].checksum
    trained = Trained(sessions={"another name": checksum})
    with pytest.raises(InputError, match="a test on session slide_000, which it was trained on"):
        refuse_trained_on(course(dataset), trained, None)
    only_first = np.flatnonzero(dataset.session == 0)
    assert refuse_trained_on(course(dataset, only_first), trained, None) == ()


def test_other_stretches_of_a_session_are_noted_only_with_the_split_that_was_trained_with(
    dataset: Dataset,
) -> None:
    split = split_dataset(dataset, by="time")
    trained = Trained(sessions={part.name: part.checksum for part in dataset.manifest.parts}, dataset="x")
    with pytest.raises(InputError, match="and 1 more, which it was trained on"):
        refuse_trained_on(course(dataset, split.test), trained, split)
    same = replace(trained, dataset=split.dataset)
    (note,) = refuse_trained_on(course(dataset, split.test), same, split)
    assert "2 of the tested sessions were trained on too" in note


def test_a_leak_planted_in_the_split_is_refused(dataset: Dataset) -> None:
    split = split_dataset(dataset, by="time")
    audited(dataset, split)
    planted = replace(split, parts={**split.parts, "test": np.append(split.train[-1:], split.test)})
    with pytest.raises(InputError, match="split with a leak: shared window"):
        audited(dataset, planted)
    assert audited(dataset, planted, learned=False) == ()
    strange = Split(by="time", parts=split.parts, dataset="that of another")
    with pytest.raises(InputError, match="split with a leak: other dataset"):
        audited(dataset, strange, learned=False)


def test_each_noise_is_a_replay_of_its_own(dataset: Dataset) -> None:
    rows = np.flatnonzero(dataset.session == 0)[:60]
    noises = [noise("white:40", {}), noise("white:-20", {})]
    physics = ClosedForm(tension_law="geometric")
    results = evaluate(course(dataset, rows), physics, name="closed_form", noises=noises, notes=("a note",))
    assert [trial.condition for trial in results.trials] == ["clean", "white 40 dB", "white -20 dB"]
    assert len(results) == 180
    told = np.isfinite(results.estimate("position")).reshape(3, 60).sum(axis=1)
    assert told[0] > 20
    assert told[2] == 0
    assert results.notes == ("a note",)


def test_what_was_recorded_in_noise_gets_none_on_top(dataset: Dataset) -> None:
    labelled = [np.flatnonzero(dataset.valid["contact"] & (dataset.session == part)) for part in (0, 1)]
    rows = np.array([each[0] for each in labelled])
    silent = tuple(replace(part, music=None) for part in dataset.manifest.parts)
    dataset = replace(dataset, manifest=replace(dataset.manifest, parts=silent))
    told = replace(course(dataset, rows), room={"slide*": "radio"})
    physics = ClosedForm(tension_law="geometric")
    results = evaluate(told, physics, name="closed_form", noises=[noise("hum:10", {})])
    heard = [(trial.session, trial.condition) for trial in results.trials]
    assert heard == [("hold_000", "clean"), ("slide_000", "radio"), ("hold_000", "hum 10 dB")]
    nowhere = replace(told, room={"*": "radio"})
    results = evaluate(nowhere, physics, name="closed_form", noises=[noise("hum:10", {})])
    assert {trial.condition for trial in results.trials} == {"radio"}


def test_noise_is_read_from_text() -> None:
    assert (noise("hum:5.5", {}).kind, noise("hum:5.5", {}).ratio) == ("hum", 5.5)
    with pytest.raises(InputError, match=r"noise 'hmu:5'.*did you mean 'hum'"):
        noise("hmu:5", {})
    with pytest.raises(InputError, match=r"noise 'hum'.*write hum:10"):
        noise("hum", {})


def test_the_suite_has_every_kind_at_every_ratio_with_music_where_there_is_some() -> None:
    music = np.ones(100, np.float32)
    recordings = room_recordings(music=music)
    assert "music" in recordings
    assert len(room_recordings(22050, music)["music"]) == pytest.approx(
        len(recordings["music"]) / 2, rel=0.01
    )
    noises = suite(recordings, ratios=(0.0, 20.0))
    kinds = {"white", "pink", "hum", "band", "motor", "speech", "music"}
    assert {(each.kind, each.ratio) for each in noises} == {(kind, r) for kind in kinds for r in (0.0, 20.0)}


def test_a_folder_holds_results_table_scores_and_page(oracle: Oracle, tmp_path: Path) -> None:
    results = oracle(spread=1.0)
    card = scorecard(results, draws=20)
    write_folder(tmp_path / "a" / "b", results, card, lambda file: {f"{file.stat().st_size} bytes": "<svg/>"})
    found = tmp_path / "a" / "b"
    assert {path.name for path in found.iterdir()} == {RESULTS, TABLE, SCORES, PAGE}
    assert len(read_results(found / RESULTS)) == len(results)
    assert f'alt="{(found / RESULTS).stat().st_size} bytes"' in (found / PAGE).read_text()
    assert json.loads((found / SCORES).read_text())["estimator"] == "oracle"
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="folder"):
        write_folder(tmp_path / "file" / "below", results, card)


def relabelled(dataset: Dataset, value: float, *names: str) -> Dataset:
    """Return a dataset in which some labels are one value, still marked as they were."""
    labels = {name: np.full(len(dataset), value) for name in names}
    return replace(dataset, labels={**dataset.labels, **labels})


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_label_that_is_no_number_where_it_counts_is_refused(dataset: Dataset, value: float) -> None:
    count = int(dataset.valid["force"].sum())
    line = rf"label 'force' that is no number in {count} windows .*: allowed is numbers; build the dataset"
    with pytest.raises(InputError, match=line):
        evaluate(course(relabelled(dataset, value, "force")), ClosedForm(), name="closed_form")


def test_windows_without_a_label_are_refused(dataset: Dataset) -> None:
    names = ("contact", "position", "force", "slip")
    bare = relabelled(dataset, np.nan, *names)
    bare = replace(bare, valid={**bare.valid, **{name: np.zeros(len(dataset), np.bool_) for name in names}})
    with pytest.raises(InputError, match=r"\d+ windows to evaluate without a known label: allowed is some"):
        evaluate(course(bare), ClosedForm(), name="closed_form")


def test_a_folder_that_cannot_be_made_is_refused_and_one_that_can_is_not_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("precious")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match=r"folder .*file.*: allowed is one that can be made"):
            refuse_unwritable(folder)
    assert (tmp_path / "file").read_text() == "precious"
    refuse_unwritable(tmp_path / "new" / "report")
    refuse_unwritable(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
