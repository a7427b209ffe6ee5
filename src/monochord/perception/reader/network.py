"""The reader's network: where along the whole string something touches, if anything does, and what is odd.

Five convolutions over the cells of both microphones (`monochord.perception.reader.cells`) and a hidden layer
give the logits of "nothing touches" and of each of `POSITIONS`, and of each kind of window in `KINDS`.
`python -m studies.bundled_model` trains it and writes `network.safetensors` beside this file.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats

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
STRIDES, DILATIONS = np.array((2, 2, 2, 1, 1)), np.array((1, 1, 1, 4, 1))
"""Of each convolution; arrays, since numba compiles a function anew for every number of a tuple."""


class Network(NamedTuple):
    """Five convolutions and two layers; each but the last with a ReLU.

    Weights are (taps x inputs, outputs), tap by tap. Inputs and outputs of convolutions come by fours. The
    outputs of the last layer are the logits of no touch, of `POSITIONS`, and of `KINDS`.
    """

    convolution_1: Audio
    bias_1: Audio
    convolution_2: Audio
    bias_2: Audio
    convolution_3: Audio
    bias_3: Audio
    convolution_4: Audio
    bias_4: Audio
    convolution_5: Audio
    bias_5: Audio
    hidden: Audio
    hidden_bias: Audio
    last: Audio
    last_bias: Audio


@cache
def bundled_network() -> Network:
    """Return the network of the package."""
    from safetensors.numpy import load  # noqa: PLC0415

    arrays = load(FILE.read_bytes())
    return Network(*(np.ascontiguousarray(arrays[name], np.float32) for name in Network._fields))


@kernel()
def activations(cells: Audio, network: Network) -> tuple[Audio, Floats]:
    """Return the hidden layer and the outputs (1 + positions + kinds,) for cells (`CHANNELS`, `CELLS`)."""
    values = _convolved(cells, network.convolution_1, network.bias_1, STRIDES[0], DILATIONS[0])
    values = _convolved(values, network.convolution_2, network.bias_2, STRIDES[1], DILATIONS[1])
    values = _convolved(values, network.convolution_3, network.bias_3, STRIDES[2], DILATIONS[2])
    values = _convolved(values, network.convolution_4, network.bias_4, STRIDES[3], DILATIONS[3])
    values = _convolved(values, network.convolution_5, network.bias_5, STRIDES[4], DILATIONS[4])
    hidden = _connected(values.ravel(), network.hidden, network.hidden_bias)
    for o in range(hidden.size):
        hidden[o] = max(hidden[o], np.float32(0.0))
    return hidden, _connected(hidden, network.last, network.last_bias).astype(np.float64)


@part(fastmath={"contract"})
def _convolved(values: Audio, weights: Audio, bias: Audio, stride: int, dilation: int) -> Audio:
    """Return the ReLU of a convolution (outputs, cells) of values (inputs, cells), zeros beyond either end.

    Inputs and outputs come by fours: a pass along the cells, many at a time by vector units, adds four inputs
    to four outputs, so that each number that is loaded is used four times.
    """
    inputs, cells = values.shape
    taps, out = weights.shape[0] // inputs, (cells - 1) // stride + 1
    pad = taps // 2 * dilation
    # Cells that are a stride apart beside each other.
    x = np.zeros((stride, inputs, out + 2 * pad // stride + 1), np.float32)
    for s in range(stride):
        for i in range(inputs):
            for q in range(x.shape[2]):
                k = q * stride + s - pad
                if 0 <= k < cells:
                    x[s, i, q] = values[i, k]
    sums, zero = np.empty((bias.size, out), np.float32), np.float32(0.0)
    for o in range(0, bias.size, 4):
        s0, s1, s2, s3 = sums[o], sums[o + 1], sums[o + 2], sums[o + 3]
        s0[:], s1[:], s2[:], s3[:] = bias[o], bias[o + 1], bias[o + 2], bias[o + 3]
        for tap in range(taps):
            part, first = x[tap * dilation % stride], tap * dilation // stride
            for i in range(0, inputs, 4):
                x0, x1 = part[i, first : first + out], part[i + 1, first : first + out]
                x2, x3 = part[i + 2, first : first + out], part[i + 3, first : first + out]
                w0, w1 = weights[tap * inputs + i], weights[tap * inputs + i + 1]
                w2, w3 = weights[tap * inputs + i + 2], weights[tap * inputs + i + 3]
                a0, a1, a2, a3 = w0[o], w1[o], w2[o], w3[o]
                b0, b1, b2, b3 = w0[o + 1], w1[o + 1], w2[o + 1], w3[o + 1]
                c0, c1, c2, c3 = w0[o + 2], w1[o + 2], w2[o + 2], w3[o + 2]
                d0, d1, d2, d3 = w0[o + 3], w1[o + 3], w2[o + 3], w3[o + 3]
                for p in range(out):
                    s0[p] = s0[p] + a0 * x0[p] + a1 * x1[p] + a2 * x2[p] + a3 * x3[p]
                    s1[p] = s1[p] + b0 * x0[p] + b1 * x1[p] + b2 * x2[p] + b3 * x3[p]
                    s2[p] = s2[p] + c0 * x0[p] + c1 * x1[p] + c2 * x2[p] + c3 * x3[p]
                    s3[p] = s3[p] + d0 * x0[p] + d1 * x1[p] + d2 * x2[p] + d3 * x3[p]
        for p in range(out):
            s0[p], s1[p] = max(s0[p], zero), max(s1[p], zero)
            s2[p], s3[p] = max(s2[p], zero), max(s3[p], zero)
    return sums


@part()
def _connected(values: Audio, weights: Audio, bias: Audio) -> Audio:
    """Return the sums (outputs,) of a layer; `values` (inputs,) are passed through a ReLU before."""
    sums = bias.copy()
    for i in range(values.size):
        entered = values[i]
        if entered > 0.0:
            weight = weights[i]
            for o in range(sums.size):
                sums[o] += entered * weight[o]
    return sums
