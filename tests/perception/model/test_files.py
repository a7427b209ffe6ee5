"""A model on disk: whole or refused, in one line."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Window
from monochord.perception.model import Model, ModelState, folder_of, load, save

Sound = Callable[..., Window]


@pytest.fixture
def folder(drawn: Model, tmp_path: Path) -> Path:
    save(drawn, tmp_path / "run" / "model")
    return tmp_path / "run" / "model"


def test_what_was_saved_is_what_is_loaded(drawn: Model, folder: Path, sound: Sound) -> None:
    loaded = load(folder)
    assert {**drawn.weights}.keys() == loaded.weights.keys()
    for k in range(8):
        one, other = (each.predict(ModelState(), sound(k))[1] for each in (drawn, loaded))
        assert str(one) == str(other)


def test_it_is_found_in_the_folder_of_its_run(folder: Path) -> None:
    assert folder_of(folder.parent) == folder
    assert load(folder.parent).definition == load(folder).definition


def test_equal_models_have_equal_bytes(drawn: Model, folder: Path, tmp_path: Path) -> None:
    save(drawn, tmp_path / "again")
    for file in sorted(folder.iterdir()):
        assert (tmp_path / "again" / file.name).read_bytes() == file.read_bytes()


def test_no_limit_survives(drawn: Model, folder: Path) -> None:
    assert load(folder).definition.heads["contact"].task.limit == float("inf")
    assert "Infinity" not in (folder / "model.json").read_text()
    assert drawn.definition.heads["contact"].task.limit == float("inf")


@pytest.mark.parametrize("at", [0, 9, 100, 5000, -1])
def test_one_bit_of_the_weights_is_noticed(folder: Path, at: int) -> None:
    file = folder / "weights.safetensors"
    blob = bytearray(file.read_bytes())
    blob[at] ^= 1
    file.write_bytes(blob)
    with pytest.raises(InputError, match=r"weights.safetensors with sha256 \w{12}\.\.\.: allowed is \w{12}"):
        load(folder)


def resigned(folder: Path, blob: bytes) -> None:
    """Put other weights in place, with their checksum in the text."""
    import hashlib

    (folder / "weights.safetensors").write_bytes(blob)
    file = folder / "model.json"
    definition = json.loads(file.read_text())
    file.write_text(json.dumps({**definition, "weights": hashlib.sha256(blob).hexdigest()}))


@pytest.mark.parametrize("blob", [b"", b"\x80\x04K\x01.", b"\xff" * 64, bytes(1000)])
def test_what_is_no_safetensors_file_is_refused(folder: Path, blob: bytes) -> None:
    resigned(folder, blob)
    with pytest.raises(InputError, match=r"weights.safetensors \(damaged\): allowed is a safetensors file"):
        load(folder)


@pytest.mark.parametrize("wrong", ["absent", "shape", "kind", "nan"])
def test_weights_that_do_not_fit_are_refused_by_name(folder: Path, drawn: Model, wrong: str) -> None:
    from safetensors.numpy import save as packed

    name, arrays = "force.1.bias", {key: np.ascontiguousarray(value) for key, value in drawn.weights.items()}
    other = {
        "shape": np.zeros(3, np.float32),
        "kind": np.zeros(128),
        "nan": np.full(128, np.nan, np.float32),
    }
    del arrays[name]
    resigned(folder, packed({**arrays, **({name: other[wrong]} if wrong in other else {})}))
    with pytest.raises(InputError, match=r"force\.1\.bias is .*: allowed is finite float32 \(128,\)"):
        load(folder)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 99}', '"a"', "\udcff"])
def test_a_damaged_text_is_one_line(folder: Path, text: str) -> None:
    (folder / "model.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(
        InputError, match=r"model\.json (\(damaged: .*\)|of format 99|without a format): allowed is "
    ):
        load(folder)


def test_a_text_with_an_unknown_word_is_refused(folder: Path) -> None:
    file = folder / "model.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "hopp": 3}))
    with pytest.raises(InputError, match=r"option 'model\.json\.hopp'.*did you mean 'hop'"):
        load(folder)


@pytest.mark.parametrize("inside", ["", "perceiver"])
def test_a_folder_of_an_older_format_is_refused_with_what_to_do(tmp_path: Path, inside: str) -> None:
    (tmp_path / inside).mkdir(exist_ok=True)
    (tmp_path / inside / "perceiver.json").write_text("{}")
    with pytest.raises(
        InputError, match=r"perceiver\.json, of an older format: .* train it again .*monochord train"
    ):
        load(tmp_path)


def test_a_folder_without_one_is_refused(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(InputError, match=r"there is no model\.json in it.*that monochord train made"):
        load(tmp_path)
    (folder / "weights.safetensors").unlink()
    with pytest.raises(InputError, match=r"weights\.safetensors \(No such file"):
        load(folder)
