"""A plug-in or preset is one new file, of this tree or of an installed package, and edits nothing."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.contract.test_plugins import FOLDERS, SRC, registry_of

from monochord import cli
from monochord.core.errors import InputError
from monochord.physics.sensors import load_sensor, sensor_names

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


def text_of(folder: str) -> str:
    base = registry_of(folder).base
    (method,) = base.__abstractmethods__
    return PLUGIN.format(package=folder, base=base.__name__, method=method)


def refuse(constant: str) -> None:
    """JSON has no infinity and no NaN; Python reads and writes them all the same."""
    pytest.fail(f"{constant} is not JSON")


def refuse_unlisted(folder: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Fail where the newcomer of a folder is not built, or not listed with its option."""
    registry = registry_of(folder)
    assert registry.build("newcomer", {"loudness": "2"}).loudness == 2.0
    assert cli.run(["list", folder.rpartition(".")[2], "--json"]) == 0
    listed = json.loads(capsys.readouterr().out, parse_constant=refuse)[folder.rpartition(".")[2]]
    (newcomer,) = [entry for entry in listed if entry["name"] == "newcomer"]
    assert newcomer["summary"] == "Came as one file."
    assert newcomer["options"][0]["default"] == 1.0


@pytest.mark.parametrize("folder", FOLDERS)
def test_one_file_is_a_plug_in(add: Add, capsys: pytest.CaptureFixture[str], folder: str) -> None:
    before = registry_of(folder).names()
    add(folder, "newcomer", text_of(folder))
    assert registry_of(folder).names() == sorted([*before, "newcomer"])
    refuse_unlisted(folder, capsys)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on the path with an installed distribution that adds a plug-in to each of our folders."""
    home = tmp_path / "site"
    (home / "bellfoundry").mkdir(parents=True)
    (home / "bellfoundry" / "__init__.py").touch()
    entries: list[str] = []
    for folder in FOLDERS:
        name = folder.rpartition(".")[2]
        (home / "bellfoundry" / f"{name}.py").write_text(text_of(folder), encoding="utf-8")
        entries += [f"[monochord.{name}]", f"newcomer = bellfoundry.{name}"]
    write_distribution(home, "bellfoundry", entries)
    monkeypatch.syspath_prepend(home)
    return home


def write_distribution(home: Path, name: str, entries: list[str]) -> None:
    about = home / f"{name}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    (about / "entry_points.txt").write_text("\n".join(entries) + "\n", encoding="utf-8")


@pytest.mark.parametrize("folder", FOLDERS)
def test_an_installed_package_adds_a_plug_in(
    package: Path, capsys: pytest.CaptureFixture[str], folder: str
) -> None:
    assert "newcomer" in registry_of(folder).names()
    refuse_unlisted(folder, capsys)


def test_an_entry_point_may_name_the_class(package: Path, tmp_path: Path, monkeypatch: Any) -> None:
    write_distribution(
        tmp_path / "b", "carillon", ["[monochord.sinks]", "chime = bellfoundry.sinks:Newcomer"]
    )
    monkeypatch.syspath_prepend(tmp_path / "b")
    sinks = registry_of("monochord.live.sinks")
    assert sinks.load("chime") is sinks.load("newcomer")


@pytest.mark.parametrize(
    ("entry", "other"),
    [
        ("newcomer = bellfoundry.sinks", "bellfoundry"),
        ("terminal = bellfoundry.sinks", "Monochord"),
        ("absent = bellfoundry.absent", "Sink"),
        ("other = bellfoundry.sources:Newcomer", "Sink"),
        ("empty = bellfoundry", "Sink"),
    ],
)
def test_a_clash_or_a_broken_entry_point_is_refused(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, entry: str, other: str
) -> None:
    write_distribution(tmp_path / "b", "carillon", ["[monochord.sinks]", entry])
    monkeypatch.syspath_prepend(tmp_path / "b")
    sinks = registry_of("monochord.live.sinks")
    with pytest.raises(InputError, match="carillon") as caught:
        sinks.load(entry.partition(" ")[0])
    assert other in str(caught.value)
    assert sinks.load("jsonl").__name__ == "Jsonl"  # the others stay as they are


@pytest.fixture
def preset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str, str], None]:
    """Return what installs a package with one preset: its folder, its name, and the text of its file."""

    def install(folder: str, name: str, text: str) -> None:
        home = tmp_path / "presets"
        (home / "bellfoundry_presets").mkdir(parents=True)
        (home / "bellfoundry_presets" / "__init__.py").touch()
        (home / "bellfoundry_presets" / f"{name}.toml").write_text(text, encoding="utf-8")
        write_distribution(home, "presets", [f"[monochord.{folder}]", f"{name} = bellfoundry_presets"])
        monkeypatch.syspath_prepend(home)

    return install


def test_an_installed_package_adds_a_sensor(preset: Any) -> None:
    own = (SRC / "physics" / "sensors" / "prototype.toml").read_text(encoding="utf-8")
    preset("sensors", "bell_rope", own)
    assert "bell_rope" in sensor_names()
    assert load_sensor("bell-rope").string == load_sensor("prototype").string
    assert load_sensor("bell-rope").name == "bell_rope"


def test_a_preset_of_one_of_our_names_is_refused(preset: Any) -> None:
    preset("sensors", "prototype", "")
    with pytest.raises(InputError, match="presets"):
        load_sensor("prototype")
    assert load_sensor("long").name == "long"


COMMAND = '''
"""A command that was not there."""

import click

from monochord.cli import echo


@click.command()
@click.option("--times", default=1, help="How often.")
def ring(times: int) -> None:
    """Ring the bell.

    Loudly.
    """
    echo("ding " * times)
'''


@pytest.fixture
def commands(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return what installs a package with commands, each as an entry point's line."""

    def install(*entries: str) -> None:
        (package / "bellfoundry" / "command.py").write_text(COMMAND, encoding="utf-8")
        write_distribution(tmp_path / "commands", "belfry", ["[monochord.commands]", *entries])
        monkeypatch.syspath_prepend(tmp_path / "commands")

    return install


def test_an_installed_package_adds_a_command(
    commands: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    commands("ring = bellfoundry.command:ring")
    assert cli.run(["--help"]) == 0
    more = capsys.readouterr().out.partition(f"{cli.UNGROUPED}:\n")[2]
    assert ["ring", "Ring", "the", "bell."] in [line.split() for line in more.splitlines()]
    assert "bellfoundry.command" not in sys.modules
    assert cli.run(["ring", "--times", "2"]) == 0
    assert capsys.readouterr().out.split() == ["ding", "ding"]
    assert cli.run(["ring", "--tims", "2"]) == 2
    assert "--times" in capsys.readouterr().err
    assert cli.run(["rng"]) == 2
    assert "did you mean 'ring'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("bellfoundry.absent:ring", "ModuleNotFoundError"),
        ("bellfoundry.command:rung", "AttributeError"),
        ("bellfoundry.command:echo", "no command of click"),
        ("bellfoundry.command", "no command of click"),
        ("belfry_absent.command:ring", "ModuleNotFoundError"),
    ],
)
def test_a_command_that_cannot_be_imported_is_told_in_one_line_and_the_others_work(
    commands: Callable[..., None], capsys: pytest.CaptureFixture[str], value: str, why: str
) -> None:
    commands(f"ring = {value}", "live = bellfoundry.command:ring")
    assert cli.run(["ring"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert why in line
    assert "reinstall or remove belfry" in line
    assert cli.run(["--help"]) == 0
    assert cli.run(["list", "sinks"]) == 0
    capsys.readouterr()
    assert cli.run(["live", "--help"]) == 0  # a name of Monochord's stays Monochord's
    assert "--estimator" in capsys.readouterr().out


def test_a_command_of_two_packages_is_refused(
    commands: Callable[..., None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    commands("ring = bellfoundry.command:ring")
    write_distribution(
        tmp_path / "b", "carillon", ["[monochord.commands]", "ring = bellfoundry.command:ring"]
    )
    monkeypatch.syspath_prepend(tmp_path / "b")
    assert cli.run(["ring"]) == 2
    assert "belfry and of carillon" in capsys.readouterr().err


def test_names_are_listed_without_importing_a_package(package: Path) -> None:
    registry_of("monochord.live.sinks").names()
    assert "bellfoundry.sinks" not in sys.modules


@pytest.fixture(autouse=True)
def forget() -> Any:
    """Let go of the made-up package, whose text differs from test to test."""
    yield
    for name in [name for name in sys.modules if name.startswith("bellfoundry")]:
        del sys.modules[name]
