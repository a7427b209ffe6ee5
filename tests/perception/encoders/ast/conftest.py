"""A small network of transformers in which nothing is zero, one or alike, and its file."""

from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import save_file

from monochord.core.types import Audio

Network = Callable[..., Any]
OLD_NAMES = {
    "layers.": "encoder.layer.",
    "attention.q_proj": "attention.attention.query",
    "attention.k_proj": "attention.attention.key",
    "attention.v_proj": "attention.attention.value",
    "attention.o_proj": "attention.output.dense",
    "mlp.fc1": "intermediate.dense",
    "mlp.fc2": "output.dense",
}
PREFIX = "audio_spectrogram_transformer."


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The user's cache folder, so that a network is exported once for all tests."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


@pytest.fixture(scope="session")
def network() -> Network:
    """Return what makes an ASTModel for spectrograms of so many frames."""
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    transformers = pytest.importorskip("transformers", reason="transformers is not installed")

    def made(*, depth: int = 2, width: int = 128, frames: int = 1024, seed: int = 0, heads: int = 0) -> Any:
        config = transformers.ASTConfig(
            hidden_size=width, num_hidden_layers=depth, num_attention_heads=heads or width // 64,
            intermediate_size=4 * width, max_length=frames,
        )  # fmt: skip
        model, stream = transformers.ASTModel(config).eval(), np.random.default_rng(seed)
        with torch.no_grad():
            for name, tensor in model.named_parameters():
                middle = 1.0 if "layernorm" in name and name.endswith("weight") else 0.0
                tensor.copy_(torch.from_numpy(stream.normal(middle, 0.05, tensor.shape).astype(np.float32)))
        return model

    return made


def published(model: Any) -> dict[str, Audio]:
    """Return a model's tensors by the names of the published file, a classifier beside them."""
    tensors: dict[str, Audio] = {"classifier.dense.bias": np.zeros(527, np.float32)}
    for name, tensor in model.state_dict().items():
        theirs = name
        for new, old in OLD_NAMES.items():
            theirs = theirs.replace(new, old)
        tensors[PREFIX + theirs] = tensor.numpy()
    return tensors


@pytest.fixture(scope="session")
def file(network: Network, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The published file of a network of two layers of 128, pinned; to be read alone."""
    path = tmp_path_factory.mktemp("weights") / "model.safetensors"
    save_file(published(network()), path)
    path.with_name("model.safetensors.sha256").write_text(sha256(path.read_bytes()).hexdigest())
    return path


@pytest.fixture
def energies() -> Audio:
    """Log-mel energies of two microphones."""
    return np.random.default_rng(3).normal(-6.0, 4.0, (2, 100, 128)).astype(np.float32)
