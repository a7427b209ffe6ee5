"""How probable each place of a touch is by a window's spectra alone: a small convolutional network.

It sees level and prominence of both microphones on an axis of log(f / f0), f0 being the string's own pitch,
with the stiffness taken out: partial n of a segment that is the share s of the length lies at log(n / s). It
knows no hypotheses, and so may find a touch whose lines none of them explains. Its place is known to a cell,
half a percent of the length; a right hypothesis is ten times as exact. So it is evidence in their ranking.

`python -m studies.mode_networks` trains it and writes `place_density.safetensors` beside this file;
docs/design/reader-of-modes.md says what it is worth.
"""

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz
from monochord.perception.closed_form.hypotheses import (
    LEVEL_DECADES,
    PLACE_MEASURES,
    StringModel,
)
from monochord.perception.closed_form.prominence import MAX_DECADES
from monochord.perception.closed_form.weights import Weights, read_weights

FILE = Path(__file__).with_name("place_density.safetensors")
STEP, LOWEST, CELLS = 0.003, 0.3, 1416
"""Width of a cell of the axis in log(f / f0), f / f0 in the middle of the first, and their count: to 21."""
_EDGES = LOWEST * np.exp(STEP * (np.arange(CELLS + 1) - 0.5))
CHANNELS = 4
"""Inputs in each cell: the levels of both microphones, and the prominences."""
PLACES = np.linspace(0.04, 0.96, 185)
"""Places over the length whose probabilities the network gives."""
SAME_PLACE = 0.012
"""Places nearer to each other than this share of the length count as one."""
LEAST = 1.0e-5
"""Least probability that is distinguished from none."""
UNIFORM = np.full(PLACES.size, 1.0 / PLACES.size)
"""Where nothing is known, as of a string whose pitch is not."""
STRIDES, DILATIONS = np.array((2, 2, 2, 1, 1)), np.array((1, 1, 1, 4, 1))
"""Of each convolution; arrays, since numba compiles a function anew for every number of a tuple."""


class PlaceNetwork(NamedTuple):
    """Five convolutions and two layers; each but the last with a ReLU.

    Weights are (taps x inputs, outputs), tap by tap. Inputs and outputs of convolutions come by fours.
    """

    convolution_1: Weights
    bias_1: Weights
    convolution_2: Weights
    bias_2: Weights
    convolution_3: Weights
    bias_3: Weights
    convolution_4: Weights
    bias_4: Weights
    convolution_5: Weights
    bias_5: Weights
    hidden: Weights
    hidden_bias: Weights
    last: Weights
    last_bias: Weights


@cache
def place_network() -> PlaceNetwork:
    """Return the network of the package, read once.

    Examples
    --------
    >>> len(place_network().last_bias) == len(PLACES)
    True
    """
    return PlaceNetwork(*read_weights(FILE, PlaceNetwork._fields))


@kernel()
def cells_of(power: Floats, height: Floats, prominence: Floats, spacing: Hertz, string: StringModel) -> Audio:
    """Return what the network sees of a window, (`CHANNELS`, `CELLS`), each value the largest in its cell.

    Levels are 1 at a microphone's strongest line and 0 at 80 dB below; prominences are 1 at `MAX_DECADES`.

    Parameters
    ----------
    power, prominence
        Power spectra and prominences (2, bins), whose bins are `spacing` apart.
    height
        Powers (2, lines) of the strongest lines, strongest first.
    string
        The string, whose pitch and stiffness place the cells.
    """
    cells = np.zeros((CHANNELS, CELLS), np.float32)
    bins = power.shape[1]
    per_bin, bending = string.nominal / spacing, string.stiffness / string.length**2
    per_level = 1.0 / (np.log(10.0) * LEVEL_DECADES)
    begin = per_bin * _EDGES[0] * np.sqrt(1.0 + bending * _EDGES[0] ** 2)
    for j in range(CELLS):
        end = per_bin * _EDGES[j + 1] * np.sqrt(1.0 + bending * _EDGES[j + 1] ** 2)
        first, last = int(begin), int(end)
        if last + 1 >= bins:
            break
        for c in range(2):
            loudest = max(_between(power[c], begin), _between(power[c], end))
            most = max(_between(prominence[c], begin), _between(prominence[c], end))
            for k in range(first + 1, last + 1):
                loudest, most = max(loudest, power[c, k]), max(most, prominence[c, k])
            level = 1.0 + np.log(loudest / max(height[c, 0], 1.0e-300) + 1.0e-12) * per_level
            cells[c, j], cells[2 + c, j] = min(max(level, 0.0), 1.0), most / MAX_DECADES
        begin = end
    return cells


@part()
def _between(values: Floats, at: float) -> float:
    k = int(at)
    return values[k] + (at - k) * (values[k + 1] - values[k])


@kernel()
def density(cells: Audio, network: PlaceNetwork) -> Floats:
    """Return the probability (places,) of each of `PLACES` of a window that something touches.

    `cells` (`CHANNELS`, `CELLS`) is what `cells_of` returns.
    """
    values = _convolved(cells, network.convolution_1, network.bias_1, STRIDES[0], DILATIONS[0])
    values = _convolved(values, network.convolution_2, network.bias_2, STRIDES[1], DILATIONS[1])
    values = _convolved(values, network.convolution_3, network.bias_3, STRIDES[2], DILATIONS[2])
    values = _convolved(values, network.convolution_4, network.bias_4, STRIDES[3], DILATIONS[3])
    values = _convolved(values, network.convolution_5, network.bias_5, STRIDES[4], DILATIONS[4])
    hidden = _connected(values.ravel(), network.hidden, network.hidden_bias)
    logits = _connected(hidden, network.last, network.last_bias).astype(np.float64)
    likelihoods = np.exp(logits - logits.max())
    return likelihoods / likelihoods.sum()


@part(fastmath={"contract"})
def _convolved(values: Audio, weights: Weights, bias: Weights, stride: int, dilation: int) -> Audio:
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
def _connected(values: Audio, weights: Weights, bias: Weights) -> Audio:
    """Return the sums (outputs,) of a layer; `values` (inputs,) are passed through a ReLU before."""
    sums = bias.copy()
    for i in range(values.size):
        entered = values[i]
        if entered > 0.0:
            weight = weights[i]
            for o in range(sums.size):
                sums[o] += entered * weight[o]
    return sums


@kernel()
def measure_places(measures: Floats | Audio, place: Floats, probability: Floats) -> None:
    """Fill in the last measures of hypotheses: how probable the place of each is, and the most probable one.

    Both are logarithms, of places within `SAME_PLACE` of each other together, not below `LEAST`. `measures`
    (n, `MEASURES`), `place` (n,) over the length, `probability` (places,) as of `density`.
    """
    _, most = most_probable_place(probability)
    for k in range(place.size):
        near = max(_probability_near(place[k], probability), LEAST)
        measures[k, PLACE_MEASURES], measures[k, PLACE_MEASURES + 1] = np.log(near), np.log(most)


@part()
def _probability_near(place: float, probability: Floats) -> float:
    spacing = PLACES[1] - PLACES[0]
    total = 0.0
    for k in range(probability.size):
        off = abs(PLACES[k] - place)
        total += probability[k] * min(max((SAME_PLACE - off) / spacing + 0.5, 0.0), 1.0)
    return total


@kernel()
def most_probable_place(probability: Floats) -> tuple[float, float]:
    """Return the most probable place over the length, and the probability within `SAME_PLACE` of it.

    The place is the mean over the places there, so it is finer than the distance of two `PLACES`.
    """
    reach = int(SAME_PLACE / (PLACES[1] - PLACES[0]))
    most, best = -1.0, 0
    for k in range(probability.size):
        near = probability[max(k - reach, 0) : k + reach + 1].sum()
        if near > most:
            most, best = near, k
    first = max(best - reach, 0)
    within, places = probability[first : best + reach + 1], PLACES[first : best + reach + 1]
    return (within * places).sum() / most, most
