"""A model on disk: whole or refused, in one line."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.types import Window
from monochord.perception.model import Definition, Model, ModelState, folder_of, load
from monochord.perception.model.definition import Calibration

Sound = Callable[..., Window]


@pytest.fixture
def folder(drawn: Model, tmp_path: Path) -> Path:
    drawn.save(tmp_path / "run" / "model")
    return tmp_path / "run" / "model"


def test_what_was_saved_is_what_is_loaded(drawn: Model, folder: Path, sound: Sound) -> None:
    loaded = load(folder)
    assert {**drawn.weights}.keys() == loaded.weights.keys()
    for k in range(8):
        one, other = (each.step(ModelState(), sound(k))[1] for each in (drawn, loaded))
        assert str(one) == str(other)


def test_it_is_found_in_the_folder_of_its_run(folder: Path) -> None:
    assert folder_of(folder.parent) == folder
    assert load(folder.parent).definition == load(folder).definition


def test_equal_models_have_equal_bytes(drawn: Model, folder: Path, tmp_path: Path) -> None:
    drawn.save(tmp_path / "again")
    for file in sorted(folder.iterdir()):
        assert (tmp_path / "again" / file.name).read_bytes() == file.read_bytes()


def test_no_limit_survives(drawn: Model, folder: Path) -> None:
    assert load(folder).definition.heads["contact"].task.limit == float("inf")
    assert "Infinity" not in (folder / "model.json").read_text()
    assert drawn.definition.heads["contact"].task.limit == float("inf")


def test_one_bit_of_the_weights_is_noticed(folder: Path) -> None:
    file = folder / "weights.safetensors"
    whole = file.read_bytes()
    for at in (0, 9, 5000, len(whole) - 1):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(InputError, match=file.name):
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
    with pytest.raises(InputError, match="safetensors"):
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
    with pytest.raises(InputError, match=r"force\.1\.bias.*\(128,\)"):
        load(folder)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 99}', '"a"', "\udcff"])
def test_a_damaged_text_is_refused(folder: Path, text: str) -> None:
    (folder / "model.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=r"model\.json"):
        load(folder)


@pytest.mark.parametrize("name", ["length", "tension", "linear_density", "young_modulus", "damping"])
@pytest.mark.parametrize("value", [0, float("nan"), "inf", "tight", []])
def test_a_string_that_cannot_be_is_refused(folder: Path, name: str, value: object) -> None:
    file = folder / "model.json"
    tree = json.loads(file.read_text())
    string = {"length": 0.2, "tension": 65.0, "linear_density": 4e-4}
    if (name, value) == ("damping", 0):
        value = -0.1
    file.write_text(json.dumps({**tree, "string": {**string, name: value}}))
    with pytest.raises(InputError, match=rf"string\.{name}"):
        load(folder)


@pytest.mark.parametrize("limits", [[-0.01, 0.15], [0.15, 0.05], ["-inf", 0.15], [0.05, "inf"], [0.05]])
def test_a_sensing_range_that_cannot_be_is_refused(folder: Path, limits: list[object]) -> None:
    file = folder / "model.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "sensing_range": limits}))
    with pytest.raises(InputError, match="sensing_range"):
        load(folder)


def test_a_text_with_an_unknown_word_is_refused(folder: Path) -> None:
    file = folder / "model.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), "hopp": 3}))
    with pytest.raises(InputError, match=r"'model\.json\.hopp'.*'hop'"):
        load(folder)


@pytest.mark.parametrize("version", [3, 4])
def test_a_model_of_an_earlier_format_is_read_unless_it_saw_the_untouched_string(
    folder: Path, drawn: Model, version: int
) -> None:
    file = folder / "model.json"
    tree = json.loads(file.read_text())
    for head in tree["heads"].values():
        head["task"] |= {"context": True, "reference": [], "rise": False}
    earlier = {**tree, "format": version, "reference": None}
    file.write_text(json.dumps(earlier))
    assert load(folder).definition == dataclasses.replace(drawn.definition, weights=tree["weights"])
    file.write_text(json.dumps({**earlier, "reference": {"feature": tree["feature"]}}))
    with pytest.raises(InputError, match=r"row of the untouched string.*train"):
        load(folder)


def test_a_folder_without_one_is_refused(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(InputError, match=r"model\.json"):
        load(tmp_path)
    (folder / "weights.safetensors").unlink()
    with pytest.raises(InputError, match=r"weights\.safetensors"):
        load(folder)


def test_one_head_must_estimate_contact(drawn: Model) -> None:
    heads = {name: record for name, record in drawn.definition.heads.items() if name != "contact"}
    with pytest.raises(InputError, match="heads force, position, slip"):
        dataclasses.replace(drawn.definition, heads=heads)


def with_task(drawn: Model, **changes: Any) -> Definition:
    heads = dict(drawn.definition.heads)
    task = dataclasses.replace(heads["force"].task, **changes)
    heads["force"] = dataclasses.replace(heads["force"], task=task)
    return dataclasses.replace(drawn.definition, heads=heads)


def test_it_survives_being_written_down(drawn: Model) -> None:
    definition = with_task(drawn, columns=drawn.definition.feature.columns[3:5])
    assert from_tree(Definition, to_tree(definition)) == definition


def test_columns_that_are_not_there_are_refused(drawn: Model) -> None:
    with pytest.raises(InputError, match=r"'pitch'.*'force'"):
        with_task(drawn, columns=("pitch",)).shapes()


def test_a_calibration_of_less_than_nothing_is_refused() -> None:
    for name in ("windows", "touches", "sessions"):
        with pytest.raises(InputError, match=f"'{name}' = -1"):
            from_tree(Calibration, {name: -1})


def test_a_model_that_an_earlier_version_calibrated_is_refused_with_what_to_do(tmp_path: Path) -> None:
    load("demo").save(tmp_path / "mine")
    file = tmp_path / "mine" / "model.json"
    tree = json.loads(file.read_text())
    tree["heads"]["force"]["correction"]["residual"] = True
    file.write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"earlier version.*monochord calibrate"):
        load(tmp_path / "mine")
