"""The reader's network: where along the whole string something touches, if anything does, and what is odd.

Physics says where a touch shows: partial n of a segment that is the share s of the length is at log(n / s)
on the axis of `monochord.perception.reader.cells`. So two convolutions read lines, a comb adds up partials of
a fundamental wherever it lies, and the score of a position is read by the same weights everywhere: from the
combs of both segments, and its neighbours'. What one position has learned, all have. An overview of the whole
spectrum knows the rest: levels, faults, that nothing touches.

`python -m studies.bundled_model` trains it and writes `network.safetensors` beside this file.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats
from monochord.perception.reader.cells import LOWEST, STEP

FILE = Path(__file__).with_name("network.safetensors")
POSITIONS = np.linspace(0.0, 1.0, 201)
"""Positions over the length whose probabilities the network gives."""
KINDS = (
    "ordinary",
    "microphone 1 dead",
    "microphone 2 dead",
    "microphones swapped",
    "clipping",
    "hum",
    "second string",
    "two touches",
    "driver dead",
    "detuned",
)
"""Kinds of windows that the network distinguishes; all but the first are faults."""
STRIDE = 3
"""Cells from one output of the first convolution to the next."""
COARSE = STRIDE * STEP
"""Distance in log(f / f0) of these outputs."""
FIRST = int(-np.log(LOWEST) / COARSE) - 5
"""The first of these in which a segment's fundamental may lie: just below the open string's."""
PARTIALS = np.round(np.log(np.arange(1, 7)) / COARSE).astype(np.int64)
"""Cells from a fundamental to the partials that a comb adds up."""
SHORTEST = 0.05
"""Share of the length below which a segment's fundamental is not looked for nearer to the end."""
BASIS = np.stack(
    (
        *(np.cos(2.0 * np.pi * k * POSITIONS) for k in range(5)),
        *(np.sin(2.0 * np.pi * k * POSITIONS) for k in range(1, 4)),
    )
).astype(np.float32)
"""Functions (8, positions) of the place on the string, in which scores of positions may differ."""


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
VECTOR = 16
"""Numbers of single precision that the widest vector units take at once."""


class ReaderNetwork(NamedTuple):
    """Convolutions, a comb and layers, each but the last two with a ReLU.

    Weights are (taps x inputs, outputs), tap by tap. Inputs and outputs of convolutions come by fours.
    `hidden` has the flattened overview as inputs, `place` the combs of both segments and `BASIS`; `score`
    gives the logit of a position, and `last` those of no touch and of `KINDS`.
    """

    convolution_1: Audio
    bias_1: Audio
    convolution_2: Audio
    bias_2: Audio
    comb: Audio
    comb_bias: Audio
    overview_1: Audio
    overview_bias_1: Audio
    overview_2: Audio
    overview_bias_2: Audio
    hidden: Audio
    hidden_bias: Audio
    place: Audio
    place_hidden: Audio
    place_bias: Audio
    along: Audio
    along_bias: Audio
    score: Audio
    last: Audio
    last_bias: Audio


class MemoryNetwork(NamedTuple):
    """The layers around the memory: inputs are scaled, enter, change the state, and leave; each is (in, out).

    Gates are in the order reset, update, candidate. The last layer's outputs are those of
    `monochord.perception.reader.network.ReaderNetwork`, then `OUTPUTS`.
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


@cache
def bundled_network() -> ReaderNetwork:
    """Return the network of the package."""
    from safetensors.numpy import load  # noqa: PLC0415

    arrays = load(FILE.read_bytes())
    return ReaderNetwork(*(np.ascontiguousarray(arrays[name], np.float32) for name in ReaderNetwork._fields))


def _taps(count: int) -> NDArray[np.int64]:
    return np.arange(count) - count // 2


NINE, FIVE, THREE, ONE = (_taps(count) for count in (9, 5, 3, 1))


def segments() -> tuple[NDArray[np.int64], Audio]:
    """Return the cell below the fundamental of both segments of each position, and how far it is above."""
    share = np.maximum(np.stack((POSITIONS, 1.0 - POSITIONS)), SHORTEST)
    cell = (-np.log(share) - np.log(LOWEST)) / COARSE - FIRST
    return cell.astype(np.int64), (cell % 1.0).astype(np.float32)


_BELOW, _ABOVE = segments()


@kernel()
def activations(cells: Audio, network: ReaderNetwork) -> tuple[Audio, Floats]:
    """Return what the last layer sees, and the outputs (1 + positions + kinds,), for a window's cells.

    The former are the hidden layer, and of the features of positions their mean by the density and their
    maximum. Cells are (`CHANNELS`, `CELLS`).
    """
    lines = _convolved(cells, network.convolution_1, _filled(network.bias_1, cells, STRIDE), STRIDE, NINE)
    lines = _convolved(lines, network.convolution_2, _filled(network.bias_2, lines, 1), 1, THREE)
    seen = _convolved(lines, network.overview_1, _filled(network.overview_bias_1, lines, 4), 4, FIVE)
    seen = _convolved(seen, network.overview_2, _filled(network.overview_bias_2, seen, 2), 2, FIVE)
    hidden = np.maximum(layer(seen.ravel(), network.hidden, network.hidden_bias), np.float32(0.0))
    high = lines[:, FIRST:]
    combs = _convolved(high, network.comb, _filled(network.comb_bias, high, 1), 1, PARTIALS)
    size, positions = combs.shape[0], BASIS.shape[1]
    both = np.empty((2 * size + BASIS.shape[0], positions), np.float32)
    for segment in range(2):
        for c in range(size):
            interpolated, comb = both[segment * size + c], combs[c]
            for p in range(positions):
                below, above = _BELOW[segment, p], _ABOVE[segment, p]
                interpolated[p] = comb[below] + above * (comb[below + 1] - comb[below])
    both[2 * size :] = BASIS
    start = _filled(layer(hidden, network.place_hidden, network.place_bias), both, 1)
    places = _convolved(both, network.place, start, 1, ONE)
    places = _convolved(places, network.along, _filled(network.along_bias, places, 1), 1, FIVE)
    scores = np.zeros(positions, np.float32)
    for c in range(places.shape[0]):
        scores += network.score[c, 0] * places[c]
    density = np.exp(scores - scores.max())
    density /= density.sum()
    told = np.empty(hidden.size + 2 * places.shape[0], np.float32)
    told[: hidden.size] = hidden
    for c in range(places.shape[0]):
        told[hidden.size + c] = (density * places[c]).sum()
        told[hidden.size + places.shape[0] + c] = places[c].max()
    last = layer(told, network.last, network.last_bias)
    outputs = np.empty(positions + last.size)
    outputs[0], outputs[1 : 1 + positions], outputs[1 + positions :] = last[0], scores, last[1:]
    return told, outputs


@kernel()
def memory_inputs(
    hidden: Audio, logits: Floats, kinds: Floats, measures: Floats, gaps: Floats
) -> tuple[Audio, Audio]:
    """Return the inputs of the memory, unscaled, and the log density (1 + positions,): what a window tells.

    Inputs are the logarithms of the probability of no touch, of each two neighbouring positions and of the
    last one; the `kinds` (kinds,) of the window's network below the largest; the `measures`; the sound
    between the lines, `gaps` in any shape; and the `hidden` layer of the network, whose `logits` are (1 +
    positions,).
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
def recalled(
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


@part()
def _filled(bias: Audio, values: Audio, stride: int) -> Audio:
    """Return the start (outputs, cells) of a convolution's sums over values (inputs, cells)."""
    sums = np.empty((bias.size, (values.shape[1] - 1) // stride + 1), np.float32)
    for o in range(bias.size):
        sums[o] = bias[o]
    return sums


@part(fastmath={"contract"})
def _convolved(values: Audio, weights: Audio, sums: Audio, stride: int, taps: NDArray[np.int64]) -> Audio:
    """Return the ReLU of sums (outputs, cells) plus a convolution of values (inputs, cells), in place.

    Taps are the cells from an output's own to those that it weighs, ascending; beyond either end are zeros.
    Inputs and outputs come by fours: a pass along the cells, many at a time by vector units, adds four inputs
    to four outputs, so that each number that is loaded is used four times. Rows are a multiple of what vector
    units take.
    """
    inputs, (outputs, out) = values.shape[0], sums.shape
    pad, width = max(-taps[0], 0), (out + VECTOR - 1) // VECTOR * VECTOR
    x = _by_stride(values, stride, pad, width + (taps[-1] + pad) // stride + 1)
    zero = np.float32(0.0)
    rows = np.zeros((4, width), np.float32)
    s0, s1, s2, s3 = rows[0], rows[1], rows[2], rows[3]
    for o in range(0, outputs, 4):
        for p in range(out):
            s0[p], s1[p], s2[p], s3[p] = sums[o, p], sums[o + 1, p], sums[o + 2, p], sums[o + 3, p]
        for tap in range(taps.size):
            part, first = x[(taps[tap] + pad) % stride], (taps[tap] + pad) // stride
            for i in range(0, inputs, 4):
                x0, x1 = part[i, first : first + width], part[i + 1, first : first + width]
                x2, x3 = part[i + 2, first : first + width], part[i + 3, first : first + width]
                w0, w1 = weights[tap * inputs + i], weights[tap * inputs + i + 1]
                w2, w3 = weights[tap * inputs + i + 2], weights[tap * inputs + i + 3]
                a0, a1, a2, a3 = w0[o], w1[o], w2[o], w3[o]
                b0, b1, b2, b3 = w0[o + 1], w1[o + 1], w2[o + 1], w3[o + 1]
                c0, c1, c2, c3 = w0[o + 2], w1[o + 2], w2[o + 2], w3[o + 2]
                d0, d1, d2, d3 = w0[o + 3], w1[o + 3], w2[o + 3], w3[o + 3]
                for p in range(width):
                    # All is loaded before anything is stored, or the compiler loads it for each output.
                    v0, v1, v2, v3 = x0[p], x1[p], x2[p], x3[p]
                    r0 = s0[p] + a0 * v0 + a1 * v1 + a2 * v2 + a3 * v3
                    r1 = s1[p] + b0 * v0 + b1 * v1 + b2 * v2 + b3 * v3
                    r2 = s2[p] + c0 * v0 + c1 * v1 + c2 * v2 + c3 * v3
                    r3 = s3[p] + d0 * v0 + d1 * v1 + d2 * v2 + d3 * v3
                    s0[p], s1[p], s2[p], s3[p] = r0, r1, r2, r3
        for p in range(out):
            sums[o, p], sums[o + 1, p] = max(s0[p], zero), max(s1[p], zero)
            sums[o + 2, p], sums[o + 3, p] = max(s2[p], zero), max(s3[p], zero)
    return sums


@part()
def _by_stride(values: Audio, stride: int, pad: int, width: int) -> Audio:
    """Return values (inputs, cells) from `pad` before the first on, (stride, inputs, width).

    Cells that are a stride apart lie beside each other; those before the first and after the last are zeros.
    """
    ordered = np.zeros((stride, values.shape[0], width), np.float32)
    for s in range(stride):
        for i in range(values.shape[0]):
            for q in range(width):
                k = q * stride + s - pad
                if 0 <= k < values.shape[1]:
                    ordered[s, i, q] = values[i, k]
    return ordered


@part()
def layer(values: Audio, weights: Audio, bias: Audio) -> Audio:
    """Return the sums (outputs,) of a layer over values (inputs,)."""
    sums = bias.copy()
    for i in range(values.size):
        value = values[i]
        if value != 0.0:
            weight = weights[i]
            for o in range(sums.size):
                sums[o] += value * weight[o]
    return sums
