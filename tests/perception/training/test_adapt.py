"""Adaptation of a trained model to a build whose labels follow another law, by a few known touches."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.running import record
from tests.conftest import sing
from tests.perception.conftest import with_corrections

from monochord.cli import run
from monochord.core.config import to_tree
from monochord.core.errors import InputError
from monochord.core.types import Estimate
from monochord.datasets.build import build_dataset
from monochord.datasets.store import Dataset
from monochord.perception.model import Model, load
from monochord.perception.model.definition import FaultRecord
from monochord.perception.model.faults import NAMES
from monochord.perception.model.network import quantity
from monochord.perception.model.stepping import with_length_error
from monochord.perception.training.adapt import adapt, desensitised, judge
from monochord.perception.training.adaptation import Adaptation
from monochord.perception.training.calibration import calibrated
from monochord.perception.training.examples import touches_of
from monochord.perception.training.train import read_in_turn
from monochord.perception.tuning.sessions import force_scale
from monochord.physics.sensors import load_sensor

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")
BIAS = 0.5


@pytest.fixture(scope="module")
def made() -> list[Model]:
    """The model of `correctable`, once a test asked for it: it is a value, and its prior takes a second."""
    return []


@pytest.fixture(scope="module")
def adaptations() -> list[Adaptation]:
    """The result of `adapted`, once a test asked for it."""
    return []


@pytest.fixture
def correctable(lesson_run: Path, learnable: Path, made: list[Model]) -> Model:
    """The model of `lesson` with corrections, whose prior knows biased sessions as well."""
    if not made:
        made.append(with_corrections(load(lesson_run), learnable, BIAS))
    return made[0]


def biased(tmp_path: Path, name: str, seed: int, bias: float, **more: Any) -> Path:
    """Return a session of an object on which the same sound means another force."""
    return sing(tmp_path / f"{name}.mcap", seed, bias=bias, **more)


@pytest.fixture(scope="module")
def foreign_session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of a build on which the same sound means half a newton more."""
    return biased(tmp_path_factory.mktemp("foreign"), "foreign", 77, BIAS)


@pytest.fixture(scope="module")
def foreign(foreign_session: Path) -> Dataset:
    return build_dataset([foreign_session], foreign_session.with_name("dataset"))


@pytest.fixture
def adapted(correctable: Model, foreign: Dataset, adaptations: list[Adaptation]) -> Adaptation:
    """The adaptation of `correctable` by all touches of `foreign`."""
    if not adaptations:
        adaptations.append(adapt(correctable, foreign))
    return adaptations[0]


def test_known_touches_of_another_build_take_its_bias_away(correctable: Model, foreign: Dataset) -> None:
    result = adapt(correctable, foreign, touches=8)
    force = result.heads["force"]
    assert force.touches == 8
    assert force.before > 0.8 * BIAS
    assert force.after < 0.6 * force.before
    assert force.coverage > 0.5
    assert result.heads["position"].after < 1.2 * result.heads["position"].before
    assert result.next_touch is not None
    assert 0.05 <= result.next_touch.position <= 0.15
    assert 0.0 < result.next_touch.gain < 1.0


def test_a_head_that_no_touch_could_correct_is_named(correctable: Model, foreign: Dataset) -> None:
    unknown, unused = np.full(len(foreign), np.nan), np.zeros(len(foreign), bool)
    labels, valid = {**foreign.labels, "force": unknown}, {**foreign.valid, "force": unused}
    positions = replace(foreign, labels=labels, valid=valid)
    for result in (adapt(correctable, positions, touches=8), judge(correctable, positions)):
        (line,) = [each for each in result.lines() if "could be used" in each]
        assert "force" in line
        assert "position" not in line
    assert "could be used" not in "".join(judge(correctable, foreign).lines())


def test_the_touch_to_make_next_lies_within_the_sensing_range(correctable: Model, foreign: Dataset) -> None:
    anywhere = adapt(correctable, foreign, touches=8).next_touch
    assert anywhere is not None
    span = (0.05, 0.1) if anywhere.position > 0.1 else (0.1, 0.15)
    for result in (
        adapt(correctable, foreign, touches=8, sensing_range=span),
        judge(correctable, foreign, sensing_range=span),
    ):
        assert result.next_touch is not None
        assert span[0] <= result.next_touch.position <= span[1]
    assert adapt(correctable, foreign, touches=8, sensing_range=(0.3, 0.4)).next_touch is None


@pytest.mark.parametrize("touches", [None, 0])
def test_known_touches_outside_the_sensing_range_are_named_and_left_out(
    correctable: Model, foreign_session: Path, tmp_path: Path, touches: int | None
) -> None:
    given, span, out = tmp_path / "given", (0.07, 0.13), None if touches == 0 else tmp_path / "out"
    correctable.save(given)
    dataset = build_dataset([foreign_session], tmp_path / "all")
    touched = dataset.label("contact") == 1.0
    touch, place = touches_of(dataset)[touched], dataset.label("position")[touched]
    means = np.array([place[touch == each].mean() for each in np.unique(touch)])
    inside = (means >= span[0]) & (means <= span[1])
    assert 0 < inside.sum() < inside.size
    result = calibrated(str(given), [str(foreign_session)], out, touches=touches, sensing_range=span)
    assert result.outside == pytest.approx(means[~inside])
    assert result.heads["force"].touches == result.heads["position"].touches == inside.sum()
    assert result.trust.touches == inside.sum()
    assert result.trust.position is not None
    assert span[0] <= result.trust.position[0] < result.trust.position[1] <= span[1]
    (line,) = [each for each in result.lines() if "70 to 130 mm" in each]
    assert str((~inside).sum()) in line
    ordered = np.sort(means)
    widest = int(np.diff(ordered).argmax())
    untouched = (float(ordered[widest]) + 1e-4, float(ordered[widest + 1]) - 1e-4)
    for nowhere in (untouched, (0.01, 0.02)):
        with pytest.raises(InputError, match=" mm"):
            calibrated(
                str(given), [str(foreign_session)], tmp_path / "no", touches=touches, sensing_range=nowhere
            )
        assert not (tmp_path / "no").exists()


def test_the_sensing_range_is_that_of_the_sensor_that_a_session_names(
    correctable: Model, foreign_session: Path, tmp_path: Path
) -> None:
    correctable.save(given := tmp_path / "given")
    sensor = {**to_tree(load_sensor("prototype")), "range": [0.09, 0.12]}
    named = biased(tmp_path, "named", 77, 0.0, sensor=sensor)
    result = calibrated(str(given), [str(named)], None, touches=0)
    assert result.sensing_range == (0.09, 0.12)
    assert result.outside
    unnamed = calibrated(str(given), [str(foreign_session)], None, touches=0)
    assert unnamed.sensing_range == load_sensor("prototype").range
    assert not unnamed.outside


def test_for_other_objects_a_sensor_is_learned_in_part_and_its_objects_stay_uncertain(
    correctable: Model, foreign: Dataset
) -> None:
    same, others = (adapt(correctable, foreign, touches=8, objects=each) for each in ("same", "others"))
    before, *learned = (each.correction("force") for each in (correctable, same.model, others.model))
    assert before is not None
    at = np.zeros((1, len(before.centre)))
    (own, own_std), (further, further_std) = (each.error(at) for each in learned if each)
    # Of a bias of one object, a third is taken for the build's.
    assert 0.15 < float(further[0] / own[0]) < 0.45
    assert own_std[0] < 0.5 * further_std[0]
    assert others.heads["force"].used
    assert same.heads["force"].after < others.heads["force"].after < others.heads["force"].before
    assert not others.trust.others  # one object says nothing of others
    with pytest.raises(InputError, match="8 touches"):
        adapt(same.model, foreign, objects="others")


def test_an_object_is_judged_by_the_others_where_there_are_several(
    correctable: Model, foreign_session: Path, tmp_path: Path
) -> None:
    files = [foreign_session, biased(tmp_path, "further", 78, BIAS), biased(tmp_path, "third", 79, BIAS)]
    dataset = build_dataset(files, tmp_path / "several")
    one, several = (
        adapt(correctable, each, objects="others")
        for each in (build_dataset(files[:1], tmp_path / "one"), dataset)
    )
    assert several.heads["force"].used
    # What all of them err alike is the build's.
    assert several.heads["force"].after < one.heads["force"].after
    assert several.trust.others
    assert not one.trust.others


def test_an_adapted_model_is_saved_and_remembers_what_it_heard(
    adapted: Adaptation, foreign: Dataset, tmp_path: Path
) -> None:
    model = adapted.model
    again = load(tmp_path / "model") if model.save(tmp_path / "model") else model
    record = again.definition.heads["force"].correction
    assert record is not None
    assert (record.touches, record.variables) == (12, ())
    assert "foreign" in again.definition.sessions
    result = adapt(again, foreign, touches=3)
    more = result.model.definition.heads["force"].correction
    assert more is not None
    assert more.touches == (15 if result.heads["force"].used else 12)


def test_a_model_that_learned_no_prior_is_corrected_by_physics(
    lesson_run: Path, foreign: Dataset, tmp_path: Path
) -> None:
    """A position is off by an offset and a length, and its stated error has no other length in it then."""
    model = load(lesson_run)
    place = foreign.label("position")
    longer = replace(foreign, labels={**foreign.labels, "position": 1.1 * place + 2e-3})
    result = adapt(model, longer)
    assert all(result.heads[name].used for name in ("position", "force"))
    assert result.heads["position"].after < 0.5 * result.heads["position"].before
    assert result.heads["force"].after < 0.5 * result.heads["force"].before
    assert result.next_touch is None  # it keeps none to choose from
    result.model.save(tmp_path / "model")
    again = load(tmp_path / "model")
    record, correction = again.definition.heads["position"], again.correction("position")
    outputs = read_in_turn(again, longer, np.flatnonzero(longer.valid["position"])).outputs
    off = [
        quantity(each["position"], record, correction)[0] - longer.label("position")[row]
        for row, each in outputs.items()
    ]
    assert np.median(np.abs(off)) < 0.4 * (0.1 * 0.1 + 2e-3)
    position = Estimate(value=0.1, std=1e-4, unit="m")
    unsure = replace(again, definition=replace(again.definition, length_std=0.01))
    assert with_length_error(unsure.prepared, {"position": position})["position"] == position


def test_one_touch_moves_force_by_less_than_its_error(correctable: Model, foreign: Dataset) -> None:
    """A prior says how much of one error is the sensor's; there is nothing yet to judge it by."""
    result = adapt(correctable, foreign, touches=1)
    assert result.heads["force"].used
    before, after = correctable.correction("force"), result.model.correction("force")
    assert before is not None
    assert after is not None
    scale = correctable.definition.heads["force"].scale
    moved, std = (scale * float(each) for each in after.error(np.zeros(1)))
    assert 0.3 * BIAS < moved < 1.1 * BIAS
    assert std < scale * float(before.error(np.zeros(1))[1])


def test_many_touches_teach_what_physics_does_not_say(correctable: Model, tmp_path: Path) -> None:
    """Force that follows the level of the hum, too, is learned from the window's columns."""
    files = [biased(tmp_path, f"take_{seed}", seed, 0.0) for seed in range(80, 83)]
    dataset = build_dataset(files, tmp_path / "many")
    extract = correctable.prepared.extractor
    level = extract(dataset.batch(np.arange(len(dataset))))[:, 3]
    touched = dataset.label("contact") == 1.0
    level = (level - level[touched].mean()) / level[touched].std()
    force = dataset.label("force") + 0.5 + 0.3 * np.clip(level, -1.5, 1.5)
    odd = replace(dataset, labels={**dataset.labels, "force": force})
    result = adapt(correctable, odd)
    record = result.model.definition.heads["force"].correction
    assert record is not None
    assert record.residual
    assert record.nodes > 0
    assert result.heads["force"].after < 0.8 * result.heads["force"].before
    result.model.save(tmp_path / "model")
    again = load(tmp_path / "model")
    rows = np.arange(40)
    outputs = [read_in_turn(each, odd, rows).outputs for each in (again, result.model)]
    assert {row: each["force"] for row, each in outputs[0].items()} == {
        row: each["force"] for row, each in outputs[1].items()
    }
    correction = again.correction("force")
    assert correction is not None
    assert correction.forest.shape == (record.nodes, 3)


def test_a_head_that_known_touches_do_not_help_is_left_as_it_was(
    correctable: Model, foreign: Dataset
) -> None:
    side = np.where(touches_of(foreign) % 2 == 0, 0.02, -0.02)  # one touch teaches nothing about the next
    misread = replace(foreign, labels={**foreign.labels, "position": foreign.label("position") + side})
    result = adapt(correctable, misread, touches=8)
    assert not result.heads["position"].used
    assert result.heads["force"].used
    for name, changed in (("position", False), ("force", True)):
        before, after = correctable.correction(name), result.model.correction(name)
        assert before is not None
        assert after is not None
        assert np.array_equal(before.mean, after.mean) != changed


def test_positions_from_the_other_end_are_refused(correctable: Model, foreign: Dataset) -> None:
    design = load_sensor("prototype").string
    model = replace(correctable, definition=replace(correctable.definition, string=design))
    position = design.length - foreign.label("position")
    mirrored = replace(foreign, labels={**foreign.labels, "position": position})
    with pytest.raises(InputError, match="other end"):
        adapt(model, mirrored)


def test_what_a_sensor_in_order_sounds_like_is_no_fault_from_then_on(correctable: Model) -> None:
    limits, swapped = (2.0,) * len(NAMES), NAMES.index("microphones swapped")
    model = replace(
        correctable, definition=replace(correctable.definition, faults=FaultRecord(limits=limits))
    )
    odds = np.full((100, len(NAMES)), -8.0)
    same, none = desensitised(model, list(odds))
    assert not none
    assert same.definition.faults == FaultRecord(limits=limits)
    odds[:30, swapped] = 3.0
    odds[30:, swapped] = 1.5
    result, mistaken = desensitised(model, list(odds))
    assert mistaken == {"the microphones seem swapped": 0.3}
    assert result.definition.faults is not None
    raised = np.array(result.definition.faults.limits) - limits
    assert np.flatnonzero(raised).tolist() == [swapped]
    assert raised[swapped] == pytest.approx(1.0)


def test_a_head_whose_touches_cannot_be_estimated_is_left_out(correctable: Model, foreign: Dataset) -> None:
    """As the position of an object that is too soft: force is learned all the same."""
    nothing = np.zeros(len(foreign), bool)
    result = adapt(correctable, replace(foreign, valid={**foreign.valid, "position": nothing}))
    assert result.heads.keys() == {"force"}
    with pytest.raises(InputError, match="0 touches"):
        adapt(correctable, replace(foreign, valid={**foreign.valid, "position": nothing, "force": nothing}))


def test_too_few_touches_are_refused(correctable: Model, foreign: Dataset) -> None:
    with pytest.raises(InputError, match=r"12 touches.*40"):
        adapt(correctable, foreign, touches=40)


def test_the_command_writes_a_model_that_live_takes(
    correctable: Model, foreign_session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, out = tmp_path / "given", tmp_path / "out"
    correctable.save(given)
    line = ["calibrate", str(given), "--sessions", str(foreign_session), "--touches", "6", "--out", str(out)]
    assert run(line) == 0
    assert "6 touches" in capsys.readouterr().out
    assert load(out).definition.heads["force"].correction
    assert run(line) == 2
    assert str(out) in capsys.readouterr().err


def test_a_model_that_is_judged_stays_as_it_is(
    correctable: Model, adapted: Adaptation, foreign: Dataset
) -> None:
    result = judge(correctable, foreign)
    assert result.model is correctable
    assert not result.learned
    for name, head in result.heads.items():
        assert head.touches == 12
        assert head.before == head.after == head.expected == pytest.approx(adapted.heads[name].before)
        assert not head.used
        assert not head.learned
    assert result.heads["force"].before > 0.8 * BIAS
    nothing = {name: np.zeros(len(foreign), bool) for name in ("position", "force")}
    with pytest.raises(InputError, match="0 touches"):
        judge(correctable, replace(foreign, valid={**foreign.valid, **nothing}))


def test_a_model_without_corrections_can_be_judged(lesson_run: Path, foreign: Dataset) -> None:
    result = judge(load(lesson_run), foreign)
    assert result.heads["force"].before > 0.8 * BIAS
    assert result.next_touch is None


def test_it_is_trusted_where_the_known_touches_lie(correctable: Model, foreign: Dataset) -> None:
    result = adapt(correctable, foreign, touches=8)
    known = np.isin(touches_of(foreign), np.unique(touches_of(foreign)[foreign.label("contact") == 1.0])[:8])
    for name, span in (("position", result.trust.position), ("force", result.trust.force)):
        values = foreign.label(name)[known]
        assert span == (pytest.approx(np.nanmin(values)), pytest.approx(np.nanmax(values)))
    assert result.trust.touches == 8
    assert result.trust.errors["force"] == result.heads["force"].after


def test_the_command_judges_a_model_by_all_touches_and_writes_none(
    correctable: Model, foreign_session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given, out = tmp_path / "given", tmp_path / "out"
    correctable.save(given)
    line = ["calibrate", str(given), "--sessions", str(foreign_session), "--touches", "0"]
    before = {file.name: file.read_bytes() for file in given.iterdir()}
    tree = record(capsys, *line)
    assert tree["path"] is None
    assert tree["heads"]["force"]["learned"] is False
    assert tree["trust"]["touches"] == 12
    assert run([*line, "--out", str(out)]) == 0
    assert load(out).definition == load(given).definition
    assert {file.name: file.read_bytes() for file in given.iterdir()} == before
    assert run([*line[:-1], "3"]) == 2
    assert "--out" in capsys.readouterr().err


def test_forces_of_a_string_tuned_otherwise_are_known_as_of_the_design(
    correctable: Model, foreign: Dataset
) -> None:
    design = load_sensor("prototype").string
    model = replace(correctable, definition=replace(correctable.definition, string=design))
    looser = replace(design, tension=0.9 * design.tension)
    part = replace(foreign.manifest.parts[0], tension=looser.tension, tuned="recorded")
    tuned = replace(
        foreign,
        labels={**foreign.labels, "force": foreign.label("force") * force_scale(looser, design)},
        manifest=replace(foreign.manifest, parts=(part,)),
    )
    known, expected = (
        adapt(model, dataset, touches=8).model.correction("force") for dataset in (tuned, foreign)
    )
    assert known is not None
    assert expected is not None
    np.testing.assert_allclose(known.mean, expected.mean, atol=1e-6)
