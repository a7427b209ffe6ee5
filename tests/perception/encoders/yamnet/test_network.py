"""The network is the convolutions that it says it is, and answers as the file that it was read from."""

import json
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.perception.encoders.yamnet import (
    Convolution,
    Yamnet,
    YamnetMel,
    activations,
    embedding,
    probabilities,
)

STREAM = np.random.default_rng(7)
PATCHES = STREAM.normal(-3.0, 2.0, (2, 96, 64)).astype(np.float32)
SPEECH, MUSIC, SILENCE, SINE, STATIC = 0, 132, 494, 495, 509


def plainly(values: Floats, layer: Convolution) -> Floats:
    """One layer of one patch (time, frequency, channels), summed term by term."""
    stride, kernel = layer.stride, layer.kernel.astype(np.float64)
    if kernel.ndim == 2 and kernel.shape[0] == values.shape[2]:
        return np.clip(np.einsum("tfc,cd->tfd", values, kernel) + layer.bias, 0.0, 6.0)
    shape = tuple(-(-size // stride) for size in values.shape[:2])
    missing = [max((n - 1) * stride + 3 - size, 0) for n, size in zip(shape, values.shape[:2], strict=True)]
    wide = np.pad(values, [*((m // 2, m - m // 2) for m in missing), (0, 0)])
    made = np.empty((*shape, layer.bias.size))
    for t, f in np.ndindex(*shape):
        around = wide[stride * t : stride * t + 3, stride * f : stride * f + 3]
        whole = kernel.ndim == 2
        made[t, f] = around.reshape(9) @ kernel if whole else (around * kernel).sum(axis=(0, 1))
    return np.clip(made + layer.bias, 0.0, 6.0)


@pytest.mark.parametrize(("frames", "bands"), [(12, 8), (13, 9)])
def test_layers_are_convolutions_summed_term_by_term(by_chance: Yamnet, frames: int, bands: int) -> None:
    patch = PATCHES[:1, :frames, :bands]
    expected = patch[0, :, :, None].astype(np.float64)
    for layer in range(1, 10):
        expected = plainly(expected, by_chance.convolutions[layer - 1])
        found = activations(by_chance.convolutions, patch, layer)[0]
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, atol=2e-5)


def test_shapes_of_layers(by_chance: Yamnet) -> None:
    shapes = {layer: activations(by_chance.convolutions, PATCHES, layer).shape for layer in (1, 5, 9, 13, 27)}
    assert shapes == {
        1: (2, 48, 32, 32),
        5: (2, 24, 16, 128),
        9: (2, 12, 8, 256),
        13: (2, 6, 4, 512),
        27: (2, 3, 2, 1024),
    }


def test_the_embedding_is_the_mean_of_the_last_layer(by_chance: Yamnet) -> None:
    last = activations(by_chance.convolutions, PATCHES, 27)
    np.testing.assert_allclose(embedding(last), last.reshape(2, 6, 1024).mean(axis=1), rtol=1e-5, atol=1e-6)
    named = probabilities(by_chance, PATCHES)
    assert named.shape == (2, 521)
    assert (named > 0.0).all()
    assert (named < 1.0).all()


def test_what_is_no_layer_and_no_patch_is_refused(by_chance: Yamnet) -> None:
    for layer in (0, 28):
        with pytest.raises(InputError, match=f"layer {layer}: allowed is 1 to 27"):
            activations(by_chance.convolutions, PATCHES, layer)
    with pytest.raises(InputError, match=r"patches of shape \(96, 64\)"):
        activations(by_chance.convolutions, PATCHES[0], 1)
    with pytest.raises(InputError, match="one frame or more"):
        activations(by_chance.convolutions, PATCHES[:, :0], 1)


def test_real_weights_name_noise_silence_and_tones(real: Yamnet) -> None:
    time = np.arange(15600) / 16000.0
    noise = np.random.default_rng(0).normal(0.0, 0.3, time.size)
    partials = [(f * k, 0.1 / k) for f in (220.0, 277.2, 329.6) for k in range(1, 9)]
    chord = sum(level * np.sin(2.0 * np.pi * f * time) for f, level in partials)
    sounds = np.stack([noise, 0.0 * time, 0.5 * np.sin(880.0 * np.pi * time), chord]).astype(np.float32)
    named = probabilities(real, YamnetMel(size=15600, hop=160, centred=False)(sounds))
    assert named[:3].argmax(axis=1).tolist() == [STATIC, SILENCE, SINE]
    assert named[3].argmax() == MUSIC
    assert named[:, SPEECH].max() < 0.1


def patterns() -> Audio:
    time, band = np.arange(96)[:, None], np.arange(64)[None]
    made = [
        -5.0
        + 4.0 * np.sin(0.05 * time * (k + 1) + 0.3 * band) * np.cos(0.11 * band * (k + 1))
        + 2.0 * ((band - 8 * k) % 13 == 0)
        for k in range(6)
    ]
    return np.maximum(made, np.log(0.001)).astype(np.float32)


def test_real_weights_answer_as_the_8_bit_network_does(real: Yamnet) -> None:
    golden = json.loads(Path(__file__).with_name("int8.json").read_text(encoding="utf-8"))
    expected = np.array(golden["answers"]) / 256.0
    found = probabilities(real, patterns())
    lengths = np.linalg.norm(found, axis=1) * np.linalg.norm(expected, axis=1)
    likeness = (found * expected).sum(axis=1) / lengths
    assert likeness.min() > 0.99
    assert (found.argmax(axis=1) == expected.argmax(axis=1)).sum() >= 5
    assert np.abs(found - expected).max() < 0.1
