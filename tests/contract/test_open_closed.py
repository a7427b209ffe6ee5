"""Adding a plug-in adds one file and edits nothing: each folder is given a file it has never seen."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from monochord import cli
from monochord.benchmarks import BENCHMARKS
from monochord.estimators import ESTIMATORS
from monochord.figures import FIGURES
from monochord.registry import Registry
from monochord.sinks import SINKS
from monochord.sources import SOURCES

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


@pytest.mark.parametrize(
    ("registry", "method"),
    [(SOURCES, "open"), (SINKS, "open"), (ESTIMATORS, "prepare"), (FIGURES, "draw"), (BENCHMARKS, "run")],
    ids=lambda value: getattr(value, "package", ""),
)
def test_one_file_is_a_plug_in(
    add: Add, capsys: pytest.CaptureFixture[str], registry: Registry[Any], method: str
) -> None:
    before = registry.names()
    text = PLUGIN.format(package=registry.package, base=registry.base.__name__, method=method)
    add(registry.package, "newcomer", text)
    assert registry.names() == sorted([*before, "newcomer"])
    assert registry.build("newcomer", {"loudness": "2"}).loudness == 2.0
    assert cli.run(["list", "--json"]) == 0
    assert "newcomer" in json.dumps(json.loads(capsys.readouterr().out))
