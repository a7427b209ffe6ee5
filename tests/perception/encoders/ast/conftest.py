"""A small network as Hugging Face writes it."""

from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from monochord.core.types import Audio
from monochord.perception.encoders.ast.reading import OLD, SINGLE
from monochord.perception.encoders.ast.tensors import AstWeights, random_weights


@pytest.fixture(scope="session")
def small() -> AstWeights:
    """Two layers of 128."""
    return random_weights(seed=1, depth=2, width=128)


@pytest.fixture
def energies() -> Audio:
    """Log-mel energies of two microphones."""
    return np.random.default_rng(3).normal(-6.0, 4.0, (2, 100, 128)).astype(np.float32)


@pytest.fixture
def published(small: AstWeights) -> dict[str, Audio]:
    """The small network's tensors by the names and in the shapes of the published file."""
    tensors: dict[str, Audio] = {}
    for name, tensor in small.tensors.items():
        if name in SINGLE:
            tensors[SINGLE[name]] = tensor[None] if name == "positions" else tensor
        else:
            _, layer, part, kind = name.split(".")
            theirs = OLD[part]
            for piece, where in zip(np.split(tensor, len(theirs)), theirs, strict=True):
                tensors[f"encoder.layer.{layer}.{where}.{kind}"] = np.ascontiguousarray(piece)
    tensors[SINGLE["cls"]] = tensors[SINGLE["cls"]].reshape(1, 1, -1)
    tensors[SINGLE["distillation"]] = tensors[SINGLE["distillation"]].reshape(1, 1, -1)
    tensors[SINGLE["patch.weight"]] = tensors[SINGLE["patch.weight"]].reshape(-1, 1, 16, 16)
    tensors["classifier.dense.bias"] = np.zeros(527, np.float32)
    return {f"audio_spectrogram_transformer.{name}": tensor for name, tensor in tensors.items()}


@pytest.fixture
def file(published: dict[str, Audio], tmp_path: Path) -> Path:
    """Those in a file."""
    path = tmp_path / "model.safetensors"
    save_file(published, path)
    return path
