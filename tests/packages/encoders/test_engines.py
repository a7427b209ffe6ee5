"""The transformer: checkpoints load as they are, and every engine gives what transformers gives."""

import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio
from monochord_encoders.engines import PRECISIONS, Backend, build_engine, export, onnx_file
from monochord_encoders.network import (
    DEVIATION,
    MEAN,
    PREFIX,
    Sizes,
    Weights,
    describe,
    find_ast,
    network_of,
)

torch = pytest.importorskip("torch", reason="PyTorch is not installed")
transformers = pytest.importorskip("transformers", reason="transformers is not installed")
pytestmark = pytest.mark.timeout(400)  # an export is slow on a busy machine
Network = Callable[..., Any]
TOLERANCE = 1e-4
LIBRARIES = {"onnx": "onnxruntime", "int8": "onnxruntime", "openvino": "openvino"}
MAX_ERROR = {"onnx": 1e-5, "int8": 0.05, "openvino": 0.05}
"""Root mean square of the difference from PyTorch, as a share of that of the embedding."""
OLD_NAMES = {
    "layers.": "encoder.layer.",
    "attention.q_proj": "attention.attention.query",
    "attention.k_proj": "attention.attention.key",
    "attention.v_proj": "attention.attention.value",
    "attention.o_proj": "attention.output.dense",
    "mlp.fc1": "intermediate.dense",
    "mlp.fc2": "output.dense",
}


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache folder, so that a network is exported once for all tests."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


def astmodel(*, depth: int = 2, width: int = 128, frames: int = 1024, seed: int = 0, heads: int = 0) -> Any:
    """An ASTModel for spectrograms of so many frames in which nothing is zero, one or alike."""
    config = transformers.ASTConfig(
        hidden_size=width, num_hidden_layers=depth, num_attention_heads=heads or width // 64,
        intermediate_size=4 * width, max_length=frames,
    )  # fmt: skip
    model, random = transformers.ASTModel(config).eval(), np.random.default_rng(seed)
    with torch.no_grad():
        for name, tensor in model.named_parameters():
            middle = 1.0 if "layernorm" in name and name.endswith("weight") else 0.0
            tensor.copy_(torch.from_numpy(random.normal(middle, 0.05, tensor.shape).astype(np.float32)))
    return model


def published(model: Any) -> dict[str, Audio]:
    """Return a model's tensors by the names of the published file, with a classifier."""
    tensors: dict[str, Audio] = {"classifier.dense.bias": np.zeros(527, np.float32)}
    for new_name, tensor in model.state_dict().items():
        name = new_name
        for new, old in OLD_NAMES.items():
            name = name.replace(new, old)
        tensors[PREFIX + name] = tensor.numpy()
    return tensors


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The published file of a network of two layers of 128, pinned; read-only."""
    path = tmp_path_factory.mktemp("weights") / "model.safetensors"
    save_file(published(astmodel()), path)
    path.with_name("model.safetensors.sha256").write_text(sha256(path.read_bytes()).hexdigest())
    return path


@pytest.fixture(scope="module")
def weights(file: Path) -> Weights:
    return find_ast(str(file))


def reference(model: Any, energies: Audio) -> Audio:
    """Return mean and maximum over the patches, by a forward of transformers' own model."""
    with torch.inference_mode():
        normalised = torch.from_numpy((energies - np.float32(MEAN)) / np.float32(2 * DEVIATION))
        patches = model(normalised).last_hidden_state[:, 2:].numpy()
    return np.concatenate([patches.mean(axis=1), patches.max(axis=1)], axis=1)


def embedded(weights: Weights, energies: Audio) -> Audio:
    return network_of(weights, energies.shape[1])(torch.from_numpy(energies)).numpy()


def spectrogram(frames: int) -> Audio:
    return np.random.default_rng(3).normal(-6.0, 4.0, (2, frames, 128)).astype(np.float32)


def difference(path: Path, model: Any, frames: int = 1024) -> float:
    """Return the largest difference between the weights of a path and a model."""
    energies = spectrogram(frames)
    return float(np.abs(embedded(find_ast(str(path)), energies) - reference(model, energies)).max())


def test_the_published_file_agrees_with_transformers(file: Path) -> None:
    assert difference(file, astmodel()) < TOLERANCE


def test_the_folder_that_transformers_writes_is_read(tmp_path: Path) -> None:
    model = astmodel(depth=1, width=192, seed=4, heads=6)  # no shape implies the number of heads
    model.save_pretrained(tmp_path)
    assert difference(tmp_path, model) < TOLERANCE
    (tmp_path / "config.json").unlink()
    assert difference(tmp_path, model) > 5 * TOLERANCE


@pytest.mark.parametrize("frames", [16, 100])
def test_a_shorter_sound_has_the_middle_positions(file: Path, frames: int) -> None:
    long, short = astmodel(), astmodel(frames=frames)
    columns = (frames - 16) // 10 + 1
    positions = long.embeddings.position_embeddings[0]
    first = 101 // 2 - columns // 2
    middle = positions[2:].reshape(12, 101, 128)[:, first : first + columns].reshape(-1, 128)
    fitting = torch.cat([positions[:2], middle])[None]
    short.load_state_dict({**long.state_dict(), "embeddings.position_embeddings": fitting})
    assert difference(file, short, frames) < TOLERANCE


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_whole_network_is_reference(tmp_path: Path) -> None:
    model = astmodel(depth=12, width=768)
    model.save_pretrained(tmp_path)
    assert difference(tmp_path, model) < TOLERANCE


@pytest.mark.slow
@pytest.mark.skipif("MONOCHORD_AST" not in os.environ, reason="MONOCHORD_AST names no real weights")
def test_the_real_weights_agree_with_transformers() -> None:
    weights = find_ast()
    assert weights.path is not None
    if not weights.path.with_name("config.json").is_file():
        pytest.skip("no config.json beside the real weights")
    model = transformers.ASTModel.from_pretrained(weights.path.parent).eval()
    assert (
        np.abs(embedded(weights, spectrogram(1024)) - reference(model, spectrogram(1024))).max() < TOLERANCE
    )


def test_random_weights_depend_on_their_seed() -> None:
    sizes = Sizes(depth=1, width=64, inner=128, columns=9)
    one, same, other = (embedded(Weights(sizes=sizes, seed=seed), spectrogram(100)) for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.allclose(one, other, atol=0.01)


def test_the_checksum_labels_the_weights(file: Path) -> None:
    own = sha256(file.read_bytes()).hexdigest()
    assert (find_ast(str(file)).sha256, find_ast(str(file.parent)).label) == (own, own[:8])
    assert all(size in describe(file) for size in ("2", "128", "101"))


def refused(folder: Path, match: str = "", frames: int = 100) -> None:
    with pytest.raises(InputError, match=match or re.escape(str(folder))):
        network_of(find_ast(str(folder)), frames)


def test_a_sound_too_long_or_too_short_is_refused(file: Path) -> None:
    refused(file, "1025", 1100)
    refused(file, "16", 10)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("encoder.layer.1.output.dense.bias", None),
        ("encoder.layer.0.intermediate.dense.weight", np.zeros((7, 128), np.float32)),
        ("layernorm.bias", np.full(128, np.nan, np.float32)),
        ("embeddings.cls_token", np.zeros((1, 1, 100), np.float32)),
        ("embeddings.cls_token", None),
    ],
)
def test_a_wrong_tensor_is_refused(file: Path, tmp_path: Path, name: str, value: Audio | None) -> None:
    tensors = load_file(file)
    del tensors[PREFIX + name]
    tensors["more"] = np.zeros(100_000, np.float32)  # so that the count of numbers is no hint
    if value is not None:
        tensors[PREFIX + name] = value
    save_file(tensors, tmp_path / "model.safetensors")
    refused(tmp_path)


def test_a_small_file_of_a_huge_network_takes_no_memory(tmp_path: Path) -> None:
    width = 1 << 14
    tensors = {
        "embeddings.cls_token": np.zeros(width, np.float32),
        "embeddings.position_embeddings": np.zeros((110, width), np.float32),
        "layers.0.layernorm_before.bias": np.zeros(1, np.float32),
        "layers.0.mlp.fc1.bias": np.zeros(1 << 20, np.float32),
    }
    save_file(tensors, tmp_path / "model.safetensors")
    refused(tmp_path)


@pytest.mark.parametrize(
    "change",
    [{"patch_size": 32}, {"num_attention_heads": 7}, {"hidden_act": "sudden"}, {"layer_norm_eps": "s"}],
)
def test_another_configuration_is_refused(file: Path, tmp_path: Path, change: dict[str, Any]) -> None:
    (tmp_path / "model.safetensors").write_bytes(file.read_bytes())
    (tmp_path / "config.json").write_text(json.dumps(change))
    refused(tmp_path)


def test_damaged_and_other_files_are_refused(file: Path, tmp_path: Path) -> None:
    for content in (file.read_bytes()[:-1000], b"<html>sign in</html>", b""):
        (tmp_path / "model.safetensors").write_bytes(content)
        refused(tmp_path)


def test_without_transformers_the_error_says_what_to_install(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "transformers", None)
    refused(file, r"pip install transformers$")


def error(values: Audio, expected: Audio) -> float:
    return float(np.sqrt(np.mean((values - expected) ** 2) / np.mean(expected**2)))


@pytest.fixture(scope="module")
def expected(weights: Weights) -> Audio:
    return build_engine(weights, frames=100, backend="torch")(spectrogram(100))


@pytest.fixture(params=["onnx", "int8", pytest.param("openvino", marks=pytest.mark.slow)])
def backend(request: pytest.FixtureRequest) -> Backend:
    for name in ("onnx", "onnxscript", "onnxruntime", LIBRARIES[request.param]):
        pytest.importorskip(name, reason=f"{name} is not installed")
    return request.param


def test_engines_agree_with_pytorch_each_time_and_for_one_microphone(
    weights: Weights, expected: Audio, backend: Backend
) -> None:
    embed = build_engine(weights, frames=100, backend=backend)
    first = embed(spectrogram(100))
    assert error(first, expected) < MAX_ERROR[backend]
    for one, other in zip(first, expected, strict=True):
        assert one @ other > 0.999 * np.linalg.norm(one) * np.linalg.norm(other)
    if backend != "onnx":
        assert error(first, expected) > 1e-4, "nothing was quantised"
    embed(10.0 * spectrogram(100))
    assert np.array_equal(embed(spectrogram(100)), first)
    assert error(embed(spectrogram(100)[:1]), expected[:1]) < MAX_ERROR[backend]


@pytest.mark.slow
def test_the_file_is_exported_once_and_again_if_damaged(
    weights: Weights, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    file = onnx_file(weights, 100, "float32")
    exported = file.read_bytes()
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "torch", None)
        assert onnx_file(weights, 100, "float32") == file
    file.write_bytes(exported[:-5000] + bytes([exported[-5000] ^ 1]) + exported[-4999:])
    onnx_file(weights, 100, "float32")
    assert file.read_bytes()[-5000] == exported[-5000]
    assert sorted(each.suffix for each in file.parent.glob(f"{file.stem}*")) == [".onnx", ".sha256"]


def test_an_exported_file_runs_without_monochord(file: Path, tmp_path: Path, expected: Audio) -> None:
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    runtime = pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    export(str(file), tmp_path / "ast.onnx")
    session = runtime.InferenceSession(tmp_path / "ast.onnx", providers=["CPUExecutionProvider"])
    assert np.allclose(session.run(None, {"energies": spectrogram(100)})[0], expected, atol=1e-4)
    properties = {one.key: one.value for one in onnx.load(tmp_path / "ast.onnx").metadata_props}
    assert (properties["weights"], properties["random"]) == (find_ast(str(file)).sha256, "false")


def test_a_gpu_agrees_with_the_processor_each_time(weights: Weights, expected: Audio) -> None:
    if not torch.cuda.is_available():
        pytest.skip("there is no GPU")
    embed = build_engine(weights, frames=100, backend="cuda")
    first = embed(spectrogram(100))
    assert error(first, expected) < MAX_ERROR["onnx"]
    embed(10.0 * spectrogram(100))
    assert np.array_equal(embed(spectrogram(100)), first)
    assert error(embed(spectrogram(100)[:1]), expected[:1]) < MAX_ERROR["onnx"]


def test_a_missing_gpu_is_reported(weights: Weights) -> None:
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    with pytest.raises(DeviceError, match="cuda"):
        build_engine(weights, frames=100, backend="cuda")


@pytest.mark.parametrize("name", PRECISIONS)
def test_without_its_library_a_backend_says_what_to_install(
    weights: Weights, name: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, LIBRARIES[name], None)
    with pytest.raises(InputError, match=rf"pip install '?{LIBRARIES[name]}\b"):
        build_engine(weights, frames=100, backend=name)
