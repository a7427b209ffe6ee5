"""Adding a plug-in adds one file and edits nothing: each folder is given a file it has never seen."""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from monochord import cli
from monochord.core.registry import Registry

SRC = Path(__file__).parents[2] / "src" / "monochord"
FOLDERS = sorted(".".join(base.relative_to(SRC.parent).parent.parts) for base in SRC.rglob("base.py"))
Add = Callable[[str, str, str], Path]

PLUGIN = '''
"""A plug-in that was not there."""

from dataclasses import dataclass
from typing import Any

from {package}.base import {base}


@dataclass(frozen=True, slots=True, kw_only=True)
class Newcomer({base}):
    """Came as one file.

    `loudness` is its only option.
    """

    loudness: float = 1.0

    def {method}(self, *arguments: Any) -> Any:
        return arguments
'''


@pytest.mark.parametrize("folder", FOLDERS)
def test_one_file_is_a_plug_in(add: Add, capsys: pytest.CaptureFixture[str], folder: str) -> None:
    registry: Registry[Any] = next(v for v in vars(import_module(folder)).values() if isinstance(v, Registry))
    before = registry.names()
    (method,) = registry.base.__abstractmethods__
    add(folder, "newcomer", PLUGIN.format(package=folder, base=registry.base.__name__, method=method))
    assert registry.names() == sorted([*before, "newcomer"])
    assert registry.build("newcomer", {"loudness": "2"}).loudness == 2.0
    assert cli.run(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out, parse_constant=refuse)[folder.rpartition(".")[2]]
    (newcomer,) = [entry for entry in listed if entry["name"] == "newcomer"]
    assert newcomer["summary"] == "Came as one file."
    assert newcomer["options"][0]["default"] == 1.0


def refuse(constant: str) -> None:
    """JSON has no infinity and no NaN; Python reads and writes them all the same."""
    pytest.fail(f"{constant} is not JSON")
