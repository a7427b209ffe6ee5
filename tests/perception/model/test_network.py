"""The heads as arithmetic, beside torch."""

import dataclasses

import numpy as np
import pytest

from monochord.perception.model import Model
from monochord.perception.model.network import Network

torch = pytest.importorskip("torch")


def test_it_is_what_torch_computes(drawn: Model) -> None:
    network = Network.of(drawn.definition, drawn.weights)
    rng = np.random.default_rng(1)
    base, context = rng.normal(size=50).astype(np.float32), rng.normal(size=11).astype(np.float32)
    for name in drawn.definition.heads:
        answer = network.answer(name, base, context)
        row = torch.from_numpy(np.concatenate([base, context])[: drawn.definition.inputs(name)])
        layers = len(drawn.definition.heads[name].task.hidden)
        for number in range(layers + 1):
            weight, bias = (
                torch.from_numpy(drawn.weights[f"{name}.{number}.{kind}"]) for kind in ("weight", "bias")
            )
            row = torch.nn.functional.linear(row, weight, bias)
            row = row.relu() if number < layers else row
        told = [answer.value, answer.log_spread][: len(row)]
        np.testing.assert_allclose(told, row.numpy(), rtol=1e-4, atol=1e-5)


def test_scaling_is_bounded(drawn: Model) -> None:
    network = Network.of(drawn.definition, drawn.weights)
    assert np.abs(network.scaled(np.full(50, 1e30, np.float32))).max() == drawn.definition.clip


def test_a_reference_that_is_absent_is_zeros(drawn: Model) -> None:
    network = Network.of(drawn.definition, drawn.weights)
    row = np.ones(11, np.float32)
    assert network.scaled_context(row).any()
    row[-1] = 0.0
    assert not network.scaled_context(row).any()


def test_what_a_head_does_not_see_does_not_matter(drawn: Model) -> None:
    told = drawn.definition
    task = dataclasses.replace(told.heads["force"].task, columns=told.feature.columns[10:20])
    heads = {**told.heads, "force": dataclasses.replace(told.heads["force"], task=task)}
    told = dataclasses.replace(told, heads=heads)
    weights = {**drawn.weights, "force.0.weight": drawn.weights["force.0.weight"][:, 10 : 20 + 11]}
    network = Network.of(told, weights)
    rng = np.random.default_rng(1)
    base, context = rng.normal(size=50).astype(np.float32), rng.normal(size=11).astype(np.float32)
    one = network.answer("force", base, context)
    base[:10], base[20:] = 0.0, 5.0
    assert network.answer("force", base, context) == one
    base[12] += 1.0
    assert network.answer("force", base, context) != one
