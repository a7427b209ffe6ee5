"""Rows of a layer of YAMNet, with random and with published weights."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord_encoders.mel import MelSound
from monochord_encoders.resampling import Resampler
from monochord_yamnet.feature import Yamnet, _LayerRows
from monochord_yamnet.network import Convolution, YamnetMel, YamnetWeights, activations

pytestmark = pytest.mark.usefixtures("yamnet_package")

TWO = Signal(sample_rate=44100, channels=2)
SIZE = 4410


def network(layers: int) -> YamnetWeights:
    """The first layers with random weights, with the channels of layers 1 to 5."""
    random = np.random.default_rng(0)
    shapes = [(9, 32), (3, 3, 32), (32, 64), (3, 3, 64), (64, 128)][:layers]
    convolutions = [
        Convolution(
            kernel=random.normal(0.0, 0.3, shape).astype(np.float32),
            bias=np.zeros(shape[-1], np.float32),
            stride=2 if number in (0, 3) else 1,
        )
        for number, shape in enumerate(shapes)
    ]
    none = np.zeros((128, 0), np.float32)
    return YamnetWeights(convolutions=tuple(convolutions), kinds=none, kinds_bias=none[0])


NETWORK = network(5)


def rows(size: int = SIZE, signal: Signal = TWO, **options: object) -> _LayerRows:
    return _LayerRows(Yamnet(**{"layer": 5, **options}), NETWORK, MelSound(signal, size))  # pyright: ignore[reportArgumentType]


def sound(count: int, size: int = SIZE, channels: int = 2) -> Audio:
    return np.random.default_rng(1).normal(0.0, 0.1, (count, channels, size)).astype(np.float32)


def test_a_row_is_the_layer_averaged_over_time() -> None:
    extract, window = rows(), sound(1)
    resampled = Resampler(sample_rate=44100, new_rate=16000, size=SIZE)(window[0])
    layer = activations(NETWORK.convolutions, YamnetMel(size=1600, hop=16)(resampled), 5)
    assert layer.shape == (2, 25, 16, 128)
    np.testing.assert_array_equal(extract(window)[0].reshape(2, 16, 128), layer.mean(axis=1))
    assert len(extract.columns) == 4096
    assert extract.columns[128 * 3 + 4] == "mic 1 layer 5 band 4 channel 5"
    assert extract.columns[-1] == "mic 2 layer 5 band 16 channel 128"
    assert len(set(extract.columns)) == 4096


def test_over_all_it_is_averaged_over_frequency_too() -> None:
    extract, window = rows(average="all"), sound(1)
    np.testing.assert_allclose(
        extract(window)[0].reshape(2, 128), rows()(window)[0].reshape(2, 16, 128).mean(axis=1), rtol=1e-5
    )
    assert extract.columns[129] == "mic 2 layer 5 channel 2"


def test_padding_with_silence_is_not_averaged() -> None:
    # 8 frames of 10 ms fill two steps of layer 5; the silence after them is 22 more.
    window = sound(1)
    loud = rows(hop=0.01)(window)
    resampled = Resampler(sample_rate=44100, new_rate=16000, size=SIZE)(window[0])
    energies = YamnetMel(size=1600, hop=160, centred=False)(resampled)
    padded = np.pad(energies, ((0, 0), (0, 88), (0, 0)), constant_values=np.log(0.001))
    layer = activations(NETWORK.convolutions, padded, 5)
    assert layer.shape[1] == 24
    np.testing.assert_array_equal(loud[0].reshape(2, 16, 128), layer[:, :2].mean(axis=1))


@pytest.mark.parametrize("size", [882, 22050])
def test_any_length_and_each_window_by_itself(size: int) -> None:
    extract, windows = rows(size), sound(3, size)
    windows[1] = np.nan
    together = extract(windows)
    assert together.shape == (3, 4096)
    assert together.dtype == np.float32
    assert np.isfinite(together).all()
    for window, row in zip(windows, together, strict=True):
        np.testing.assert_array_equal(extract(window[None])[0], row)


def test_bad_options_and_signals_are_refused() -> None:
    with pytest.raises(InputError, match="layer 28"):
        Yamnet(layer=28)
    with pytest.raises(InputError, match="hop"):
        Yamnet(hop=0.002)


def test_without_weights_it_says_how_to_get_them(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="/nowhere"):
        Yamnet(weights="/nowhere/yamnet.tflite").prepare(TWO, SIZE)
    monkeypatch.setenv("MONOCHORD_YAMNET", "/nowhere/else.tflite")
    with pytest.raises(InputError, match="/nowhere/else"):
        Yamnet().prepare(TWO, SIZE)


@pytest.mark.parametrize("layer", [3, 5, 9, 27])
def test_published_weights_follow_a_tone(layer: int) -> None:
    try:
        extract = Yamnet(layer=layer).prepare(TWO, SIZE)
    except InputError as error:
        pytest.skip(str(error))
    time = np.arange(SIZE) / 44100.0
    at = np.array([300.0, 300.01, 330.0])
    tones = np.array([[np.sin(2.0 * np.pi * f * time)] * 2 for f in at], np.float32)
    here, near, away = extract(0.1 * tones)
    assert np.linalg.norm(away - here) > 20.0 * np.linalg.norm(near - here)
