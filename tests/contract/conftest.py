"""A plug-in folder that holds one file more, for the length of a test."""

import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

import pytest

Add = Callable[[str, str, str], Path]


@pytest.fixture
def add(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Add]:
    """Return the function that puts a module (package, name, text) into a package's folder."""
    added: list[str] = []

    def put(package: str, name: str, text: str) -> Path:
        file = tmp_path / package / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
        module = import_module(package)
        monkeypatch.setattr(module, "__path__", [*module.__path__, str(file.parent)])
        added.append(f"{package}.{name}")
        return file

    yield put
    for name in added:
        sys.modules.pop(name, None)
        package, _, module = name.rpartition(".")
        vars(sys.modules[package]).pop(module, None)
