"""Each head keeps the method with the smallest error on validation, and states its uncertainty as before."""

import dataclasses
import json
import sys
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.perception.conftest import LessonBy
from tests.perception.windows import window_of

from monochord.core.errors import InputError, MissingLibraryError
from monochord.core.installing import TORCH_INDEX
from monochord.core.types import Audio, Floats, Indices
from monochord.datasets.split import Split
from monochord.datasets.store import open_dataset
from monochord.front.train import TrainedModel
from monochord.front.train import train as front_train
from monochord.metrics import coverage
from monochord.perception.heads.base import Task
from monochord.perception.model import ModelState, load
from monochord.perception.model.definition import Definition, Method
from monochord.perception.model.network import HeadNetwork
from monochord.perception.training.choice import LearnedHeads, choose, head_error, regressions
from monochord.perception.training.examples import Examples, scaled_heads, scaling
from monochord.perception.training.regression import FittedRegression, RegressionWindows, fit_regression
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import TrainingResult, train

pytestmark = pytest.mark.usefixtures("made_up_features")
EACH = pytest.mark.parametrize("method", ["ridge", "extra_trees"])


def learned(lesson: dict[str, Any], out: Path, **settings: Any) -> TrainingResult:
    return train(TrainingSettings.read({**lesson, **settings}), out)


@pytest.fixture(scope="module")
def rows() -> tuple[Audio, Floats, Floats]:
    """Rows of three columns, targets that are linear in the first, and errors that grow with the second."""
    rng = np.random.default_rng(0)
    inputs = rng.uniform(-2.0, 2.0, (2000, 3)).astype(np.float32)
    spread = 0.1 * np.exp(inputs[:, 1].astype(np.float64))
    return inputs, 0.7 * inputs[:, 0] + spread * rng.laplace(size=2000), spread


@EACH
def test_a_regression_learns_the_quantity_and_its_spread(
    rows: tuple[Audio, Floats, Floats], method: Method
) -> None:
    inputs, target, spread = rows
    task = Task(label="force", unit="N", loss="laplace")
    fitted = fit_regression(
        method, task, RegressionWindows.of(inputs[:1500], target[:1500], np.arange(1500) // 10)
    )
    error = fitted.first(inputs[1500:]) - 0.7 * inputs[1500:, 0]
    assert np.abs(error).mean() < (0.05 if method == "ridge" else 0.25)
    stated = np.exp(inputs[1500:] @ fitted.weight[1] + fitted.bias[1])
    assert np.corrcoef(np.log(stated), np.log(spread[1500:]))[0, 1] > 0.9
    assert 0.7 < np.mean(np.abs(target[1500:] - fitted.first(inputs[1500:])) / stated) < 1.4


@EACH
def test_a_regression_learns_a_probability(rows: tuple[Audio, Floats, Floats], method: Method) -> None:
    inputs, task = rows[0], Task(label="slip", loss="logistic")
    label = (inputs[:, 0] + inputs[:, 2] > 0.0).astype(np.float64)
    fitted = fit_regression(
        method, task, RegressionWindows.of(inputs[:1500], label[:1500], np.arange(1500) // 10)
    )
    assert np.mean((fitted.first(inputs[1500:]) > 0.0) == (label[1500:] == 1.0)) > 0.95
    assert fitted.weight.shape == (1, 3)


@EACH
def test_a_wrong_position_does_not_disturb_what_is_learned_of_right_ones(method: Method) -> None:
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(900, 2)).astype(np.float32)
    wrong = inputs[:, 1] > 1.0  # a wrong pair of lines: 80 mm off, in units of 1 mm
    target = np.where(wrong, 80.0, 0.3 * inputs[:, 0]).astype(np.float64)
    task = Task(label="position", unit="m", loss="laplace", refines="position")
    fitted = fit_regression(method, task, RegressionWindows.of(inputs, target, np.arange(900)))
    right = ~wrong & (inputs[:, 1] < 0.7)
    assert np.abs(fitted.first(inputs) - target)[right].mean() < 0.15
    assert fitted.weight.shape == (2, 2)


def drawn(count: int, columns: int = 40) -> RegressionWindows:
    """Windows that are made as they are read, of which a block is in memory."""
    weight = np.random.default_rng(0).normal(size=columns)

    def block(first: int) -> Audio:
        return (
            np.random.default_rng(first).normal(size=(min(1000, count - first), columns)).astype(np.float32)
        )

    def blocks() -> Iterator[tuple[Indices, Audio]]:
        for first in range(0, count, 1000):
            yield np.arange(first, min(first + 1000, count)), block(first)

    target = np.concatenate([block(first) @ weight for first in range(0, count, 1000)])
    target = target + np.random.default_rng(1).laplace(size=count)
    return RegressionWindows(blocks=blocks, target=target, group=np.arange(count) // 50)


def test_ridge_learns_from_all_windows_and_holds_a_block() -> None:
    task, peaks = Task(label="force", unit="N", loss="laplace"), list[int]()
    for count in (4_000, 60_000):
        windows = drawn(count)
        tracemalloc.start()
        fitted = fit_regression("ridge", task, windows)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (
        peaks[1] - peaks[0] < 100 * 56_000
    )  # of 160 bytes of inputs a window, which are 320 as they are summed
    inputs = np.concatenate([rows for _, rows in windows.blocks()]).astype(np.float64)
    centre = inputs.mean(axis=0)
    best = np.linalg.lstsq(inputs - centre, windows.target - windows.target.mean(), rcond=None)[0]
    np.testing.assert_allclose(fitted.weight[0], best, atol=1e-3)  # no draw is as near
    whole = fit_regression("ridge", task, RegressionWindows.of(inputs, windows.target, windows.group))
    np.testing.assert_allclose(fitted.weight, whole.weight, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(fitted.bias, whole.bias, rtol=1e-4, atol=1e-6)


@EACH
def test_one_window_or_one_group_is_enough(method: Method) -> None:
    task, one = Task(label="force", unit="N", loss="gauss"), np.ones((1, 2), np.float32)
    alone = fit_regression(method, task, RegressionWindows.of(one, np.ones(1), np.zeros(1, np.int64)))
    assert np.isfinite(alone.first(one)).all()
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(60, 2)).astype(np.float32)
    target = 2.0 * inputs[:, 0].astype(np.float64)
    fitted = fit_regression(method, task, RegressionWindows.of(inputs, target, np.zeros(60, np.int64)))
    assert np.abs(fitted.first(inputs) - 2.0 * inputs[:, 0]).mean() < 0.8


def test_methods_are_compared_and_probabilities_calibrated_in_each_noise(
    lesson: dict[str, Any], tmp_path: Path
) -> None:
    noise = {"copies": 1, "kinds": ["white", "chord", "chord", "chord"], "ratios": [-10.0, -5.0]}
    quiet, noisy = (
        learned(lesson, tmp_path / name, methods=["ridge"], noise={**noise, "copies": copies})
        for name, copies in (("quiet", 0), ("noisy", 1))
    )
    assert {choice.noises for choice in quiet.choices.values()} == {()}
    assert {choice.noises for choice in noisy.choices.values()} == {("white", "chord")}
    stored = json.loads((tmp_path / "noisy/metrics.json").read_text())["methods"]
    assert stored["slip"]["noises"] == ["white", "chord"]
    for name in ("contact", "slip"):
        before, after = (each.model.definition.heads[name].calibration for each in (quiet, noisy))
        assert after.windows == before.windows  # copies are no further evidence
        # Where slip drowns, as it does here, no probability is as sure as in quiet.
        assert after.factor > 1.5 * before.factor, name


def made_examples(definition: Definition, labels: Floats, base: Audio) -> Examples:
    count, names = len(labels), list(definition.heads)
    truth: dict[str, Floats] = {name: np.arange(count, dtype=np.float64) % 2.0 for name in names}
    truth["force"] = labels
    return Examples(
        rows=np.arange(count),
        session=np.arange(count) // 20,
        touch=np.arange(count),
        base=base[np.newaxis],
        labels=truth,
        masks={name: np.ones(count, bool) for name in names},
    )


@pytest.mark.parametrize(("shape", "best"), [("linear", "ridge"), ("steps", "extra_trees")])
def test_what_fits_the_data_is_chosen(drawn_definition: Definition, shape: str, best: Method) -> None:
    rng, definition = np.random.default_rng(0), drawn_definition
    base = rng.normal(size=(800, len(definition.feature.columns))).astype(np.float32)
    own = base[:, 0].astype(np.float64)
    labels = 2.0 * own if shape == "linear" else np.sign(own) * np.sign(base[:, 1])
    train, validation = (
        made_examples(definition, labels[part], base[part]) for part in (slice(600), slice(600, 800))
    )
    scaler, scaled = scaling(train), scaled_heads(definition, train)
    methods: tuple[Method, ...] = ("ridge", "extra_trees")
    candidates: dict[Method, LearnedHeads] = {
        each: regressions(each, scaled, scaler, train) for each in methods
    }
    chosen, choices = choose(candidates, scaler, validation)
    assert choices["force"].method == best == chosen.definition.heads["force"].method
    assert set(chosen.weights) == {
        name for name in chosen.definition.shapes() if name.partition(".")[0] != "scaler"
    }
    # A method that is hardly better is no reason to leave the first one.
    again, same = choose({"network": candidates[best], best: candidates[best]}, scaler, validation)
    assert same["force"].method == "network"
    assert isinstance(again, LearnedHeads)


@pytest.fixture
def drawn_definition() -> Definition:
    """A definition of two heads on ten columns."""
    from monochord.perception.model.definition import FeatureRecord, HeadRecord

    return Definition(
        sample_rate=8000,
        channels=2,
        window=800,
        hop=800,
        feature=FeatureRecord(name="bands", options={}, columns=tuple(f"band {at}" for at in range(10))),
        heads={
            "contact": HeadRecord(task=Task(label="contact", loss="logistic", touched=False)),
            "force": HeadRecord(task=Task(label="force", unit="N", loss="laplace", hidden=(8,))),
        },
    )


@EACH
def test_each_method_is_calibrated_and_beats_the_mean_label(
    lesson_by: LessonBy, method: Method, learnable: Path
) -> None:
    dataset = open_dataset(learnable)
    test = Split.read(dataset.path / "split.json").test
    model, state = load(lesson_by(method)), ModelState()
    errors, stds = dict[str, list[float]](), dict[str, list[float]]()
    abstained = 0
    for row in test.tolist():
        state, estimates = model.step(state, window_of(dataset, row))
        contact = dataset.label("contact")[row]
        for name in ("position", "force"):
            if contact == 1.0 and estimates[name].valid:
                errors.setdefault(name, []).append(estimates[name].value - float(dataset.label(name)[row]))
                stds.setdefault(name, []).append(estimates[name].std)
        abstained += contact == 0.0 and not estimates["position"].valid
    for name in ("position", "force"):
        label = dataset.label(name)[test]
        by_mean = np.nanmean(np.abs(label - model.definition.heads[name].offset))
        assert np.mean(np.abs(errors[name])) < 0.6 * by_mean, name
        own = np.array(errors[name])
        assert 0.5 < coverage(np.zeros(len(own)), own, np.array(stds[name]), 1.0) < 0.97, name
    assert abstained > 0.9 * np.sum(dataset.label("contact")[test] == 0.0)


@EACH
def test_equal_rows_give_equal_bits_in_any_batch(lesson_by: LessonBy, method: Method) -> None:
    model = load(lesson_by(method))
    mean, scale = model.weights["scaler.mean"], model.weights["scaler.scale"]
    rows = (mean + scale * np.random.default_rng(0).normal(size=(7, len(mean)))).astype(np.float32)
    network = HeadNetwork.of(model.definition, model.weights)
    assert network.outputs(rows) == [network.outputs(rows[at : at + 1])[0] for at in range(7)]


@pytest.fixture
def no_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide PyTorch."""
    monkeypatch.setitem(sys.modules, "torch", None)


@pytest.mark.usefixtures("no_torch")
def test_without_pytorch_the_network_is_left_out_and_says_how_to_have_it(
    lesson: dict[str, Any], tmp_path: Path
) -> None:
    given = [f"{name}={lesson[name]!r}".replace("'", '"') for name in ("title", "cache")]
    settings = [*given, 'feature={name="bands"}', "noise.copies=0"]
    model = front_train(lesson["dataset"], tmp_path / "run", config="paper", settings=[*settings, *HEADS])
    assert isinstance(model, TrainedModel)
    assert model.epochs == 0
    assert {choice.method for choice in model.choices.values()} <= {"ridge", "extra_trees"}
    assert model.left_out.endswith(TORCH_INDEX)
    assert not (tmp_path / "run/history.csv").exists()
    assert load(tmp_path / "run").definition == model.definition


HEADS = ('methods=["network", "ridge", "extra_trees"]', "heads={contact={}, position={}, force={}}")


@pytest.mark.usefixtures("no_torch")
def test_the_network_alone_requires_pytorch(lesson: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(MissingLibraryError, match=r"requires torch.*Install it"):
        learned(lesson, tmp_path / "run", methods=["network"])
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("methods", [[], ["ridge", "ridge"], ["forest"]])
def test_methods_that_make_no_sense_are_refused(lesson: dict[str, Any], methods: list[str]) -> None:
    with pytest.raises(InputError, match="methods"):
        TrainingSettings.read({**lesson, "methods": methods})


def test_a_damaged_forest_is_refused_or_ends(lesson_by: LessonBy) -> None:
    model = load(lesson_by("extra_trees"))
    name = next(name for name in model.weights if name.endswith(".forest"))
    nodes = model.weights[name].copy()
    nodes[:, [0, 2]] = np.random.default_rng(0).normal(scale=1e6, size=(len(nodes), 2))
    broken = dataclasses.replace(model, weights={**model.weights, name: nodes})
    assert broken.prepared.network.outputs(np.zeros((1, len(model.definition.feature.columns)), np.float32))
    record = model.definition.heads["contact"]
    with pytest.raises(InputError, match="nodes"):
        dataclasses.replace(record, nodes=1 << 40)


def test_a_linear_layer_is_a_regression_without_trees() -> None:
    layer = FittedRegression(weight=np.ones((1, 2), np.float32), bias=np.full(1, 0.5, np.float32))
    assert layer.first(np.ones((3, 2))).tolist() == [2.5, 2.5, 2.5]


def test_a_wrong_position_costs_more_than_none(drawn_definition: Definition) -> None:
    task = Task(label="position", unit="m", loss="laplace", refines="position")
    record = dataclasses.replace(drawn_definition.heads["force"], task=task, scale=1e-3)
    zeros = np.zeros(2)
    value = np.array([0.0, 60.0])
    assert head_error(record, value, np.array([1.0, 0.5]), zeros) == pytest.approx(2.5e-3)
    assert head_error(record, value, np.ones(2), zeros) == pytest.approx(30e-3)
