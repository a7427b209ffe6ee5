"""The transformer in PyTorch against the same network in Hugging Face's transformers."""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.on_torch import OnTorch
from monochord.perception.encoders.ast.patches import DEVIATION, MEAN
from monochord.perception.encoders.ast.reading import read_weights
from monochord.perception.encoders.ast.tensors import AstWeights, cropped

pytest.importorskip("torch", reason="PyTorch is not installed")
pytestmark = pytest.mark.filterwarnings("ignore")  # of transformers, as it loads
TOLERANCE = 1e-4
OLD_NAMES = {
    "layers.": "encoder.layer.",
    "attention.q_proj": "attention.attention.query",
    "attention.k_proj": "attention.attention.key",
    "attention.v_proj": "attention.attention.value",
    "attention.o_proj": "attention.output.dense",
    "mlp.fc1": "intermediate.dense",
    "mlp.fc2": "output.dense",
}


def network(*, depth: int, width: int, frames: int, seed: int = 0) -> Any:
    """Return an ASTModel in which nothing is zero, one or alike."""
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    transformers = pytest.importorskip("transformers", reason="transformers is not installed")
    config = transformers.ASTConfig(
        hidden_size=width, num_hidden_layers=depth, num_attention_heads=width // 64,
        intermediate_size=4 * width, max_length=frames,
    )  # fmt: skip
    model = transformers.ASTModel(config).eval()
    stream = np.random.default_rng(seed)
    with torch.no_grad():
        for name, tensor in model.named_parameters():
            middle = 1.0 if "layernorm" in name and name.endswith("weight") else 0.0
            tensor.copy_(torch.from_numpy(stream.normal(middle, 0.05, tensor.shape).astype(np.float32)))
    return model


def saved(model: Any, path: Path, *, old_names: bool, prefix: str = "") -> Path:
    """Write the model's tensors to a file, with the names of the published one or those of transformers 5."""
    from safetensors.torch import save_file

    def named(name: str) -> str:
        for new, old in OLD_NAMES.items():
            name = name.replace(new, old) if old_names else name
        return prefix + name

    save_file({named(name): tensor.clone() for name, tensor in model.state_dict().items()}, path)
    return path


def hidden_of(model: Any, normalised: Audio) -> Audio:
    """Return its last hidden state for spectrograms (n, frames, 128) that are normalised already."""
    import torch

    with torch.inference_mode():
        return model(torch.from_numpy(normalised)).last_hidden_state.numpy()


def sounds(frames: int) -> tuple[Audio, Audio]:
    """Log-mel energies of two channels, and the same normalised as transformers' extractor does it."""
    energies = np.random.default_rng(7).normal(-6.0, 4.0, (2, frames, 128)).astype(np.float32)
    return energies, (energies - np.float32(MEAN)) / np.float32(2 * DEVIATION)


@pytest.mark.parametrize("old_names", [True, False])
def test_the_last_hidden_state_is_theirs_at_the_size_of_training(tmp_path: Path, *, old_names: bool) -> None:
    model = network(depth=3, width=128, frames=1024)
    path = saved(model, tmp_path / "model.safetensors", old_names=old_names)
    energies, normalised = sounds(1024)
    ours = OnTorch(read_weights(str(path)), frames=1024).hidden(energies).numpy()
    assert ours.shape == (2, 1214, 128)
    assert np.abs(ours - hidden_of(model, normalised)).max() < TOLERANCE


def test_the_file_that_transformers_writes_is_read(tmp_path: Path) -> None:
    model = network(depth=2, width=64, frames=1024)
    model.save_pretrained(tmp_path)
    energies, normalised = sounds(1024)
    ours = OnTorch(read_weights(str(tmp_path)), frames=1024).hidden(energies).numpy()
    assert np.abs(ours - hidden_of(model, normalised)).max() < TOLERANCE


def test_transformers_reads_the_same_from_the_published_names(tmp_path: Path) -> None:
    """So that our table of the published names is theirs and not just consistent with itself."""
    model = network(depth=2, width=64, frames=1024)
    saved(model, tmp_path / "model.safetensors", old_names=True, prefix="audio_spectrogram_transformer.")
    model.config.save_pretrained(tmp_path)
    loaded = type(model).from_pretrained(tmp_path).eval()
    energies, normalised = sounds(1024)
    ours = OnTorch(read_weights(str(tmp_path)), frames=1024).hidden(energies).numpy()
    assert np.abs(ours - hidden_of(loaded, normalised)).max() < TOLERANCE


@pytest.mark.parametrize("frames", [16, 100, 500])
def test_a_shorter_sound_is_theirs_with_the_middle_positions(tmp_path: Path, frames: int) -> None:
    import torch

    long = network(depth=3, width=128, frames=1024)
    weights = read_weights(str(saved(long, tmp_path / "model.safetensors", old_names=True)))
    short = network(depth=3, width=128, frames=frames)
    tensors = long.state_dict()
    middle = cropped(weights, frames).tensors["positions"][None]
    short.load_state_dict({**tensors, "embeddings.position_embeddings": torch.from_numpy(middle)})
    energies, normalised = sounds(frames)
    ours = OnTorch(weights, frames=frames)
    hidden = hidden_of(short, normalised)
    assert np.abs(ours.hidden(energies).numpy() - hidden).max() < TOLERANCE
    patches = hidden[:, 2:]
    pooled = np.concatenate([patches.mean(axis=1), patches.max(axis=1)], axis=1)
    assert np.abs(ours(energies) - pooled).max() < TOLERANCE


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("frames", [100, 1024])
def test_the_whole_network_is_theirs(tmp_path: Path, frames: int) -> None:
    model = network(depth=12, width=768, frames=frames)
    path = saved(model, tmp_path / "model.safetensors", old_names=True)
    energies, normalised = sounds(frames)
    ours = OnTorch(read_weights(str(path)), frames=frames).hidden(energies).numpy()
    assert np.abs(ours - hidden_of(model, normalised)).max() < TOLERANCE


@pytest.mark.slow
@pytest.mark.skipif("MONOCHORD_AST" not in os.environ, reason="MONOCHORD_AST names no real weights")
def test_the_real_weights_give_what_transformers_gives() -> None:
    transformers = pytest.importorskip("transformers", reason="transformers is not installed")
    given = Path(os.environ["MONOCHORD_AST"])
    folder = given if given.is_dir() else given.parent
    if not (folder / "config.json").is_file():
        pytest.skip("no config.json beside the real weights")
    model = transformers.ASTModel.from_pretrained(folder).eval()
    energies, normalised = sounds(1024)
    ours = OnTorch(read_weights(), frames=1024).hidden(energies).numpy()
    assert np.abs(ours - hidden_of(model, normalised)).max() < TOLERANCE


def test_a_device_that_is_not_there_is_told_of(small: AstWeights) -> None:
    with pytest.raises(DeviceError, match="no device 'nowhere' for the encoder") as caught:
        OnTorch(small, frames=100, device="nowhere")
    assert "\n" not in str(caught.value)


def test_without_pytorch_it_says_what_to_install(small: AstWeights, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(InputError, match=r"monochord\[train\]"):
        OnTorch(small, frames=100)
