"""The five steps of an evaluation: what is refused, what is replayed, what is written, and the baselines."""

import json
from base64 import b64encode
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from tests.evaluation.conftest import STRING, Oracle, selection

from monochord.core.errors import InputError
from monochord.datasets.split import Split, split_dataset
from monochord.datasets.store import Dataset
from monochord.evaluation.baselines import baseline_results
from monochord.evaluation.evaluate import (
    PAGE,
    RESULTS,
    SCORES,
    TABLE,
    Evaluation,
    refuse_unwritable,
    replay_conditions,
    write,
)
from monochord.evaluation.noise import parse_noise
from monochord.evaluation.results import Results, read_results
from monochord.evaluation.scorecard import scorecard
from monochord.evaluation.scores import detection, regression
from monochord.evaluation.select import (
    EvaluatedEstimator,
    EvaluationData,
    EvaluationSettings,
    audited,
    load,
    refuse_trained_on,
    refuse_unusable_labels,
    select,
)
from monochord.perception.estimators.closed_form import ClosedForm
from monochord.perception.model import load as load_model

CLOSED_FORM = EvaluatedEstimator(estimator=ClosedForm(tension_law="geometric"), name="closed_form")
DEMO = load_model("demo").definition


def test_a_bundled_model_is_loaded_by_its_name() -> None:
    candidate = load(EvaluationSettings(model="demo"))
    assert candidate.definition == DEMO
    assert (candidate.label, candidate.feature["name"]) == (DEMO.feature.name, DEMO.feature.name)
    with pytest.raises(InputError, match="demo"):
        load(EvaluationSettings(model="dmo"))


def test_sessions_are_selected_whole_with_the_string_that_they_state(
    sessions: tuple[Path, ...], tmp_path: Path
) -> None:
    settings = EvaluationSettings(sessions=(str(sessions[0]),))
    data = select(settings, CLOSED_FORM, tmp_path)
    assert len(data.selection.rows) == len(data.selection.dataset) > 100
    assert data.selection.string == STRING
    assert data.training is None
    assert 0.0 < data.force_floor["hold_000"] < 0.1


def test_sessions_that_cannot_be_used_are_refused_or_left_out_with_a_note(
    sessions: tuple[Path, ...], tmp_path: Path
) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(sessions[0].read_bytes()[:-20_000])
    both = EvaluationSettings(sessions=(str(sessions[0]), str(cut)))
    with pytest.raises(InputError, match=r"cut\.mcap"):
        select(both, CLOSED_FORM, tmp_path)
    data = select(replace(both, skip=True), CLOSED_FORM, tmp_path)
    assert [part.name for part in data.selection.dataset.manifest.parts] == [sessions[0].stem]
    assert (data.selection.string, list(data.force_floor)) == (STRING, [sessions[0].stem])
    assert [note.startswith("left out: session cut.mcap") for note in data.notes] == [True]


def test_a_session_that_was_trained_on_is_refused_under_any_name(dataset: Dataset) -> None:
    checksum = dataset.manifest.parts[1].checksum
    trained = replace(DEMO, sessions={"another name": checksum}, dataset="x")
    with pytest.raises(InputError, match="slide_000"):
        refuse_trained_on(selection(dataset), trained, None)
    assert refuse_trained_on(selection(dataset, np.flatnonzero(dataset.session == 0)), trained, None) == ()


def test_other_stretches_of_a_session_are_allowed_with_the_split_of_the_training(dataset: Dataset) -> None:
    split = split_dataset(dataset, by="time")
    tested = selection(dataset, split.test)
    trained = replace(DEMO, sessions={part.name: part.checksum for part in dataset.manifest.parts})
    with pytest.raises(InputError, match="1 more"):
        refuse_trained_on(tested, replace(trained, dataset="x"), split)
    assert len(refuse_trained_on(tested, replace(trained, dataset=split.dataset), split)) == 1


def test_a_leaking_split_is_refused(dataset: Dataset) -> None:
    split = split_dataset(dataset, by="time")
    audited(dataset, split)
    leaking = replace(split, parts={**split.parts, "test": np.append(split.train[-1:], split.test)})
    with pytest.raises(InputError, match="shared window"):
        audited(dataset, leaking)
    assert audited(dataset, leaking, learned=False) == ()
    with pytest.raises(InputError):
        audited(dataset, Split(by="time", parts=split.parts, dataset="another"), learned=False)


def test_windows_without_labels_or_with_labels_that_are_no_numbers_are_refused(dataset: Dataset) -> None:
    count = int(dataset.valid["force"].sum())
    for value in (np.nan, np.inf):
        labels = {**dataset.labels, "force": np.full(len(dataset), value)}
        with pytest.raises(InputError, match=rf"'force'.* {count} windows"):
            refuse_unusable_labels(selection(replace(dataset, labels=labels)))
    names = ("contact", "position", "force", "slip")
    labels = {**dataset.labels, **{name: np.full(len(dataset), np.nan) for name in names}}
    valid = {**dataset.valid, **{name: np.zeros(len(dataset), np.bool_) for name in names}}
    with pytest.raises(InputError, match=f"{len(dataset)} windows"):
        refuse_unusable_labels(selection(replace(dataset, labels=labels, valid=valid)))


def test_each_noise_is_a_replay_of_its_own(dataset: Dataset) -> None:
    rows = np.flatnonzero(dataset.session == 0)[:60]
    noises = [parse_noise("white:40", {}), parse_noise("white:-20", {})]
    data = EvaluationData(selection=selection(dataset, rows), notes=("a note",))
    results = replay_conditions(data, CLOSED_FORM, noises)
    assert [trial.condition for trial in results.trials] == ["clean", "white 40 dB", "white -20 dB"]
    answered = np.isfinite(results.estimate("position")).reshape(3, 60).sum(axis=1)
    assert answered[0] > 20
    assert answered[2] == 0
    assert results.notes == ("a note",)


def test_sessions_recorded_in_noise_get_none_on_top(dataset: Dataset) -> None:
    labelled = [np.flatnonzero(dataset.valid["contact"] & (dataset.session == part)) for part in (0, 1)]
    unknown = tuple(replace(part, music=None) for part in dataset.manifest.parts)
    dataset = replace(dataset, manifest=replace(dataset.manifest, parts=unknown))
    chosen = selection(dataset, np.array([rows[0] for rows in labelled]))
    one = replace(chosen, ambient_noise={"slide*": "radio"})
    results = replay_conditions(EvaluationData(selection=one), CLOSED_FORM, [parse_noise("hum:10", {})])
    conditions = [(trial.session, trial.condition) for trial in results.trials]
    assert conditions == [("hold_000", "clean"), ("slide_000", "radio"), ("hold_000", "hum 10 dB")]
    both = replace(chosen, ambient_noise={"*": "radio"})
    results = replay_conditions(EvaluationData(selection=both), CLOSED_FORM, [parse_noise("hum:10", {})])
    assert {trial.condition for trial in results.trials} == {"radio"}


def test_baselines_learn_position_and_contact_from_the_training_windows(dataset: Dataset) -> None:
    split = split_dataset(dataset, by="time")
    training = selection(dataset, split.train[dataset.usable[split.train]])
    tested, noise = selection(dataset, split.test), parse_noise("white:-30", {})
    results = baseline_results(tested, training, {"name": "fft_harmonic"}, [noise])
    assert list(results) == ["ridge", "extra_trees"]
    for each in results.values():
        assert {trial.condition for trial in each.trials} == {"clean", "white -30 dB"}
        clean, noisy = (each.of_trials("condition") == name for name in ("clean", "white -30 dB"))
        errors = [regression(each, "position", rows, draws=0).mae.value or 0.0 for rows in (clean, noisy)]
        assert 0.0 < 2.0 * errors[0] < errors[1]
        accuracy = detection(each, "contact", clean, draws=0).accuracy.value
        assert accuracy is not None
        assert accuracy > 0.9
        np.testing.assert_array_equal(np.isnan(each.estimate("contact")), ~each.usable)
        assert np.nanmin(each.estimate("contact")) >= 0.0


def test_a_folder_gets_results_table_scores_and_a_report_that_loads_nothing(
    oracle: Oracle, tmp_path: Path
) -> None:
    results = replace(oracle(spread=1.0), estimator="<b>bold</b>", notes=("a & b",))
    card = scorecard(results, string=STRING, force_floor={"take0": 0.012}, draws=20)
    folder, drawn = tmp_path / "a" / "b", list[int]()

    def draw(file: Path, given: Results) -> dict[str, str]:
        drawn.append(len(read_results(file)) - len(given))
        return {"a figure": "<svg/>"}

    write(folder, Evaluation(results=results, card=card, label="oracle"), draw)
    assert {path.name for path in folder.iterdir()} == {RESULTS, TABLE, SCORES, PAGE}
    assert drawn == [0]
    assert json.loads((folder / SCORES).read_text())["estimator"] == "<b>bold</b>"
    page = (folder / PAGE).read_text()
    assert "http" not in page
    assert "<b>bold" not in page
    assert "a &amp; b" in page
    assert b64encode(b"<svg/>").decode() in page
    assert "simulated" in page
    assert {"a figure"} <= Tags(page).alternatives


class Tags(HTMLParser):
    """A page whose tags are closed in order, and whose pictures are in it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.alternatives: set[str | None] = set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            assert name not in ("src", "href") or str(value).startswith("data:image/svg+xml;base64,")
        self.alternatives |= {value for name, value in attrs if name == "alt"}
        self.open += [tag] if tag not in ("meta", "img") else []

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_an_impossible_folder_is_refused_and_a_possible_one_not_made(oracle: Oracle, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("precious")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="file"):
            refuse_unwritable(folder)
        with pytest.raises(InputError, match="file"):
            write(folder, Evaluation(results=oracle(), card=scorecard(oracle(), draws=0), label="oracle"))
    refuse_unwritable(tmp_path / "new" / "report")
    refuse_unwritable(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "precious"


def test_an_earlier_evaluation_is_replaced_and_no_other_file_of_such_a_name(tmp_path: Path) -> None:
    (tmp_path / TABLE).write_text("precious")
    with pytest.raises(InputError, match=rf"already has {TABLE}"):
        refuse_unwritable(tmp_path)
    for name in (PAGE, SCORES, RESULTS):
        (tmp_path / name).touch()
    refuse_unwritable(tmp_path)
