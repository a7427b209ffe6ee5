"""Real checkpoints load as they are, and give what transformers gives."""

import json
import os
import sys
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.network import PREFIX, Sizes, Weights, describe, find, network_of
from monochord.perception.encoders.ast.patches import DEVIATION, MEAN

torch = pytest.importorskip("torch", reason="PyTorch is not installed")
pytest.importorskip("transformers", reason="transformers is not installed")
Network = Callable[..., Any]
TOLERANCE = 1e-4


def theirs(model: Any, energies: Audio) -> Audio:
    """Return mean and maximum over the patches, by a forward of transformers' own model."""
    with torch.inference_mode():
        normalised = torch.from_numpy((energies - np.float32(MEAN)) / np.float32(2 * DEVIATION))
        patches = model(normalised).last_hidden_state[:, 2:].numpy()
    return np.concatenate([patches.mean(axis=1), patches.max(axis=1)], axis=1)


def ours(weights: Weights, energies: Audio) -> Audio:
    return network_of(weights, energies.shape[1])(torch.from_numpy(energies)).numpy()


def sound(frames: int) -> Audio:
    return np.random.default_rng(7).normal(-6.0, 4.0, (2, frames, 128)).astype(np.float32)


def test_the_published_file_gives_what_transformers_gives(file: Path, network: Network) -> None:
    assert np.abs(ours(find(str(file)), sound(1024)) - theirs(network(), sound(1024))).max() < TOLERANCE


def test_the_folder_that_transformers_writes_is_read(tmp_path: Path, network: Network) -> None:
    model = network(depth=1, width=192, seed=4, heads=6)  # how many heads no shape tells
    model.save_pretrained(tmp_path)
    told = theirs(model, sound(1024))
    assert np.abs(ours(find(str(tmp_path)), sound(1024)) - told).max() < TOLERANCE
    (tmp_path / "config.json").unlink()
    assert np.abs(ours(find(str(tmp_path)), sound(1024)) - told).max() > 5 * TOLERANCE


@pytest.mark.parametrize("frames", [16, 100, 500])
def test_a_shorter_sound_has_the_middle_positions(file: Path, network: Network, frames: int) -> None:
    long, short = network(), network(frames=frames)
    columns = (frames - 16) // 10 + 1
    positions = long.embeddings.position_embeddings[0]
    first = 101 // 2 - columns // 2
    middle = positions[2:].reshape(12, 101, 128)[:, first : first + columns].reshape(-1, 128)
    fitting = torch.cat([positions[:2], middle])[None]
    short.load_state_dict({**long.state_dict(), "embeddings.position_embeddings": fitting})
    assert np.abs(ours(find(str(file)), sound(frames)) - theirs(short, sound(frames))).max() < TOLERANCE


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_whole_network_is_theirs(tmp_path: Path, network: Network) -> None:
    model = network(depth=12, width=768)
    model.save_pretrained(tmp_path)
    assert np.abs(ours(find(str(tmp_path)), sound(1024)) - theirs(model, sound(1024))).max() < TOLERANCE


@pytest.mark.slow
@pytest.mark.skipif("MONOCHORD_AST" not in os.environ, reason="MONOCHORD_AST names no real weights")
def test_the_real_weights_give_what_transformers_gives() -> None:
    import transformers

    weights = find()
    assert weights.path is not None
    if not weights.path.with_name("config.json").is_file():
        pytest.skip("no config.json beside the real weights")
    model = transformers.ASTModel.from_pretrained(weights.path.parent).eval()
    assert np.abs(ours(weights, sound(1024)) - theirs(model, sound(1024))).max() < TOLERANCE


def test_random_weights_are_drawn_by_their_seed() -> None:
    sizes = Sizes(depth=1, width=64, inner=128, columns=9)
    one, same, other = (ours(Weights(sizes=sizes, seed=seed), sound(100)) for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.allclose(one, other, atol=0.01)


def test_the_sum_marks_what_they_are(file: Path) -> None:
    own = sha256(file.read_bytes()).hexdigest()
    assert (find(str(file)).sum, find(str(file.parent)).label) == (own, own[:8])
    assert "depth 2, width 128, 101 patch columns" in describe(file)


def test_a_sound_too_long_or_too_short_is_refused(file: Path) -> None:
    for frames, match in ((1100, "1025 frames or fewer"), (10, "16 frames or more")):
        with pytest.raises(InputError, match=match):
            network_of(find(str(file)), frames)


def refused(folder: Path, match: str) -> None:
    with pytest.raises(InputError, match=match) as caught:
        network_of(find(str(folder)), 100)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "match"),
    [
        ("encoder.layer.1.output.dense.bias", None, "the whole network"),
        ("encoder.layer.0.intermediate.dense.weight", np.zeros((7, 128), np.float32), "allowed is"),
        ("layernorm.bias", np.full(128, np.nan, np.float32), "not finite"),
        ("embeddings.cls_token", np.zeros((1, 1, 100), np.float32), "2 layers of width 100"),
        ("embeddings.cls_token", None, "no 'embeddings.cls_token'"),
    ],
)
def test_a_wrong_tensor_is_refused(
    file: Path, tmp_path: Path, name: str, value: Audio | None, match: str
) -> None:
    tensors = load_file(file)
    del tensors[PREFIX + name]
    tensors["more"] = np.zeros(100_000, np.float32)  # so that their count alone does not tell
    if value is not None:
        tensors[PREFIX + name] = value
    save_file(tensors, tmp_path / "model.safetensors")
    refused(tmp_path, match)


def test_a_small_file_of_a_huge_network_takes_no_memory(tmp_path: Path) -> None:
    width = 1 << 14
    tensors = {
        "embeddings.cls_token": np.zeros(width, np.float32),
        "embeddings.position_embeddings": np.zeros((110, width), np.float32),
        "layers.0.layernorm_before.bias": np.zeros(1, np.float32),
        "layers.0.mlp.fc1.bias": np.zeros(1 << 20, np.float32),
    }
    save_file(tensors, tmp_path / "model.safetensors")
    refused(tmp_path, "allowed is the whole network of [0-9]{10}")


@pytest.mark.parametrize(
    "change",
    [
        {"patch_size": 32},
        {"num_attention_heads": 7},
        {"num_attention_heads": -2},
        {"hidden_act": "sudden"},
        {"layer_norm_eps": "small"},
    ],
)
def test_another_configuration_is_refused(file: Path, tmp_path: Path, change: dict[str, Any]) -> None:
    (tmp_path / "model.safetensors").write_bytes(file.read_bytes())
    (tmp_path / "config.json").write_text(json.dumps(change))
    refused(tmp_path, "allowed is")


def test_what_is_no_such_file_is_refused(file: Path, tmp_path: Path) -> None:
    for content in (file.read_bytes()[:-1000], b"<html>sign in</html>", b""):
        (tmp_path / "model.safetensors").write_bytes(content)
        refused(tmp_path, "allowed is a whole safetensors file")


def test_without_transformers_it_says_what_to_install(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(InputError, match=r"monochord\[encoders\]"):
        network_of(find(str(file)), 100)
