"""YAMNet's network: 27 convolutions over a log-mel spectrogram, in NumPy."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.perception.encoders.yamnet.reading import LAYERS, Convolution, Weights, Yamnet

CEILING = np.float32(6.0)


def activations(weights: Weights, patches: Audio, layer: int) -> Audio:
    """Return what a layer makes of patches, 0 to 6, by time, frequency and channel.

    Each layer is h = min(max(W * x + b, 0), 6): the first a convolution of 3 x 3 over time and frequency,
    then by turns one of 3 x 3 in each channel by itself and one of 1 x 1 that mixes channels. Time and
    frequency are halved at layers 1, 4, 8, 12 and 24; beyond the edges a layer sees zeros.

    Parameters
    ----------
    weights
        As `load_yamnet` gives them.
    patches
        Log-mel energies (n, frames, bands), of any n and frames; 64 bands, as `YamnetMel` gives them.
    layer
        1 to 27. Patches of the same n and frames give the same bits again.

    Returns
    -------
    Audio
        (n, frames / s, bands / s, channels), rounded up: s = 2, channels 32 after layer 1; 4 and 128 after
        layer 5; 32 and 1024 after layer 27.

    Raises
    ------
    InputError
        If there is no such layer, or patches have another form.

    References
    ----------
    A. Howard et al., MobileNets (2017).
    """
    if not 1 <= layer <= LAYERS:
        raise InputError(f"layer {layer}", f"1 to {LAYERS}")
    if patches.ndim != 3 or not patches.shape[1]:
        raise InputError(f"patches of shape {patches.shape}", "(n, frames, bands), one frame or more")
    first, *others = weights[:layer]
    values = _mixed(_neighbourhoods(patches, first.stride), first)
    for one in others:
        values = _filtered(values, one) if one.kernel.ndim == 3 else _mixed(values, one)
    return values


def embedding(last: Audio) -> Audio:
    """Return the mean (n, 1024) over time and frequency of what the last layer made."""
    return last.mean(axis=(1, 2))


def probabilities(network: Yamnet, patches: Audio) -> Floats:
    """Return how likely each of AudioSet's 521 kinds of sound is in patches (n, 96, 64), (n, 521).

    Kinds stand in the order of AudioSet's class map: 0 is speech, 132 music, 494 silence, 509 static.
    """
    pooled = embedding(activations(network.convolutions, patches, LAYERS)).astype(np.float64)
    return 1.0 / (1.0 + np.exp(-(pooled @ network.kinds + network.kinds_bias)))


def _widened(values: Audio, stride: int) -> Audio:
    """Return values (n, t, f, ...) with zeros around for a 3 x 3 kernel, as many as TensorFlow's SAME has."""
    around = [(0, 0), (0, 0), (0, 0), (0, 0)][: values.ndim]
    for axis in (1, 2):
        size = values.shape[axis]
        missing = max((-(-size // stride) - 1) * stride + 3 - size, 0)
        around[axis] = (missing // 2, missing - missing // 2)
    return np.pad(values, around)


def _shifted(values: Audio, stride: int, row: int, column: int) -> Audio:
    rows, columns = ((values.shape[axis] - 3) // stride + 1 for axis in (1, 2))
    return values[:, row : row + stride * rows : stride, column : column + stride * columns : stride]


def _neighbourhoods(patches: Audio, stride: int) -> Audio:
    wide = _widened(patches, stride)
    return np.stack([_shifted(wide, stride, row, column) for row in range(3) for column in range(3)], axis=-1)


def _filtered(values: Audio, layer: Convolution) -> Audio:
    wide = _widened(values, layer.stride)
    result: Audio | None = None
    for row in range(3):
        for column in range(3):
            part = _shifted(wide, layer.stride, row, column) * layer.kernel[row, column]
            result = part if result is None else np.add(result, part, out=result)
    assert result is not None
    return _held(result, layer.bias)


def _mixed(values: Audio, layer: Convolution) -> Audio:
    # One product of two matrices: many small ones, as `@` would make of more dimensions, take twice as long.
    inner, outer = layer.kernel.shape
    return _held((values.reshape(-1, inner) @ layer.kernel).reshape(*values.shape[:-1], outer), layer.bias)


def _held(values: Audio, bias: Audio) -> Audio:
    values += bias
    return np.clip(values, np.float32(0.0), CEILING, out=values)
