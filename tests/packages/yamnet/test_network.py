"""YAMNet: its spectrogram and its network by their definitions, with random and published weights."""

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord_yamnet.network import (
    Convolution,
    YamnetMel,
    YamnetWeights,
    activations,
    load_yamnet,
    parse_tflite,
    probabilities,
)

pytestmark = pytest.mark.usefixtures("yamnet_package")
TIME = np.arange(15600) / 16000.0
PATCHES = np.random.default_rng(7).normal(-3.0, 2.0, (2, 96, 64)).astype(np.float32)
CHANNELS = (32, 64, 128, 128, 256, 256, *[512] * 6, 1024, 1024)
HALVED = (1, 4, 8, 12, 24)
SPEECH, MUSIC, SILENCE, SINE, STATIC = 0, 132, 494, 495, 509
INT32, INT8 = 2, 9


@pytest.fixture(scope="module")
def random_weights() -> YamnetWeights:
    """The network's form with random weights."""
    random = np.random.default_rng(0)

    def one(layer: int, *shape: int) -> Convolution:
        fan = 9 if len(shape) == 3 else shape[0]
        kernel = random.normal(0.0, (2.0 / fan) ** 0.5, shape).astype(np.float32)
        bias = random.normal(0.0, 0.1, shape[-1]).astype(np.float32)
        return Convolution(kernel=kernel, bias=bias, stride=2 if layer in HALVED else 1)

    layers = [one(1, 9, 32)]
    for before, after in pairwise(CHANNELS):
        layers.append(one(len(layers) + 1, 3, 3, before))
        layers.append(one(len(layers) + 1, before, after))
    kinds = random.normal(0.0, 0.05, (1024, 521)).astype(np.float32)
    return YamnetWeights(convolutions=tuple(layers), kinds=kinds, kinds_bias=np.zeros(521, np.float32))


@pytest.fixture
def published(yamnet_package: None) -> YamnetWeights:
    """The published weights, where they are on this machine."""
    try:
        return load_yamnet()
    except InputError as error:
        pytest.skip(str(error))


def test_the_spectrogram_is_its_definition() -> None:
    sound = np.random.default_rng(0).normal(0.0, 0.1, (1, 15600)).astype(np.float32)
    energies = YamnetMel(size=15600, hop=160, centred=False)(sound)
    assert energies.shape == (1, 96, 64)
    place = 160 * 40
    k = np.arange(400)
    frame = sound[0, place : place + 400] * (0.5 - 0.5 * np.cos(2.0 * np.pi * k / 400))
    magnitude = np.abs(frame @ np.exp(-2j * np.pi * np.outer(k, np.arange(257)) / 512))
    mels = 1127.0 * np.log(1.0 + np.arange(257) * 31.25 / 700.0)
    low, high = 1127.0 * np.log(1.0 + np.array([125.0, 7500.0]) / 700.0)
    width = (high - low) / 65.0
    for band in (0, 20, 63):
        weight = np.maximum(1.0 - np.abs(mels - (low + width * (band + 1))) / width, 0.0)
        assert energies[0, 40, band] == pytest.approx(np.log(weight @ magnitude + 0.001), abs=1e-5)


def test_frames_of_a_window() -> None:
    assert YamnetMel(size=1600, hop=16).frames == 100
    assert YamnetMel(size=1600, hop=160, centred=False).frames == 8


def test_unsuitable_signals_are_refused() -> None:
    with pytest.raises(InputError, match="20 ms"):
        YamnetMel(size=320, hop=160, centred=False)
    with pytest.raises(InputError, match="1600"):
        YamnetMel(size=1600, hop=16)(np.zeros((2, 100), np.float32))


def reference_layer(values: Floats, layer: Convolution) -> Floats:
    """One layer of one patch (time, frequency, channels), summed term by term."""
    stride, kernel = layer.stride, layer.kernel.astype(np.float64)
    if kernel.ndim == 2 and kernel.shape[0] == values.shape[2]:
        return np.clip(np.einsum("tfc,cd->tfd", values, kernel) + layer.bias, 0.0, 6.0)
    shape = tuple(-(-size // stride) for size in values.shape[:2])
    missing = [max((n - 1) * stride + 3 - size, 0) for n, size in zip(shape, values.shape[:2], strict=True)]
    padded = np.pad(values, [*((m // 2, m - m // 2) for m in missing), (0, 0)])
    result = np.empty((*shape, layer.bias.size))
    for t, f in np.ndindex(*shape):
        patch = padded[stride * t : stride * t + 3, stride * f : stride * f + 3]
        whole = kernel.ndim == 2
        result[t, f] = patch.reshape(9) @ kernel if whole else (patch * kernel).sum(axis=(0, 1))
    return np.clip(result + layer.bias, 0.0, 6.0)


@pytest.mark.parametrize(("frames", "bands"), [(12, 8), (13, 9)])
def test_layers_are_convolutions(random_weights: YamnetWeights, frames: int, bands: int) -> None:
    patches = PATCHES[:1, :frames, :bands]
    expected = patches[0, :, :, None].astype(np.float64)
    for layer in range(1, 10):
        expected = reference_layer(expected, random_weights.convolutions[layer - 1])
        values = activations(random_weights.convolutions, patches, layer)[0]
        assert values.dtype == np.float32
        np.testing.assert_allclose(values, expected, atol=2e-5)


def test_shapes_of_layers(random_weights: YamnetWeights) -> None:
    shapes = {
        layer: activations(random_weights.convolutions, PATCHES, layer).shape for layer in (1, 5, 9, 13, 27)
    }
    assert shapes == {
        1: (2, 48, 32, 32),
        5: (2, 24, 16, 128),
        9: (2, 12, 8, 256),
        13: (2, 6, 4, 512),
        27: (2, 3, 2, 1024),
    }


def test_probabilities_are_between_0_and_1(random_weights: YamnetWeights) -> None:
    chances = probabilities(random_weights, PATCHES)
    assert chances.shape == (2, 521)
    assert (chances > 0.0).all()
    assert (chances < 1.0).all()


def test_unknown_layers_and_other_shapes_are_refused(random_weights: YamnetWeights) -> None:
    for layer in (0, 28):
        with pytest.raises(InputError, match=f"layer {layer}"):
            activations(random_weights.convolutions, PATCHES, layer)
    with pytest.raises(InputError, match="patches"):
        activations(random_weights.convolutions, PATCHES[0], 1)
    with pytest.raises(InputError, match="frame"):
        activations(random_weights.convolutions, PATCHES[:, :0], 1)


def test_published_weights_name_noise_silence_and_tones(published: YamnetWeights) -> None:
    noise = np.random.default_rng(0).normal(0.0, 0.3, TIME.size)
    partials = [(f * k, 0.1 / k) for f in (220.0, 277.2, 329.6) for k in range(1, 9)]
    chord = sum(level * np.sin(2.0 * np.pi * f * TIME) for f, level in partials)
    sounds = np.stack([noise, 0.0 * TIME, 0.5 * np.sin(880.0 * np.pi * TIME), chord]).astype(np.float32)
    chances = probabilities(published, YamnetMel(size=15600, hop=160, centred=False)(sounds))
    assert chances[:3].argmax(axis=1).tolist() == [STATIC, SILENCE, SINE]
    assert chances[3].argmax() == MUSIC
    assert chances[:, SPEECH].max() < 0.1


def patterns() -> Audio:
    time, band = np.arange(96)[:, None], np.arange(64)[None]
    values = [
        -5.0
        + 4.0 * np.sin(0.05 * time * (k + 1) + 0.3 * band) * np.cos(0.11 * band * (k + 1))
        + 2.0 * ((band - 8 * k) % 13 == 0)
        for k in range(6)
    ]
    return np.maximum(values, np.log(0.001)).astype(np.float32)


def test_published_weights_agree_with_the_8_bit_network(published: YamnetWeights) -> None:
    golden = json.loads(Path(__file__).with_name("yamnet_int8.json").read_text(encoding="utf-8"))
    expected = np.array(golden["answers"]) / 256.0
    values = probabilities(published, patterns())
    lengths = np.linalg.norm(values, axis=1) * np.linalg.norm(expected, axis=1)
    cosine = (values * expected).sum(axis=1) / lengths
    assert cosine.min() > 0.99
    assert (values.argmax(axis=1) == expected.argmax(axis=1)).sum() >= 5
    assert np.abs(values - expected).max() < 0.1


class TfliteWriter:
    """A file of TensorFlow Lite written with Google's own writer, as far as `parse_tflite` reads one."""

    def __init__(self) -> None:
        flatbuffers: Any = pytest.importorskip("flatbuffers", reason="comes with onnxruntime")
        self.builder = flatbuffers.Builder(0)

    def table(self, fields: dict[int, tuple[str, Any]]) -> int:
        self.builder.StartObject(8)
        for number, (kind, value) in fields.items():
            if kind == "at":
                self.builder.PrependUOffsetTRelativeSlot(number, value, 0)
            else:
                getattr(self.builder, f"Prepend{kind}Slot")(number, value, 0)
        return self.builder.EndObject()

    def vector(self, places: Sequence[int]) -> int:
        self.builder.StartVector(4, len(places), 4)
        for place in reversed(places):
            self.builder.PrependUOffsetTRelative(place)
        return self.builder.EndVector()

    def numbers(self, values: Any, kind: str) -> int:
        return self.builder.CreateNumpyVector(np.asarray(values, kind).reshape(-1))


def written(operators: Sequence[tuple[int, int, Any, Any, int]]) -> bytes:
    """Operators as (kind, stride, kernel with scales, bias with scales, the dimension that they go along)."""
    model = TfliteWriter()
    kinds = sorted({kind for kind, *_ in operators})
    codes = [model.table({3: ("Int32", kind)}) for kind in kinds]
    buffers, tensors, steps = [model.table({})], [model.table({})], []
    for kind, stride, kernel, bias, along in operators:
        for (values, scales), stored, dimension in ((kernel, INT8, along), (bias, INT32, 0)):
            data = values.astype("<i4" if stored == INT32 else "i1")
            buffers.append(model.table({0: ("at", model.numbers(data.view(np.uint8), "u1"))}))
            zero = model.numbers(np.zeros(len(scales)), "<i8")
            scale = model.numbers(scales, "<f4")
            fields = {2: ("at", scale), 3: ("at", zero), 6: ("Int32", dimension)}
            quantised = model.table(fields)
            shape = model.numbers(values.shape, "<i4")
            tensors.append(
                model.table(
                    {
                        0: ("at", shape),
                        1: ("Int8", stored),
                        2: ("Uint32", len(buffers) - 1),
                        4: ("at", quantised),
                    }
                )
            )
        inputs = model.numbers([0, len(tensors) - 2, len(tensors) - 1], "<i4")
        options = model.table({1: ("Int32", stride)})
        steps.append(model.table({0: ("Uint32", kinds.index(kind)), 1: ("at", inputs), 4: ("at", options)}))
    graph = model.table({0: ("at", model.vector(tensors)), 3: ("at", model.vector(steps))})
    fields = {
        1: ("at", model.vector(codes)),
        2: ("at", model.vector([graph])),
        4: ("at", model.vector(buffers)),
    }
    model.builder.Finish(model.table(fields), b"TFL3")
    return bytes(model.builder.Output())


def test_weights_are_dequantised() -> None:
    random = np.random.default_rng(0)
    first, mixes, dense = (
        random.integers(-127, 128, shape) for shape in ((4, 3, 3, 1), (5, 1, 1, 4), (7, 5))
    )
    each = random.integers(-127, 128, (1, 3, 3, 4))
    four, five = np.array([1.0, 2.0, 4.0, 0.5]), np.array([1.0, 0.25, 2.0, 8.0, 1.0])
    whole = random.integers(-(10**6), 10**6, 7)
    network = parse_tflite(
        written(
            [
                (3, 2, (first, four), (whole[:4], four), 0),
                (4, 1, (each, four), (whole[:4], four), 3),
                (3, 1, (mixes, five), (whole[:5], five), 0),
                (9, 0, (dense, [0.5]), (whole, [0.25]), 0),
            ]
        )
    )
    one, two, three = network.convolutions
    np.testing.assert_array_equal(one.kernel, first.reshape(4, 9).T * four)
    np.testing.assert_array_equal(one.bias, whole[:4] * four)
    np.testing.assert_array_equal(two.kernel, each[0] * four)
    np.testing.assert_array_equal(three.kernel, mixes.reshape(5, 4).T * five)
    assert [layer.stride for layer in network.convolutions] == [2, 1, 1]
    np.testing.assert_array_equal(network.kinds, 0.5 * dense.T)
    np.testing.assert_array_equal(network.kinds_bias, 0.25 * whole)
    assert one.kernel.dtype == network.kinds.dtype == np.float32


def test_the_published_file_has_the_networks_form(
    published: YamnetWeights, random_weights: YamnetWeights
) -> None:
    for ours, theirs in zip(random_weights.convolutions, published.convolutions, strict=True):
        assert (ours.kernel.shape, ours.bias.shape) == (theirs.kernel.shape, theirs.bias.shape)
        assert ours.stride == theirs.stride
    assert (published.kinds.shape, published.kinds_bias.shape) == ((1024, 521), (521,))


def test_a_missing_and_another_file_are_refused(tmp_path: Path) -> None:
    other = tmp_path / "yamnet.tflite"
    with pytest.raises(InputError, match="MONOCHORD_YAMNET"):
        load_yamnet(str(other))
    other.write_bytes(b"TFL3")
    with pytest.raises(InputError, match="0a266465c467"):
        load_yamnet(str(other))
