"""The weights of YAMNet: one file of Google's, known by its checksum and read as it is.

YAMNet is a MobileNetV1 that was trained on AudioSet to name 521 kinds of sound. The file holds it with 8-bit
weights, batch normalisation folded in; they are turned back into float32, each scaled by its channel's scale.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from monochord.core.types import Audio
from monochord.perception.encoders.weights import checked_sum, find_weights, load_known
from monochord.perception.encoders.yamnet._flatbuffer import Table

CONVOLUTION, DEPTHWISE, DENSE = 3, 4, 9
"""The operators of TensorFlow Lite that have weights here, by the numbers in its schema."""
STRIDE = 1
"""The field of either convolution's options that holds it."""
LAYERS = 27


@dataclass(frozen=True, slots=True, kw_only=True)
class Convolution:
    """Weights of one convolution over time and frequency, whose output is held within 0 and 6.

    `kernel` is (3, 3, channels) where each channel is filtered by itself, (channels, new channels) where
    channels are mixed point by point, and (9, new channels) of the first layer. `bias` is (new channels,);
    `stride` goes for time and frequency.
    """

    kernel: Audio
    bias: Audio
    stride: int


Weights: TypeAlias = tuple[Convolution, ...]
"""The 27 convolutions in order: each even one filters channels, each odd one but the first mixes them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Yamnet:
    """What the file holds: the `convolutions`, and (1024, 521) and (521,) that name kinds of sound."""

    convolutions: Weights
    kinds: Audio
    kinds_bias: Audio


def load_yamnet(given: str = "") -> Yamnet:
    """Return the network from the file `given`, or from where `encoders.weights` looks for it.

    Raises
    ------
    InputError
        If it is not there, with the way to get it, or is not the file that is known by its SHA-256.

    References
    ----------
    M. Plakal and D. Ellis, YAMNet (2020); A. Howard et al., MobileNets (2017).
    """
    known = load_known("yamnet")
    path = find_weights(known, given)
    checked_sum(known, path)
    return parse(Path(path).read_bytes())


def parse(data: bytes) -> Yamnet:
    """Return the network in the bytes of a file of TensorFlow Lite that holds it."""
    # Fields by their numbers in the schema of TensorFlow Lite (version 3).
    model = Table.root(data)
    codes = [code.integer(3) for code in model.tables(1)]
    buffers = model.tables(4)
    (graph,) = model.tables(2)
    tensors = graph.tables(0)
    convolutions: list[Convolution] = []
    dense: list[Audio] = []
    for operator in graph.tables(3):
        kind = codes[operator.integer(0, "I")]
        if kind not in (CONVOLUTION, DEPTHWISE, DENSE):
            continue
        _, kernel, bias = (_float(tensors[index], buffers) for index in operator.numbers(1, "<i4").tolist())
        if kind == DENSE:
            dense += [np.ascontiguousarray(kernel.T), bias]
        elif kind == DEPTHWISE:
            convolutions.append(
                Convolution(kernel=kernel[0], bias=bias, stride=operator.table(4).integer(STRIDE))
            )
        else:
            mixed = np.ascontiguousarray(kernel.reshape(len(kernel), -1).T)
            convolutions.append(
                Convolution(kernel=mixed, bias=bias, stride=operator.table(4).integer(STRIDE))
            )
    return Yamnet(convolutions=tuple(convolutions), kinds=dense[0], kinds_bias=dense[1])


def _float(tensor: Table, buffers: list[Table]) -> Audio:
    """Return a tensor's values, scale x (stored - zero point), or nothing where it is computed."""
    kinds = {2: "<i4", 9: "i1"}
    stored = buffers[tensor.integer(2, "I")].numbers(0, "u1")
    if not stored.size:
        return np.zeros(0, np.float32)
    quantised = tensor.table(4)
    shape = tensor.numbers(0, "<i4")
    values = stored.view(kinds[tensor.integer(1, "b")]).reshape(shape.tolist()).astype(np.float64)
    along = np.ones(len(shape), np.int64)
    scale = quantised.numbers(2, "<f4").astype(np.float64)
    along[quantised.integer(6)] = scale.size
    zero = quantised.numbers(3, "<i8").astype(np.float64)
    return ((values - zero.reshape(along)) * scale.reshape(along)).astype(np.float32)
