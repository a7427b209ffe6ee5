"""The heads as tensors, before training."""

import dataclasses

import numpy as np
import pytest

from monochord.perception.heads import HEADS
from monochord.perception.model.definition import Definition, FeatureRecord, HeadRecord
from monochord.perception.model.network import Network
from monochord.perception.training.model import arrays, forward, initial

torch = pytest.importorskip("torch")
FEATURE = FeatureRecord(name="made", options={}, columns=tuple("abcdef"))
DEFINITION = Definition(
    sample_rate=8000,
    channels=2,
    window=800,
    hop=800,
    feature=FEATURE,
    heads={name: HeadRecord(task=HEADS.build(name).task()) for name in HEADS.names()},
)


def test_a_head_begins_with_the_mean_label() -> None:
    weights = initial(DEFINITION, 0)
    rows = torch.randn(5, 6)
    for name, record in DEFINITION.heads.items():
        assert not forward(name, record.task, weights, rows).detach().any()


def test_it_is_drawn_from_its_seed_alone() -> None:
    torch.manual_seed(1)
    one = arrays(initial(DEFINITION, 3))
    torch.manual_seed(2)
    same, other = arrays(initial(DEFINITION, 3)), arrays(initial(DEFINITION, 4))
    assert all(np.array_equal(one[name], same[name]) for name in one)
    assert not np.array_equal(one["force.0.weight"], other["force.0.weight"])


def test_prediction_computes_what_was_trained() -> None:
    weights = initial(DEFINITION, 0)
    with torch.no_grad():
        for tensor in weights.values():
            tensor.add_(0.1)
    whole = {
        "scaler.mean": np.zeros(6, np.float32),
        "scaler.scale": np.ones(6, np.float32),
        **arrays(weights),
    }
    network = Network.of(dataclasses.replace(DEFINITION), whole)
    row = np.linspace(-1.0, 1.0, 6).astype(np.float32)
    for name, record in DEFINITION.heads.items():
        trained = forward(name, record.task, weights, torch.from_numpy(row[None])).detach().numpy()[0]
        assert network.answer(name, row, row[:0]).value == pytest.approx(float(trained[0]), rel=1e-5)
