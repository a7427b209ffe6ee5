"""The embedding of a window by a small transformer, by each backend."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord_encoders.engines import build_engine
from monochord_encoders.mel import LogMel
from monochord_encoders.network import Sizes, Weights, find_ast, network_of
from monochord_encoders.resampling import Resampler

for needed in ("torch", "transformers", "onnx", "onnxscript", "onnxruntime"):
    pytest.importorskip(needed, reason=f"{needed} is not installed")
pytestmark = pytest.mark.timeout(400)  # a network is exported once for each length
TWO = Signal(sample_rate=44100, channels=2)
SIZE = 4410


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The file of a small network, two layers of 128; and a cache folder for its exports."""
    sizes = Sizes(depth=2, width=128, inner=512)
    folder = tmp_path_factory.mktemp("weights")
    network_of(Weights(sizes=sizes, seed=5), 1024).model.save_pretrained(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield folder / "model.safetensors"


@pytest.fixture
def windows() -> Audio:
    """Three windows of a sounding string, one of them silent."""
    time, rng = np.arange(SIZE) / 44100, np.random.default_rng(0)
    sound = np.stack([np.sin(2 * np.pi * f * time) for f in (374.0, 695.0)])
    noisy = sound + 0.01 * rng.standard_normal((3, 2, SIZE))
    noisy[2] = 0.0
    return noisy.astype(np.float32)


def built(weights: Path, size: int = SIZE, signal: Signal = TWO, **options: object) -> Extractor:
    return FEATURES.build("ast", {"weights": str(weights), **options}).prepare(signal, size)


@pytest.mark.parametrize(("framing", "hop", "frames"), [("fine", 16, 100), ("audioset", 160, 8)])
def test_it_is_the_embedding_of_the_padded_log_mel_spectrogram(
    weights: Path, windows: Audio, framing: str, hop: int, frames: int
) -> None:
    sound = Resampler(sample_rate=44100, new_rate=16000, size=SIZE)(windows[0])
    energies = np.zeros((2, 100, 128), np.float32)
    energies[:, :frames] = LogMel(size=1600, hop=hop, centred=framing == "fine")(sound)
    expected = build_engine(find_ast(str(weights)), frames=100, backend="torch")(energies)
    assert np.array_equal(built(weights, framing=framing, backend="torch")(windows)[0], expected.ravel())


def test_columns_begin_with_the_checksum(weights: Path, windows: Audio) -> None:
    extract = built(weights, backend="torch")
    label = find_ast(str(weights)).sha256[:8]
    assert len(extract.columns) == extract(windows).shape[1] == 2 * 2 * 128
    assert extract.columns[0] == f"{label} mic 1 mean 1"
    assert extract.columns[-1] == f"{label} mic 2 max 128"
    alone = built(weights, signal=Signal(sample_rate=44100, channels=1), backend="torch")
    assert alone(windows[:, :1]).shape == (3, 256)


@pytest.mark.parametrize(
    "backend", ["onnx", *(pytest.param(b, marks=pytest.mark.slow) for b in ("int8", "torch"))]
)
def test_a_window_gives_the_same_bits_alone_and_among_others(
    weights: Path, windows: Audio, backend: str
) -> None:
    extract = built(weights, backend=backend)
    rows = extract(windows)
    assert rows.dtype == np.float32
    for i in (2, 0, 1):
        assert np.array_equal(extract(windows[i : i + 1])[0], rows[i])


@pytest.mark.parametrize(
    "options", [{"random": True, "weights": "x"}, {"threads": 0}, {"backend": "tpu"}, {"framing": "coarse"}]
)
def test_bad_options_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        FEATURES.build("ast", options)


@pytest.mark.parametrize("size", [441, 48510])
def test_windows_too_short_or_too_long_are_refused(weights: Path, size: int) -> None:
    with pytest.raises(InputError, match="frames"):
        built(weights, size=size)


@pytest.mark.slow
def test_random_weights_have_3072_marked_columns(windows: Audio) -> None:
    extract = FEATURES.build("ast", {"random": True, "seed": 4, "backend": "torch"}).prepare(TWO, SIZE)
    rows = extract(windows)
    assert rows.shape == (3, 3072)
    assert all(name.startswith("random(4) ") for name in extract.columns)


@pytest.mark.slow
@pytest.mark.skipif("MONOCHORD_AST" not in os.environ, reason="MONOCHORD_AST names no real weights")
def test_the_real_weights_are_embedded_alike_by_every_backend(windows: Audio) -> None:
    by = {
        name: FEATURES.build("ast", {"backend": name}).prepare(TWO, SIZE)(windows)
        for name in ("onnx", "torch", "int8")
    }
    assert by["onnx"].shape == (3, 3072)
    assert np.abs(by["onnx"] - by["torch"]).max() < 1e-3
    for exact, near in zip(by["onnx"], by["int8"], strict=True):
        assert exact @ near > 0.98 * np.linalg.norm(exact) * np.linalg.norm(near)
