"""The loop learns, stops, and goes on after a kill as if there had been none."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.heads.base import CERTAINTY, Task
from monochord.perception.model.definition import Definition, FeatureRecord, HeadRecord
from monochord.perception.model.network import HeadNetwork
from monochord.perception.training.checkpoint import Checkpoint
from monochord.perception.training.examples import Examples
from monochord.perception.training.loop import TrainingSetup, fit
from monochord.perception.training.network import head_loss
from monochord.perception.training.settings import OptimiserSettings
from monochord.physics.strings import load_string

torch = pytest.importorskip("torch")
TASKS = {
    "contact": Task(label="contact", loss="logistic", touched=False),
    "force": Task(label="force", unit="N", loss="laplace", hidden=(16, 16)),
}
COLUMNS = tuple("abcde")
QUICK = {"epochs": 20, "batch": 64, "rate": 0.02}
"""Options with which a thousand examples are learned in half a second."""
SCALER = {"scaler.mean": np.zeros(5, np.float32), "scaler.scale": np.ones(5, np.float32)}


def plan(**options: float) -> TrainingSetup:
    definition = Definition(
        sample_rate=8000,
        channels=2,
        window=800,
        hop=800,
        feature=FeatureRecord(name="made", options={}, columns=COLUMNS),
        heads={name: HeadRecord(task=task, scale=0.5) for name, task in TASKS.items()},
    )
    usual = {"rate": 0.01, "batch": 32, "epochs": 12, **options}
    return TrainingSetup(definition=definition, optimiser=OptimiserSettings(**usual), seed=5)  # pyright: ignore[reportArgumentType]


def with_force_task(setup: TrainingSetup, **changes: Any) -> TrainingSetup:
    """Return the setup with another task of force."""
    record = HeadRecord(task=dataclasses.replace(TASKS["force"], **changes), scale=0.5)
    heads = {**setup.definition.heads, "force": record}
    return dataclasses.replace(setup, definition=dataclasses.replace(setup.definition, heads=heads))


def examples(seed: int, count: int = 256, copies: int = 2) -> Examples:
    """Contact is where the first column is above 0; force is the product of two others, in contact."""
    rng = np.random.default_rng(seed)
    row = rng.normal(size=(count, 5)).astype(np.float32)
    base = np.stack([row, *(row + 0.01 * rng.normal(size=row.shape) for _ in range(copies - 1))]).astype(
        np.float32
    )
    contact = (row[:, 0] > 0.0).astype(float)
    return Examples(
        rows=np.arange(count),
        session=np.arange(count) // 32,
        touch=np.arange(count) // 8,
        base=base,
        labels={"contact": contact, "force": contact * np.prod(row[:, 1:3], axis=1, dtype=np.float64)},
        masks={"contact": np.ones(count, bool), "force": contact == 1.0},
    )


class KilledError(Exception):
    """As a kill would end it, but for the process."""


def after(epochs: int) -> Callable[[Checkpoint], None]:
    def report(state: Checkpoint) -> None:
        if state.epoch == epochs:
            raise KilledError

    return report


def test_it_learns_what_there_is_to_learn(tmp_path: Path) -> None:
    state, _ = fit(plan(**QUICK), SCALER, examples(0, 1024), examples(1), tmp_path / "a")
    assert state.history[0]["contact"] > 3.0 * state.score["contact"]
    assert state.score["force"] < 0.3 * np.abs(examples(1).labels["force"][examples(1).masks["force"]]).mean()


@pytest.mark.parametrize(("at", "blur"), [(1, 0.0), (11, 0.0), (3, 0.3)])
def test_a_run_that_was_killed_ends_as_one_that_was_not(tmp_path: Path, at: int, blur: float) -> None:
    train, validation, setup = examples(0), examples(1), with_force_task(plan(), blur=blur)
    whole, _ = fit(setup, SCALER, train, validation, tmp_path / "whole")
    with pytest.raises(KilledError):
        fit(setup, SCALER, train, validation, tmp_path / "cut", after(at))
    cut, _ = fit(setup, SCALER, train, validation, tmp_path / "cut")
    assert (cut.history, cut.score, cut.at) == (whole.history, whole.score, whole.at)
    for name, array in whole.best.items():
        np.testing.assert_array_equal(cut.best[name], array)
    assert (tmp_path / "cut").read_bytes() == (tmp_path / "whole").read_bytes()
    if blur:
        plain, _ = fit(plan(), SCALER, train, validation, tmp_path / "plain")
        assert whole.history[-1]["force"] != plain.history[-1]["force"]


def test_each_head_keeps_the_weights_of_its_own_best_epoch(tmp_path: Path) -> None:
    states: dict[int, Checkpoint] = {}
    state, _ = fit(
        plan(), SCALER, examples(0), examples(1), tmp_path / "a", lambda s: states.update({s.epoch: s})
    )
    for name, epoch in state.at.items():
        assert (
            state.score[name] == min(line[name] for line in state.history) == state.history[epoch - 1][name]
        )
        for key, array in states[epoch].weights.items():
            if key.startswith(name):
                np.testing.assert_array_equal(state.best[key], array)


def test_it_ends_when_nothing_becomes_better(tmp_path: Path) -> None:
    nothing = examples(0, 64)
    nothing.labels["contact"][:] = np.arange(64) % 2  # which nothing tells
    state, _ = fit(plan(epochs=400, patience=3, rate=0.05), SCALER, nothing, examples(1), tmp_path / "a")
    assert state.epoch == max(state.at.values()) + 3 < 400


def test_a_run_that_is_done_stays_as_it_is(tmp_path: Path) -> None:
    train, validation = examples(0), examples(1)
    fit(plan(), SCALER, train, validation, tmp_path / "a")
    before = (tmp_path / "a").read_bytes()
    fit(plan(), SCALER, train, validation, tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == before


def test_it_does_not_go_on_with_other_data(tmp_path: Path) -> None:
    fit(plan(epochs=1), SCALER, examples(0), examples(1), tmp_path / "a")
    other = {**SCALER, "scaler.mean": np.ones(5, np.float32)}
    for data in ((SCALER, examples(2), examples(1)), (other, examples(0), examples(1))):
        with pytest.raises(InputError, match="checkpoint"):
            fit(plan(epochs=2), *data, tmp_path / "a")


@pytest.mark.parametrize(
    "change",
    [
        {"weights": {"force.0.weight": np.zeros((1 << 10, 5), np.float32)}},
        {"best": {"force.0.weight": np.zeros((16, 4), np.float32)}},
        {"best": {"more": np.zeros(3, np.float32)}},
        {"moments": {"999/exp_avg": np.zeros(3, np.float32)}},
        {"epoch": "many"},
        {"history": 3},
        {"at": {"force": "late"}},
    ],
)
def test_a_checkpoint_of_another_network_is_refused(tmp_path: Path, change: dict[str, Any]) -> None:
    file = tmp_path / "a"
    fit(plan(epochs=1), SCALER, examples(0), examples(1), file)
    whole = Checkpoint.read(file)
    assert whole is not None
    values = {
        name: {**getattr(whole, name), **value} if isinstance(value, dict) and value else value
        for name, value in change.items()
    }
    dataclasses.replace(whole, **values).write(file)
    with pytest.raises(InputError, match="checkpoint"):
        fit(plan(epochs=2), SCALER, examples(0), examples(1), file)


@pytest.mark.parametrize(("columns", "least", "most"), [(("b", "c"), 0.0, 0.5), (("a", "d", "e"), 0.5, 2.0)])
def test_a_head_learns_from_the_columns_that_are_its_inputs(
    tmp_path: Path, columns: tuple[str, ...], least: float, most: float
) -> None:
    setup = with_force_task(plan(**QUICK), columns=columns)
    state, _ = fit(setup, SCALER, examples(0, 1024), examples(1), tmp_path / "a")
    assert state.weights["force.0.weight"].shape == (16, len(columns))
    usual_size = np.abs(examples(1).labels["force"][examples(1).masks["force"]]).mean()
    assert least < state.score["force"] / usual_size < most


def test_weights_decay_in_heads_with_hidden_layers_alone(tmp_path: Path) -> None:
    free, decayed = (
        fit(plan(epochs=3, decay=decay), SCALER, examples(0), examples(1), tmp_path / name)[0].weights
        for name, decay in (("free", 0.0), ("decayed", 20.0))
    )
    np.testing.assert_array_equal(decayed["contact.0.weight"], free["contact.0.weight"])
    assert np.abs(decayed["force.1.weight"]).sum() < 0.5 * np.abs(free["force.1.weight"]).sum()


def refining(scale: float = 1e-3) -> TrainingSetup:
    """Return the setup of a position head that refines the first column, as certain as the second."""
    usual = plan(**QUICK)
    columns = ("cert*", "c")
    task = dataclasses.replace(TASKS["force"], label="position", unit="m", refines="a", columns=columns)
    heads = {**usual.definition.heads, "force": HeadRecord(task=task, scale=scale)}
    string = load_string("prototype").string
    feature = dataclasses.replace(usual.definition.feature, columns=("a", CERTAINTY, "c"))
    definition = dataclasses.replace(usual.definition, heads=heads, string=string, feature=feature)
    return dataclasses.replace(usual, definition=definition)


def test_a_head_refines_a_position_where_it_is_right(tmp_path: Path) -> None:
    setup = refining()
    train, judged = (misread(examples(seed, 1024, 1)) for seed in (0, 1))
    _, weights = fit(setup, SCALER, train, judged, tmp_path / "a")
    network = HeadNetwork.of(setup.definition, {**SCALER, **weights})
    mask = judged.masks["force"]
    base = judged.base[0][mask]
    outputs = [output["force"] for output in network.outputs(base)]
    assert [output.certainty for output in outputs] == base[:, 1].tolist()
    wrong = base[:, 1] > 1.0
    # The column is off by half a millimetre times its neighbour.
    error = 1e-3 * np.array([output.value for output in outputs]) - 5e-4 * base[:, 2]
    assert np.abs(error[~wrong]).mean() < 1.5e-4


def misread(data: Examples) -> Examples:
    """Return examples whose position is the first column, but not where the second is large."""
    row = data.base[0].astype(np.float64)
    position = 0.2 * row[:, 0] + 5e-4 * row[:, 2] + np.where(row[:, 1] > 1.0, 0.05, 0.0)
    return dataclasses.replace(data, labels={**data.labels, "force": position * data.labels["contact"]})


PROBABILITY = Task(label="slip", loss="logistic")
SQUARE, GAUSS, LAPLACE = (Task(label="force", unit="N", loss=loss) for loss in ("square", "gauss", "laplace"))
ALL = torch.ones(4)


@pytest.mark.parametrize("task", [PROBABILITY, SQUARE, GAUSS, LAPLACE])
def test_windows_that_do_not_count_have_no_gradient_and_no_loss(task: Task) -> None:
    output = torch.randn(4, task.outputs, generator=torch.Generator().manual_seed(0)).requires_grad_()
    mask = torch.tensor([1.0, 0.0, 1.0, 0.0])
    head_loss(task, output, torch.ones(4), mask).backward()
    assert not output.grad[mask == 0.0].any()
    assert output.grad[mask == 1.0].any(dim=1).all()
    assert float(head_loss(task, torch.ones(4, task.outputs), torch.ones(4), torch.zeros(4))) == 0.0


@pytest.mark.parametrize("task", [GAUSS, LAPLACE])
def test_the_learned_spread_is_that_of_the_errors(task: Task) -> None:
    output = torch.zeros(4, 2)
    output[:, 1] = math.log(0.5)
    output.requires_grad_()
    head_loss(task, output, torch.tensor([0.5, -0.5, 0.5, -0.5]), ALL).backward()
    assert float(output.grad[:, 1].abs().max()) == pytest.approx(0.0, abs=1e-6)
