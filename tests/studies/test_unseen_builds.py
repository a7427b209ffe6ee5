"""Rows of unseen builds say what known touches of each are worth, and see no label of the others."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from studies._rows import KEYS, SummaryRow
from studies.unseen_builds import SCRATCH, UNSEEN, builds_page, corrected, drawn, evaluate_builds, groups_of
from tests.conftest import sing
from tests.perception.conftest import with_corrections

from monochord.core.errors import InputError
from monochord.datasets.store import open_dataset
from monochord.evaluation.evaluate import evaluate
from monochord.evaluation.results import Results
from monochord.evaluation.select import EvaluationSettings
from monochord.perception.model import load
from monochord.perception.training.correct import labelled_errors

pytest.importorskip("torch")
BIAS = 0.5


def here(groups: Sequence[Any], work: Any) -> Any:
    """Run the groups in this process, which knows the made-up features."""
    return ((group, work(group)) for group in groups)


@pytest.fixture
def correctable(lesson_run: Path, learnable: Path, tmp_path: Path) -> Path:
    """A run of `lesson` whose model has corrections: builds differ by half a newton either way."""
    home = tmp_path / "correctable"
    shutil.copytree(lesson_run, home)
    with_corrections(load(home), learnable, BIAS).save(home / "model")
    return home


def recorded(folder: Path, build: int, *, later: float = 0.0, mount: str = "") -> Path:
    """A session of 12 touches whose forces are off by BIAS, and those after eight by `later` besides."""
    folder.mkdir(exist_ok=True)
    bias = BIAS * (-1.0) ** build + np.where(np.arange(2400) >= 1600, later, 0.0)
    more = {"world": "plausible", "mount": mount}
    return sing(folder / f"build_{build}.mcap", 70 + build, bias=bias, build=build, more=more)


def settings_of(run: Path, files: Sequence[Path]) -> EvaluationSettings:
    return EvaluationSettings(model=str(run), sessions=tuple(map(str, files)))


def row_of(rows: Sequence[SummaryRow], model: str, touches: int) -> SummaryRow:
    (row,) = (row for row in rows if (row["model"], row["touches"]) == (model, touches))
    return row


@pytest.mark.usefixtures("made_up_features")
@pytest.mark.slow
def test_known_touches_help_and_are_not_scored(correctable: Path, tmp_path: Path) -> None:
    files = [recorded(tmp_path / "unseen", build, mount="bolted") for build in (6, 8)]  # forces above zero
    settings = settings_of(correctable, files)
    every = evaluate_builds(settings, name="m", touches=(0, 8, 10), run=here)
    rows = [row for row in every if row["condition"] == UNSEEN]
    held = [row for row in every if row["condition"] == f"{UNSEEN}, bolted mount"]
    assert [{**row, "condition": UNSEEN} for row in held] == rows
    assert [(row["model"], row["touches"]) for row in rows] == [
        ("m", 0), ("m", 8), ("m, ridge", 0), ("m, ridge", 8), (SCRATCH, 8)
    ]  # fmt: skip
    for row in rows:
        assert tuple(row)[: len(KEYS)] == KEYS
        assert (row["world"], row["condition"], row["builds"]) == ("plausible", UNSEEN, 2)
    before, after = (row_of(rows, "m", touches) for touches in (0, 8))
    assert before["force_mae_n"] > 0.8 * BIAS
    assert after["force_mae_n"] < 0.6 * before["force_mae_n"]
    assert after["force_coverage_1se"] > 0.4
    assert 3.5 / 12.0 < after["n"] / before["n"] < 4.5 / 12.0
    ridge = [row_of(rows, "m, ridge", touches)["force_mae_n"] for touches in (0, 8)]
    assert ridge[1] < ridge[0]
    assert row_of(rows, SCRATCH, 8)["force_mae_n"] > after["force_mae_n"]
    card = evaluate(replace(settings, baselines=False, tuned=True)).card.tree()
    (plain,) = (row for row in card["table"] if row["state"] == "touched")
    assert before["force_mae_n"] == pytest.approx(plain["force"]["mae"]["value"], rel=1e-3)
    assert before["position_mae_mm"] == pytest.approx(1e3 * plain["position"]["mae"]["value"], rel=1e-3)
    assert SCRATCH in builds_page(rows)
    assert row_of(rows, SCRATCH, 8)["position_mae_mm"] > after["position_mae_mm"]


@pytest.mark.slow
def test_rows_of_measured_labels_are_of_the_same_touches_and_say_so(small: Path) -> None:
    settings = EvaluationSettings(model="demo", sessions=(str(small / "hold_000.mcap"),))
    truth, measured = (
        row for labels in ("recorded", "measured")
        for row in evaluate_builds(settings, touches=(0,), labels=labels)
    )  # fmt: skip
    assert (truth["condition"], measured["condition"]) == (UNSEEN, f"{UNSEEN}, measured labels")
    assert measured["n"] == pytest.approx(truth["n"], rel=0.1)
    limits = {"position_mae_mm": 0.1, "force_mae_n": 0.05}
    assert any(measured[name] != truth[name] for name in limits)  # one may round to the same digits
    for name, limit in limits.items():
        assert measured[name] == pytest.approx(truth[name], abs=limit)


@pytest.mark.usefixtures("made_up_features")
def test_a_session_that_cannot_be_used_is_told_and_left_out(correctable: Path, tmp_path: Path) -> None:
    files = [recorded(tmp_path / "unseen", build) for build in (1, 2)]
    whole = files[1].read_bytes()
    middle = len(whole) // 2
    files[1].write_bytes(whole[:middle] + bytes(4096) + whole[middle + 4096 :])
    told: list[str] = []
    rows = evaluate_builds(
        settings_of(correctable, files), name="m", touches=(0,), run=here, refused=told.append
    )
    assert [row["builds"] for row in rows] == [1, 1]
    assert len(told) == 1
    assert "build_2.mcap" in told[0]


@pytest.mark.usefixtures("made_up_features")
def test_touches_that_were_not_heard_teach_nothing(correctable: Path, learnable: Path) -> None:
    """Windows without outputs, as of silence: no error is known, and none is made up."""
    model, dataset = load(correctable), open_dataset(learnable)
    errors = labelled_errors(model.definition, "force", dataset, {})
    assert errors.variables.shape == (0, 1)
    assert len(errors.error) == len(errors.std) == 0


@pytest.mark.slow
@pytest.mark.usefixtures("made_up_features")
def test_labels_of_the_scored_touches_change_no_estimate(correctable: Path, tmp_path: Path) -> None:
    estimates: list[dict[str, Results]] = []

    def watched(groups: Any, work: Any) -> Any:
        for group in groups:
            curves = work(group)
            estimates.append({name: results for (name, _), results in curves.items()})
            yield group, curves

    for later in (0.0, 1.0):
        file = recorded(tmp_path / f"later{later:g}", 2, later=later)
        evaluate_builds(settings_of(correctable, [file]), name="m", touches=(8,), run=watched)
    first, second = estimates
    assert list(first) == ["m", "m, ridge", SCRATCH]
    for name, results in first.items():
        for quantity in ("position", "force"):
            np.testing.assert_array_equal(results.estimate(quantity), second[name].estimate(quantity))
        shift = np.nanmean(second[name].label("force") - results.label("force"))
        assert shift == pytest.approx(1.0)


@pytest.mark.usefixtures("made_up_features")
def test_a_model_without_corrections_is_refused(lesson_run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="corrections"):
        evaluate_builds(settings_of(lesson_run, [recorded(tmp_path / "unseen", 1)]))


def test_groups_are_sessions_or_builds(tmp_path: Path) -> None:
    files = [recorded(tmp_path / f"{number}", build) for number, build in enumerate((1, 2, 1))]
    renamed = [file.rename(file.with_name(f"take_{number}.mcap")) for number, file in enumerate(files)]
    assert [len(group.files) for group in groups_of(renamed)] == [1, 1, 1]
    by_build = groups_of(renamed, "build")
    assert [group.files for group in by_build] == [(renamed[0], renamed[2]), (renamed[1],)]
    assert {group.world for group in by_build} == {"plausible"}
    assert {group.objects for group in by_build} == {"others"}
    assert {group.objects for group in groups_of(renamed)} == {"same"}


def test_a_correction_finds_an_offset_and_a_slope(oracle: Any) -> None:
    results = oracle()
    force = results.value["force"]
    wrong = replace(results, value={**results.value, "force": 0.8 * force - 0.3})
    known, others = (wrong.where((wrong.trial < 2) == first) for first in (True, False))
    after = corrected(others, known)
    assert np.nanmean(np.abs(others.error_of("force"))) > 0.4
    assert np.nanmean(np.abs(after.error_of("force"))) < 0.02
    np.testing.assert_array_equal(after.estimate("position"), others.estimate("position"))
    one = corrected(others, known.where(known.start < 2.0))
    rows = np.flatnonzero((known.start < 2.0) & np.isfinite(known.error_of("force")))
    touches = np.unique(known.trial[rows]).size
    step = np.nanmedian(one.estimate("force") - others.estimate("force"))
    errors = [
        np.nanmean(-known.error_of("force")[(known.start < 2.0) & (known.trial == at)]) for at in (0, 1)
    ]
    assert step == pytest.approx(sum(errors) / (touches + 1.0))


def test_the_figure_shows_each_number_of_known_touches() -> None:
    rows = [
        dict.fromkeys(KEYS)
        | {"model": model, "touches": touches, "condition": "sealed", "object": "all objects"}
        | {"position_mae_mm": 1.0 / (1 + touches), "intervals": {"position_mae_mm": [0.1, 2.0]}}
        for model in ("a", "b") for touches in (0, 10)
    ]  # fmt: skip
    position, force, _ = drawn(rows).axes
    assert [np.asarray(line.get_ydata()).tolist() for line in position.lines] == [[1.0, 1.0 / 11.0]] * 2
    assert [len(np.asarray(line.get_xdata())) for line in force.lines] == [0, 0]
