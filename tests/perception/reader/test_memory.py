"""The reader's memory: as PyTorch computes it, the same at any hop, and gone after a pause."""

import numpy as np
import pytest

from monochord.core.types import Audio
from monochord.perception.reader import KINDS, POSITIONS, MemoryNetwork, no_memory
from monochord.perception.reader.memory import (
    HIDDEN,
    MAX_ELAPSED,
    SUMMARY,
    TICK,
    Memory,
    Recollection,
    bundled_memory,
    recall,
)
from monochord.perception.reader.network import MAX_INPUT, RENEWAL, TRUST


def inputs(seed: int, count: int) -> Audio:
    """Return made-up inputs (count, inputs) of the bundled network, about as large as those of sound."""
    network, rng = bundled_memory(), np.random.default_rng(seed)
    noise = rng.normal(size=(count, network.input_mean.size))
    return (network.input_mean + network.input_scale * noise).astype(np.float32)


def density(rows: Audio) -> Audio:
    """Return made-up log densities (count, 1 + positions) of windows with these inputs."""
    magnitudes = np.abs(np.nan_to_num(rows))
    return -np.concatenate((magnitudes, magnitudes), axis=1)[:, : 1 + len(POSITIONS)]


def after(rows: Audio, times: list[float]) -> list[tuple[Memory, Recollection]]:
    """Return memory and outputs after each of these windows."""
    memory, results = no_memory(), list[tuple[Memory, Recollection]]()
    for row, own, time in zip(rows, density(rows), times, strict=True):
        results.append(recall(memory, row, own, time, bundled_memory()))
        memory = results[-1][0]
    return results


def by_torch(network: MemoryNetwork, rows: Audio, elapsed: list[float]) -> tuple[Audio, Audio]:
    """Return the states (n, hidden) and the outputs (n, outputs) that PyTorch computes."""
    torch = pytest.importorskip("torch")
    tensors = {name: torch.from_numpy(array) for name, array in network._asdict().items()}
    cell = torch.nn.GRUCell(97, HIDDEN)
    cell.weight_ih.data, cell.bias_ih.data = tensors["gates_input"].T, tensors["gates_input_bias"]
    cell.weight_hh.data, cell.bias_hh.data = tensors["gates_hidden"].T, tensors["gates_hidden_bias"]
    scaled = ((torch.from_numpy(rows) - tensors["input_mean"]) / tensors["input_scale"]).nan_to_num()
    scaled = scaled.clip(-MAX_INPUT, MAX_INPUT)
    with torch.no_grad():
        entered = torch.relu(scaled @ tensors["enter_1"] + tensors["enter_bias_1"])
        entered = torch.relu(entered @ tensors["enter_2"] + tensors["enter_bias_2"])
        timed = torch.cat((entered, torch.tensor(elapsed, dtype=torch.float32)[:, None]), 1)
        hidden, states = torch.zeros(1, HIDDEN), []
        for step in timed:
            hidden = cell(step[None], hidden)
            states.append(hidden[0])
        both = torch.cat((entered, torch.stack(states)), 1)
        summary = torch.relu(both @ tensors["summary"] + tensors["summary_bias"])
        outputs = summary @ tensors["memory_last"] + tensors["memory_last_bias"]
        own = torch.from_numpy(density(rows))
        held, share = own[0], torch.sigmoid(outputs[:, RENEWAL])
        for step in range(len(rows)):
            held = (1.0 - share[step]) * held + share[step] * own[step]
            outputs[step, : len(held)] += 2.0 * torch.sigmoid(outputs[step, TRUST]) * held
    return torch.stack(states).numpy(), outputs.numpy()


def test_memory_and_outputs_are_those_of_pytorch() -> None:
    rows = inputs(0, 6)
    rows[3, 5] = np.nan
    rows[4] *= 100.0
    times = [0.0, 0.02, 0.04, 0.1, 0.12, 0.9]
    states, outputs = by_torch(bundled_memory(), rows, [0.0, 0.0, 0.0, np.log2(3.0), 0.0, np.log2(39.0)])
    for (memory, told), state, output in zip(after(rows, times), states, outputs, strict=True):
        assert memory.hidden == pytest.approx(state, abs=1e-4)
        own = np.concatenate((told.logits, told.kinds, told.outputs))
        assert own == pytest.approx(output, abs=1e-3 * max(1.0, float(np.abs(output).max())))
        assert told.kinds.size == len(KINDS)
        assert told.summary.size == SUMMARY


def test_windows_between_two_ticks_leave_the_memory_as_it_is() -> None:
    rows = inputs(1, 9)
    every = after(rows, [0.5 * TICK * k for k in range(9)])
    some = after(rows[::2], [TICK * k for k in range(5)])
    for own, other in zip(every[::2], some, strict=True):
        assert own[0].hidden.tobytes() == other[0].hidden.tobytes()
        assert own[1].logits.tobytes() == other[1].logits.tobytes()
    assert every[2][0] is every[3][0]


def test_nothing_is_remembered_after_a_pause() -> None:
    rows = inputs(2, 3)
    fresh = recall(no_memory(), rows[2], density(rows)[2], 0.0, bundled_memory())
    late = after(rows, [0.0, 0.02, 0.03 + MAX_ELAPSED])[2]
    soon = after(rows, [0.0, 0.02, 0.02 + MAX_ELAPSED])[2]
    assert late[1].logits.tobytes() == fresh[1].logits.tobytes()
    assert soon[1].logits.tobytes() != fresh[1].logits.tobytes()
