"""`monochord list` finds every plug-in folder and the strings by itself."""

import json

import pytest

from monochord.cli import run
from monochord.figures import FIGURES
from monochord.physics.strings import string_names
from monochord.sources import SOURCES


def test_json_lists_every_plugin_and_string(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"benchmarks", "estimators", "figures", "models", "sinks", "sources", "strings"} <= set(found)
    assert [entry["name"] for entry in found["figures"]] == FIGURES.names()
    assert [entry["name"] for entry in found["sources"]] == SOURCES.names()
    assert [entry["name"] for entry in found["strings"]] == string_names()
    for entry in (entry for shelf in found.values() for entry in shelf):
        assert entry["summary"].endswith(".") or "source" in entry


def test_options_come_with_their_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["list", "figures", "--json"]) == 0
    trends = next(e for e in json.loads(capsys.readouterr().out)["figures"] if e["name"] == "trends")
    options = {option["name"]: option for option in trends["options"]}
    assert options["string"] == {"name": "string", "required": False, "default": "appendix"}


def test_text_shows_names_and_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["list", "figure"]) == 0
    text = capsys.readouterr().out
    assert "convergence" in text
    assert "string [appendix]" in text
    assert "plain_010" not in text


def test_unknown_kind_is_refused_with_a_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["list", "sorces"]) == 2
    assert "did you mean 'sources'" in capsys.readouterr().err
