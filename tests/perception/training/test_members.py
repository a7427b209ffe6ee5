"""A head of several members: each learns by itself, together they err less and know where they disagree."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.perception.heads.base import Loss, Task
from monochord.perception.model.definition import Definition, FeatureRecord, HeadRecord
from monochord.perception.model.network import Network
from monochord.perception.training.examples import Examples
from monochord.perception.training.loop import TrainingSetup, fit
from monochord.perception.training.network import TrainingTensors
from monochord.perception.training.settings import OptimiserSettings

torch = pytest.importorskip("torch")
CONTACT = Task(label="contact", loss="logistic", touched=False, context=False)
POSITION = Task(label="position", unit="m", loss="laplace", context=False, hidden=(16, 16))
SCALER = {"scaler.mean": np.zeros(5, np.float32), "scaler.scale": np.ones(5, np.float32)}


def definition(members: int, loss: Loss = "laplace") -> Definition:
    task = dataclasses.replace(POSITION, members=members, loss=loss)
    return Definition(
        sample_rate=8000,
        channels=2,
        window=800,
        hop=800,
        feature=FeatureRecord(name="made", options={}, columns=tuple("abcde")),
        heads={"contact": HeadRecord(task=CONTACT), "position": HeadRecord(task=task, scale=0.5)},
    )


def examples(seed: int, count: int = 512) -> Examples:
    """Position is a curved function of three columns, with noise."""
    rng = np.random.default_rng(seed)
    row = rng.normal(size=(count, 5)).astype(np.float32)
    position = np.sin(2.0 * row[:, 1]) + row[:, 2] * row[:, 3] + 0.1 * rng.normal(size=count)
    return Examples(
        rows=np.arange(count),
        session=np.arange(count) // 32,
        touch=np.arange(count) // 8,
        base=row[None],
        context=np.zeros((1, count, 0), np.float32),
        labels={"contact": (row[:, 0] > 0.0).astype(float), "position": position.astype(float)},
        masks={"contact": np.ones(count, bool), "position": np.ones(count, bool)},
    )


def learned(members: int, folder: Path) -> Network:
    setup = TrainingSetup(
        definition=definition(members),
        optimiser=OptimiserSettings(rate=0.01, batch=32, epochs=15),
        drop=0.0,
        seed=1,
    )
    _, weights = fit(setup, SCALER, examples(0), examples(1), folder)
    return Network.of(setup.definition, {**SCALER, **weights})


def errors(network: Network) -> tuple[Floats, Floats]:
    """Return errors and standard errors on windows that were not trained on."""
    judged = examples(2, 2048)
    outputs = network.outputs("position", judged.base[0])
    spread = np.array([np.sqrt(2.0) * np.exp(output.log_spread) for output in outputs])
    return 0.5 * np.array([output.value for output in outputs]) - judged.labels["position"], 0.5 * spread


def test_together_they_err_less_and_are_far_off_more_rarely(tmp_path: Path) -> None:
    (one, one_std), (four, four_std) = (
        errors(learned(members, tmp_path / f"{members}")) for members in (1, 4)
    )
    assert np.abs(four).mean() < 0.9 * np.abs(one).mean()
    assert (np.abs(four) > 4.0 * four_std).mean() < 0.5 * (np.abs(one) > 4.0 * one_std).mean()


@pytest.mark.parametrize("loss", ["laplace", "gauss", "square"])
def test_training_judges_by_what_the_model_says(loss: Loss) -> None:
    record = definition(3, loss)
    rng = np.random.default_rng(0)
    weights = {
        name: 0.3 * rng.normal(size=shape).astype(np.float32)
        for name, shape in record.shapes().items()
        if not name.startswith("scaler")
    }
    data = examples(2, 64)
    tensors = TrainingTensors(record, SCALER, data)
    given = {name: torch.from_numpy(array) for name, array in weights.items()}
    judged, _ = tensors.whole_copy("position", record.heads["position"].task, given, 0)
    outputs = Network.of(record, {**SCALER, **weights}).outputs("position", data.base[0])
    values = np.array([(output.value, output.log_spread) for output in outputs])
    assert judged.numpy() == pytest.approx(values[:, : judged.shape[1]], abs=1e-5)


@pytest.mark.parametrize(("members", "hidden"), [(0, (8,)), (2, ())])
def test_too_many_or_members_without_hidden_layers_are_refused(members: int, hidden: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="members"):
        dataclasses.replace(POSITION, members=members, hidden=hidden)
