"""The reader's memory of a touch: from what each window tells to what all windows until now tell.

A touch tells its place in its first 0.3 s and then fades: free partials die, both drivers hold one line, and
what is left fits several places. Likewise an untouched string whose drivers hold mode 2 sounds like a touch
at the middle. So what the network makes of a window, physics' measures and the sound between the lines enter
a gated recurrent unit, whose state is the memory, and a last layer reads all outputs anew from both. Beside
it a density of the place is held: a gate says how much of it each window's own density replaces, little
while a touch rests, all while it slides. The last layer's density is added to that, by as much as it is
trusted.

Cho et al. (2014), Learning phrase representations using RNN encoder-decoder, EMNLP, equations 5 to 8; the
reset gate is applied after the product with the state, as cuDNN and PyTorch do.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel
from monochord.core.types import Audio, Floats
from monochord.core.units import Seconds
from monochord.perception.reader.network import FILE, KINDS, POSITIONS, layer

TICK: Seconds = 0.02
"""Time between two windows that enter the memory, as trained; windows in between are read with it, and leave
it unchanged."""
TIME_TOLERANCE: Seconds = 1e-3
"""A window enters the memory if it is this much before its time."""
MAX_ELAPSED: Seconds = 1.0
"""Longest time between two windows over which the memory lasts."""
HIDDEN = 128
"""Size of the memory."""
SUMMARY = 96
"""Number of values that the outputs are read from."""
OUTPUTS = ("force", "force spread", "slip", "trust", "renewal")
"""Outputs of the memory beside those of a window's network: force in N of the design's string, compressed
above `LARGE_FORCE`, logarithm of its spread, and log odds: of slip, of half the weight with which the held
log density is added, and of the share of it that a window's own replaces."""
TRUST, RENEWAL = (1 + len(POSITIONS) + len(KINDS) + OUTPUTS.index(name) for name in ("trust", "renewal"))
LARGE_FORCE = 2.5
"""Force F in N above which the output is ``LARGE_FORCE (1 + log(F / LARGE_FORCE))``."""
LEAST = 1.0e-4
"""Added to probabilities before their logarithm."""
MAX_INPUT = 6.0
"""Largest magnitude of an input, in standard deviations of the training."""


class MemoryNetwork(NamedTuple):
    """The layers around the memory: inputs are scaled, enter, change the state, and leave; each is (in, out).

    Gates are in the order reset, update, candidate. The last layer's outputs are those of
    `monochord.perception.reader.network.Network`, then `OUTPUTS`.
    """

    input_mean: Audio
    input_scale: Audio
    enter_1: Audio
    enter_bias_1: Audio
    enter_2: Audio
    enter_bias_2: Audio
    gates_input: Audio
    gates_input_bias: Audio
    gates_hidden: Audio
    gates_hidden_bias: Audio
    summary: Audio
    summary_bias: Audio
    memory_last: Audio
    memory_last_bias: Audio


class Memory(NamedTuple):
    """What a stream's windows until now tell.

    The state of the recurrent unit, the log density (1 + positions,) held, and when both last changed.
    """

    hidden: Audio
    held: Audio
    time: Seconds


def no_memory() -> Memory:
    """Return the memory at the beginning of a stream."""
    return Memory(np.zeros(HIDDEN, np.float32), np.zeros(0, np.float32), -math.inf)


class Recollection(NamedTuple):
    """What a window and the memory tell together.

    `logits` (1 + positions,) and `kinds` (kinds,) as the network gives them for a window alone, `outputs` of
    `OUTPUTS` (5,), and the `summary` (`SUMMARY`,) that all are read from.
    """

    logits: Floats
    kinds: Floats
    outputs: Floats
    summary: Audio


@cache
def bundled_memory() -> MemoryNetwork:
    """Return the memory's network of the package."""
    from safetensors.numpy import load  # noqa: PLC0415

    arrays = load(FILE.read_bytes())
    return MemoryNetwork(*(np.ascontiguousarray(arrays[name], np.float32) for name in MemoryNetwork._fields))


def recall(
    memory: Memory, inputs: Audio, density: Audio, time: Seconds, network: MemoryNetwork
) -> tuple[Memory, Recollection]:
    """Return the memory after a window that starts at a time in s, and what both tell.

    `inputs` and `density` are those of `memory_inputs`. A window that starts less than `TICK` after the last
    one that entered leaves the memory as it is; what it tells is read as if it entered. After `MAX_ELAPSED`
    without a window nothing is remembered.
    """
    since = time - memory.time
    if since > MAX_ELAPSED:
        memory = no_memory()
    elapsed = math.log2(max(since, TICK) / TICK) if math.isfinite(memory.time) else 0.0
    before = memory.held if memory.held.size else density
    hidden, held, summary, outputs = _recalled(inputs, density, memory.hidden, before, elapsed, network)
    if since >= TICK - TIME_TOLERANCE:
        memory = Memory(hidden, held, time)
    kinds = 1 + len(POSITIONS)
    return memory, Recollection(
        outputs[:kinds], outputs[kinds : kinds + len(KINDS)], outputs[kinds + len(KINDS) :], summary
    )


@kernel()
def memory_inputs(
    hidden: Audio, logits: Floats, kinds: Floats, measures: Floats, gaps: Floats
) -> tuple[Audio, Audio]:
    """Return the inputs of the memory, unscaled, and the log density (1 + positions,): what a window tells.

    Inputs are the logarithms of the probability of no touch, of each two neighbouring positions and of the
    last one; the kinds' logits below the largest; the measures; the sound between the lines; and the hidden
    layer of the window's network.

    Parameters
    ----------
    hidden, logits, kinds
        Of the window's network, (hidden,), (1 + positions,) and (kinds,).
    measures
        Of `measures.measure`.
    gaps
        Of `gaps.measure_gaps`, in any shape.
    """
    density = np.exp(logits - logits.max())
    density /= density.sum()
    pairs = (density.size - 2) // 2
    inputs = np.empty(2 + pairs + kinds.size + measures.size + gaps.size + hidden.size, np.float32)
    inputs[0] = np.log(density[0] + LEAST)
    for k in range(pairs):
        inputs[1 + k] = np.log(density[1 + 2 * k] + density[2 + 2 * k] + LEAST)
    inputs[1 + pairs] = np.log(density[-1] + LEAST)
    at = 2 + pairs
    inputs[at : at + kinds.size] = kinds - kinds.max()
    at += kinds.size
    inputs[at : at + measures.size] = measures
    at += measures.size
    inputs[at : at + gaps.size] = gaps.ravel()
    inputs[at + gaps.size :] = hidden
    return inputs, np.log(density + LEAST).astype(np.float32)


@kernel(fastmath={"contract"})
def _recalled(
    inputs: Audio, density: Audio, hidden: Audio, held: Audio, elapsed: float, network: MemoryNetwork
) -> tuple[Audio, Audio, Audio, Floats]:
    """Return the next state, the density that is held from now on, the summary and the outputs."""
    scaled = np.empty(inputs.size, np.float32)
    for i in range(inputs.size):
        value = (inputs[i] - network.input_mean[i]) / network.input_scale[i]
        scaled[i] = min(max(value, -MAX_INPUT), MAX_INPUT) if np.isfinite(value) else 0.0
    zero, one = np.float32(0.0), np.float32(1.0)
    entered = np.maximum(layer(scaled, network.enter_1, network.enter_bias_1), zero)
    entered = np.maximum(layer(entered, network.enter_2, network.enter_bias_2), zero)
    timed = np.empty(entered.size + 1, np.float32)
    timed[:-1], timed[-1] = entered, elapsed
    given = layer(timed, network.gates_input, network.gates_input_bias)
    kept = layer(hidden, network.gates_hidden, network.gates_hidden_bias)
    size = hidden.size
    both = np.empty(entered.size + size, np.float32)
    both[: entered.size] = entered
    after = both[entered.size :]
    for k in range(size):
        reset = one / (one + np.exp(-(given[k] + kept[k])))
        update = one / (one + np.exp(-(given[size + k] + kept[size + k])))
        candidate = np.tanh(given[2 * size + k] + reset * kept[2 * size + k])
        after[k] = (one - update) * candidate + update * hidden[k]
    summary = np.maximum(layer(both, network.summary, network.summary_bias), zero)
    outputs = layer(summary, network.memory_last, network.memory_last_bias)
    weight = np.float32(2.0) / (one + np.exp(-outputs[TRUST]))
    held = held + (density - held) / (one + np.exp(-outputs[RENEWAL]))
    for k in range(density.size):
        outputs[k] += weight * held[k]
    return after.copy(), held, summary, outputs.astype(np.float64)
