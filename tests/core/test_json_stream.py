"""A large JSON object read entry by entry is what `json.loads` reads, and nothing else is taken for one."""

import json
from pathlib import Path
from typing import Any

import pytest

from monochord.core import json_stream
from monochord.core.errors import InputError
from monochord.core.json_stream import json_members

TREE: dict[str, Any] = {
    "parts": [{"name": 'ä " , ] }', "size": -12.5e-3, "flags": []}, 123456, "x" * 40, None, [True, {}]],
    "files": {"a/b.npy": {"blocks": ["ab", "cd"]}, "": 7},
    "nothing": {},
    "none": [],
    "count": 10_000_000,
}


def read(file: Path) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name, value in json_members(file, ("parts", "files", "nothing", "none", "count")):
        result[name] = value if isinstance(value, int) else list(value)
    return result


@pytest.mark.parametrize("indent", [None, 1])
@pytest.mark.parametrize("chunk", [1, 7, 1 << 16])
def test_entries_are_those_of_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk: int, indent: int | None
) -> None:
    monkeypatch.setattr(json_stream, "CHUNK", chunk)
    file = tmp_path / "a.json"
    file.write_text(json.dumps(TREE, indent=indent, ensure_ascii=False), encoding="utf-8")
    files = list(TREE["files"].items())
    assert read(file) == {**TREE, "files": files, "nothing": []}


@pytest.mark.parametrize("chunk", [1, 1 << 16])
def test_text_that_is_cut_or_goes_on_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    monkeypatch.setattr(json_stream, "CHUNK", chunk)
    file, text = tmp_path / "a.json", json.dumps(TREE)
    cut = [text[:size] for size in range(0, len(text), 9)]
    for wrong in (*cut, text + "}", text + " 1", text.replace(":", "", 1), text.replace('"size"', "3"), "[}"):
        file.write_text(wrong, encoding="utf-8")
        with pytest.raises(InputError, match=r"a.json \(damaged"):
            read(file)
