"""YAMNet: Google's small convolutional network that classifies the sounds of AudioSet.

YAMNet is a MobileNetV1. Its file, known by its checksum, holds 8-bit weights with batch normalisation folded
in; they become float32 here, each scaled by its channel's scale, and run in NumPy.

This is a separate implementation because the published graph is not usable here: TensorFlow Lite fixes its
input at 1 x 96 x 64, which excludes 100 frames or two microphones, and it gives no inner layer without
running all 27 (8.8 ms of CPU time against 5.4 ms to layer 9 here).

References
----------
M. Plakal and D. Ellis, YAMNet (2020); A. Howard et al., MobileNets (2017).
"""

import struct
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples
from monochord_encoders.mel import MEL_RATE, frame_indices, mel_filters
from monochord_encoders.weights import checked_sum, find_weights, load_known

FRAME: Samples = 400
FFT_SIZE: Samples = 512
BANDS = 64
LOWEST: Hertz = 125.0
HIGHEST: Hertz = 7500.0
LOG_OFFSET = 1e-3
"""Added to the magnitude of each band before its logarithm."""
PATCH = 96
"""Frames of the training patches."""
LAYERS = 27
MAX_ACTIVATION = np.float32(6.0)
CONVOLUTION, DEPTHWISE, DENSE = 3, 4, 9
"""Operators of TensorFlow Lite with weights, by their numbers in its schema."""
STRIDE = 1
"""Field of the stride in the options of both convolution types."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Convolution:
    """Weights of one convolution over time and frequency, whose output is clipped to 0 to 6.

    `kernel` is (3, 3, channels) where each channel is filtered by itself, (channels, new channels) where
    channels are mixed point by point, and (9, new channels) of the first layer. `bias` is (new channels,);
    `stride` is that of time and of frequency.
    """

    kernel: Audio
    bias: Audio
    stride: int


Convolutions: TypeAlias = tuple[Convolution, ...]
"""The 27 convolutions in order: each even one filters channels, each odd one but the first mixes them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class YamnetWeights:
    """The `convolutions`, and the last layer's `kinds` (1024, 521) and `kinds_bias` (521,)."""

    convolutions: Convolutions
    kinds: Audio
    kinds_bias: Audio


class YamnetMel:
    """Log-mel magnitudes, ln(m + 0.001), of 64 bands from 125 to 7500 Hz, of frames of 25 ms.

    For each frame: a periodic Hann window, the magnitude of the Fourier transform of 512 points, triangular
    filters of height one on the mel scale. The mean is not removed and nothing is emphasised.

    Parameters
    ----------
    size
        Samples of a signal, at 16 kHz.
    hop
        Hop in samples: 160, as in training, or 16, which gives 100 frames in 0.1 s.
    centred
        Frames as in `monochord_encoders.mel.frame_indices`.

    Raises
    ------
    InputError
        If the signal is too short for a frame.

    References
    ----------
    M. Plakal and D. Ellis, YAMNet (2020), features.py and params.py.

    Examples
    --------
    >>> energies = YamnetMel(size=1600, hop=16)
    >>> energies(np.zeros((2, 1600), np.float32)).shape
    (2, 100, 64)
    """

    def __init__(self, *, size: Samples, hop: Samples, centred: bool = True) -> None:
        self._indices = frame_indices(size, frame=FRAME, hop=hop, centred=centred)
        if not self._indices.size:
            raise InputError(
                f"{1e3 * size / MEL_RATE:g} ms of sound", "a frame or more", "use a longer window"
            )
        self._size = size
        self._window = np.hanning(FRAME + 1)[:-1]
        self._filters = mel_filters(
            BANDS, fft_size=FFT_SIZE, sample_rate=MEL_RATE, lowest=LOWEST, highest=HIGHEST
        ).T.copy()

    @property
    def frames(self) -> int:
        """Number of frames in a signal."""
        return self._indices.shape[0]

    def __call__(self, signal: Audio) -> Audio:
        """Return the log-mel magnitudes (channels, frames, 64) float32 of a signal (channels, size)."""
        if signal.shape[-1] != self._size:
            raise InputError(f"a signal of {signal.shape[-1]} samples", f"{self._size} samples")
        frames = signal.astype(np.float64)[:, self._indices] * self._window
        magnitude = np.abs(np.fft.rfft(frames, FFT_SIZE))
        return np.log(magnitude @ self._filters + LOG_OFFSET).astype(np.float32)


def activations(convolutions: Convolutions, patches: Audio, layer: int) -> Audio:
    """Return the output of a layer, 0 to 6, by time, frequency and channel.

    Each layer is h = min(max(W * x + b, 0), 6): the first a convolution of 3 x 3 over time and frequency,
    then by turns one of 3 x 3 in each channel by itself and one of 1 x 1 that mixes channels. Time and
    frequency are halved at layers 1, 4, 8, 12 and 24; beyond the edges are zeros.

    Parameters
    ----------
    convolutions
        Those of `load_yamnet`.
    patches
        Log-mel energies (n, frames, bands), of any n and frames; 64 bands from `YamnetMel`.
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
    first, *others = convolutions[:layer]
    padded = _padded(patches, first.stride)
    shifts = [_shifted(padded, first.stride, row, column) for row in range(3) for column in range(3)]
    values = _mixed(np.stack(shifts, axis=-1), first)
    for one in others:
        values = _filtered(values, one) if one.kernel.ndim == 3 else _mixed(values, one)
    return values


def probabilities(weights: YamnetWeights, patches: Audio) -> Floats:
    """Return the probability of each of AudioSet's 521 kinds of sound in patches (n, 96, 64), (n, 521).

    Kinds are in the order of AudioSet's class map: 0 is speech, 132 music, 494 silence, 509 static.
    """
    embedding = activations(weights.convolutions, patches, LAYERS).mean(axis=(1, 2)).astype(np.float64)
    return 1.0 / (1.0 + np.exp(-(embedding @ weights.kinds + weights.kinds_bias)))


def _padded(values: Audio, stride: int) -> Audio:
    """Return values (n, t, f, ...) with zeros around for a 3 x 3 kernel, as many as TensorFlow's SAME has."""
    widths = [(0, 0)] * values.ndim
    for axis in (1, 2):
        size = values.shape[axis]
        missing = max((-(-size // stride) - 1) * stride + 3 - size, 0)
        widths[axis] = (missing // 2, missing - missing // 2)
    return np.pad(values, widths)


def _shifted(values: Audio, stride: int, row: int, column: int) -> Audio:
    rows, columns = ((values.shape[axis] - 3) // stride + 1 for axis in (1, 2))
    return values[:, row : row + stride * rows : stride, column : column + stride * columns : stride]


def _filtered(values: Audio, layer: Convolution) -> Audio:
    padded = _padded(values, layer.stride)
    result = _shifted(padded, layer.stride, 0, 0) * layer.kernel[0, 0]
    for place in range(1, 9):
        row, column = divmod(place, 3)
        result += _shifted(padded, layer.stride, row, column) * layer.kernel[row, column]
    return _clipped(result, layer.bias)


def _mixed(values: Audio, layer: Convolution) -> Audio:
    # One product of two matrices: many small ones, as `@` makes of more dimensions, take twice as long.
    inner, outer = layer.kernel.shape
    return _clipped((values.reshape(-1, inner) @ layer.kernel).reshape(*values.shape[:-1], outer), layer.bias)


def _clipped(values: Audio, bias: Audio) -> Audio:
    values += bias
    return np.clip(values, np.float32(0.0), MAX_ACTIVATION, out=values)


def load_yamnet(given: str = "") -> YamnetWeights:
    """Return the network from the file `given`, or from where `monochord weights` looks for it.

    Raises
    ------
    InputError
        If it is not there, with the way to get it, or is not the file that is known by its SHA-256.
    """
    known = load_known("yamnet")
    path = find_weights(known, given)
    checked_sum(known, path)
    return parse_tflite(path.read_bytes())


def parse_tflite(data: bytes) -> YamnetWeights:
    """Return the network in the bytes of its TensorFlow Lite file."""
    # Fields by their numbers in the schema of TensorFlow Lite (version 3).
    model = _Table(data, struct.unpack_from("<I", data)[0])
    codes = [code.integer(3) for code in model.tables(1)]
    buffers = model.tables(4)
    (graph,) = model.tables(2)
    tensors = graph.tables(0)
    convolutions: list[Convolution] = []
    kinds = kinds_bias = np.zeros(0, np.float32)
    for operator in graph.tables(3):
        kind = codes[operator.integer(0, "I")]
        if kind not in (CONVOLUTION, DEPTHWISE, DENSE):
            continue
        _, kernel, bias = (_dequantised(tensors[i], buffers) for i in operator.numbers(1, "<i4").tolist())
        if kind == DENSE:
            kinds, kinds_bias = np.ascontiguousarray(kernel.T), bias
            continue
        mixing = kind == CONVOLUTION
        kernel = np.ascontiguousarray(kernel.reshape(len(kernel), -1).T) if mixing else kernel[0]
        stride = operator.table(4).integer(STRIDE)
        convolutions.append(Convolution(kernel=kernel, bias=bias, stride=stride))
    return YamnetWeights(convolutions=tuple(convolutions), kinds=kinds, kinds_bias=kinds_bias)


@dataclass(frozen=True, slots=True)
class _Table:
    """One table in the bytes of a FlatBuffers file, as far as a file of weights needs it.

    A table begins with the distance back to its list of fields, which holds for each field the distance of
    its value from the table, 0 where it is absent. A string, vector or table stands elsewhere, at a distance
    from the field.
    """

    data: bytes
    at: int

    def integer(self, field: int, kind: str = "i") -> int:
        """Return the integer in a field by its `struct` letter; 0 where it is absent."""
        place = self._place(field)
        return struct.unpack_from(f"<{kind}", self.data, place)[0] if place else 0

    def table(self, field: int) -> "_Table":
        """Return the table that a field refers to."""
        return _Table(self.data, self._target(self._place(field)))

    def tables(self, field: int) -> list["_Table"]:
        """Return the tables of a vector of them."""
        vector = self._target(self._place(field))
        (count,) = struct.unpack_from("<I", self.data, vector)
        return [_Table(self.data, self._target(vector + 4 + 4 * i)) for i in range(count)]

    def numbers(self, field: int, kind: str) -> NDArray[np.generic]:
        """Return a vector of numbers (n,) of a NumPy type, read-only; none where the field is absent."""
        place = self._place(field)
        if not place:
            return np.zeros(0, kind)
        vector = self._target(place)
        (count,) = struct.unpack_from("<I", self.data, vector)
        return np.frombuffer(self.data, kind, count, vector + 4)

    def _target(self, place: int) -> int:
        return place + struct.unpack_from("<I", self.data, place)[0]

    def _place(self, field: int) -> int:
        listing = self.at - struct.unpack_from("<i", self.data, self.at)[0]
        (size,) = struct.unpack_from("<H", self.data, listing)
        entry = 4 + 2 * field
        if entry >= size:
            return 0
        (offset,) = struct.unpack_from("<H", self.data, listing + entry)
        return self.at + offset if offset else 0


def _dequantised(tensor: _Table, buffers: list[_Table]) -> Audio:
    """Return a tensor's values, scale x (stored - zero point), or nothing where it is computed."""
    kinds = {2: "<i4", 9: "i1"}
    stored = buffers[tensor.integer(2, "I")].numbers(0, "u1")
    if not stored.size:
        return np.zeros(0, np.float32)
    quantisation = tensor.table(4)
    shape = tensor.numbers(0, "<i4")
    values = stored.view(kinds[tensor.integer(1, "b")]).reshape(shape.tolist()).astype(np.float64)
    scale = quantisation.numbers(2, "<f4").astype(np.float64)
    zero = quantisation.numbers(3, "<i8").astype(np.float64)
    along = np.ones(len(shape), np.int64)
    along[quantisation.integer(6)] = scale.size
    return ((values - zero.reshape(along)) * scale.reshape(along)).astype(np.float32)
