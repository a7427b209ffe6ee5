"""`monochord list` finds every plug-in folder and every preset by itself."""

from pathlib import Path

import pytest
from tests.cli.running import Capture, record
from tests.contract.test_open_closed import write_distribution

from monochord.capture.sources import SOURCES
from monochord.cli import run
from monochord.figures import FIGURES
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.strings import string_names


def test_json_lists_every_plugin_and_preset(capsys: Capture) -> None:
    result = record(capsys, "list")
    assert {"benchmarks", "estimators", "figures", "simulators", "sinks", "sources", "strings"} <= set(result)
    assert [entry["name"] for entry in result["figures"]] == FIGURES.names()
    assert [entry["name"] for entry in result["sources"]] == SOURCES.names()
    assert [entry["name"] for entry in result["strings"]] == string_names()
    assert [entry["name"] for entry in result["sensors"]] == sensor_names()
    assert [entry["name"] for entry in result["materials"]] == material_names()
    for entry in (entry for shelf in result.values() for entry in shelf):
        assert entry["summary"].endswith(".") or "source" in entry


def test_options_come_with_their_defaults(capsys: Capture) -> None:
    scatter = next(e for e in record(capsys, "list", "figures")["figures"] if e["name"] == "scatter")
    options = {option["name"]: option for option in scatter["options"]}
    assert options["results"]["required"]
    assert options["condition"] == {
        "name": "condition", "required": False, "default": "clean", "allowed": "text",
    }  # fmt: skip


def test_a_preset_comes_with_its_source_and_its_values(capsys: Capture) -> None:
    sensors = {entry["name"]: entry for entry in record(capsys, "list", "sensor")["sensors"]}
    prototype = load_sensor("prototype")
    assert sensors["prototype"]["source"] == prototype.source
    assert sensors["prototype"]["sensor"]["string"]["tension"] == prototype.string.tension
    assert sensors["prototype"]["sensor"]["range"] == [*prototype.range]
    materials = {entry["name"]: entry for entry in record(capsys, "list", "materials")["materials"]}
    rubber = load_material("rubber")
    assert materials["rubber"]["notes"] == rubber.notes
    assert materials["rubber"]["material"]["young_modulus"] == rubber.young_modulus


def test_text_shows_names_and_defaults(capsys: Capture) -> None:
    assert run(["list", "figure"]) == 0
    text = capsys.readouterr().out
    assert "scatter" in text
    assert "clean" in text
    assert "plain_010" not in text
    assert run(["list", "sensors"]) == 0
    assert load_sensor("gauge_012").title in capsys.readouterr().out


def test_settings_are_listed_by_the_names_that_set_takes(capsys: Capture) -> None:
    (live,) = record(capsys, "list", "settings", "live")["settings"]
    options = {option["name"]: option for option in live["options"]}
    expected = {"default": 0.01, "allowed": "a number from 0.001 to 60 s"}
    assert options["window.hop"] == {**options["window.hop"], **expected}
    assert options["seconds"]["default"] == "inf"
    setups = record(capsys, "list", "settings", "simulate")["settings"]
    assert {"simulate_split_string", "simulate_twin"} <= {setup["name"] for setup in setups}


def test_devices_and_models_are_listed(capsys: Capture) -> None:
    devices = record(capsys, "list", "devices")["devices"]
    assert {device["source"] for device in devices} <= {"jack", "soundcard"}
    assert [model["name"] for model in record(capsys, "list", "models", "demo")["models"]] == ["demo"]


BROKEN = {
    "raises": "raise RuntimeError('no such\\nboard')",
    "ends": "raise SystemExit(3)",
    "misspelt": "def broken(:",
    "empty": "",
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_package_is_one_line_and_hides_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture, kind: str
) -> None:
    (tmp_path / f"{kind}_board.py").write_text(BROKEN[kind], encoding="utf-8")
    groups = ("sources", "sinks", "sensors")
    entries = [line for group in groups for line in (f"[monochord.{group}]", f"board = {kind}_board")]
    write_distribution(tmp_path, f"{kind}_board", entries)
    monkeypatch.syspath_prepend(tmp_path)
    for group in groups:
        result = record(capsys, "list", group)
        (board,) = [entry for entry in result[group] if entry["name"] == "board"]
        assert board["broken"]
        assert not any("broken" in entry for entry in result[group] if entry["name"] != "board")
    assert run(["list", "sources"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "broken" in line]
    assert len(lines) == 1
    assert lines[0].split()[:2] == ["board", "broken:"]


def test_a_package_whose_list_is_damaged_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    write_distribution(tmp_path, "torn_board", ["[monochord.sources]", "board"])
    monkeypatch.syspath_prepend(tmp_path)
    names = [entry["name"] for entry in record(capsys, "list", "sources")["sources"]]
    assert {"wav", "twin"} <= set(names)
    assert "board" not in names
