import os
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.reading import describe, read_weights
from monochord.perception.encoders.ast.tensors import AstWeights

PREFIX = "audio_spectrogram_transformer."


def test_every_tensor_comes_back(file: Path, small: AstWeights) -> None:
    read = read_weights(str(file))
    assert set(read.tensors) == set(small.tensors)
    for name, tensor in small.tensors.items():
        assert np.array_equal(read.tensors[name], tensor), name
    assert not read.random
    assert (read.depth, read.width) == (2, 128)


def test_the_sum_is_the_files_and_marks_it(file: Path) -> None:
    read = read_weights(str(file))
    assert read.sum == sha256(file.read_bytes()).hexdigest()
    assert read.label == read.sum[:8]


def test_a_hugging_face_folder_is_read(file: Path) -> None:
    assert read_weights(str(file.parent)).depth == 2


def test_it_says_what_a_file_holds(file: Path) -> None:
    assert describe(file).startswith("Audio Spectrogram Transformer, depth 2, width 128, 101 patch columns, ")


def test_half_precision_is_read(published: dict[str, Audio], small: AstWeights, tmp_path: Path) -> None:
    save_file({name: t.astype(np.float16) for name, t in published.items()}, tmp_path / "model.safetensors")
    read = read_weights(str(tmp_path))
    assert read.tensors["cls"].dtype == np.float32
    assert np.abs(read.tensors["cls"] - small.tensors["cls"]).max() < 1e-4


def test_none_there_says_how_to_get_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MONOCHORD_AST", raising=False)
    monkeypatch.setenv("MONOCHORD_WEIGHTS", str(tmp_path))
    with pytest.raises(InputError, match="'monochord weights get ast'") as caught:
        read_weights()
    assert "\n" not in str(caught.value)


def refused(path: Path, match: str) -> None:
    with pytest.raises(InputError, match=match) as caught:
        read_weights(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_cut_off_is_refused(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-1000])
    refused(file, "allowed is a whole safetensors file")


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_bytes(b"<html>sign in</html>")
    refused(path, "allowed is a whole safetensors file")
    save_file({"a": np.zeros(3, np.float32)}, path)
    refused(path, "no 'embeddings.cls_token' in them")


def test_a_changed_bit_is_told_by_the_sum_that_was_kept(file: Path) -> None:
    own = sha256(file.read_bytes()).hexdigest()
    file.with_name("model.safetensors.sha256").write_text(own, encoding="ascii")
    assert read_weights(str(file)).sum == own
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    refused(file, f"allowed is {own[:12]}")


@pytest.mark.parametrize(
    ("name", "value", "match"),
    [
        ("encoder.layer.1.output.dense.bias", None, r"no 'encoder\.layer\.1\.output\.dense\.bias' in them"),
        ("encoder.layer.0.intermediate.dense.bias", np.zeros(7, np.float32), r"layers\.0\.up\.bias of shape"),
        ("layernorm.bias", np.full(128, np.nan, np.float32), r"final\.bias is not finite"),
        ("embeddings.cls_token", np.zeros((1, 1, 100), np.float32), "2 layers of width 100"),
    ],
)
def test_a_wrong_tensor_is_named(
    published: dict[str, Audio], tmp_path: Path, name: str, value: Audio | None, match: str
) -> None:
    del published[PREFIX + name]
    if value is not None:
        published[PREFIX + name] = value
    save_file(published, tmp_path / "model.safetensors")
    refused(tmp_path / "model.safetensors", match)


@pytest.mark.skipif("MONOCHORD_AST" not in os.environ, reason="MONOCHORD_AST names no real weights")
def test_the_real_file_is_the_published_network() -> None:
    read = read_weights()
    assert (read.depth, read.width) == (12, 768)
    assert read.tensors["positions"].shape == (1214, 768)
