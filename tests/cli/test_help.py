"""The help of each command, as a person uses it: and its examples, which work as they stand."""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from shutil import copy, copytree, rmtree

import click
import pytest
import soundfile
from tests.cli.conftest import Take

from monochord import cli
from monochord.physics.twin.virtual_sensor import VirtualSensor

OTHER_MEANS = (
    "--instrument", "--device", "--web", "tune --sensor", "left=", "weights", "bench", "collect small",
    "sessions label",
)  # fmt: skip
"""Words of examples that need a device, a person, a download or minutes: these are parsed, not run."""
RUN_ELSEWHERE = ("demo --seconds", "design --range", "doctor --sensor")
"""Words of examples that run whole in `test_demo.py`, `tests/front/test_design.py` and `test_doctor.py`."""
UNENDING = ("monochord demo", "monochord live demo --source twin", "--estimator closed_form")
"""Ends of examples that run until Control-C."""


def commands() -> Iterator[tuple[str, click.Command]]:
    """Yield every command and subcommand, by the words that call it."""
    context = click.Context(cli.monochord, info_name="monochord")
    yield "monochord", cli.monochord
    for name in cli.monochord.list_commands(context):
        command = cli.monochord.get_command(context, name)
        assert command
        yield f"monochord {name}", command
        if isinstance(command, click.Group):
            yield from ((f"monochord {name} {each}", part) for each, part in command.commands.items())


COMMANDS = dict(commands())


def examples(command: click.Command) -> list[str]:
    """Return the lines after backspaces in a command's help, each a command."""
    parts = (command.help or "").split("\b\n")[1:]
    return [line.strip() for part in parts for line in part.splitlines() if line.strip()]


EXAMPLES = [line for command in COMMANDS.values() for line in examples(command)]


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_says_in_a_line_what_the_command_does_and_shows_two_examples(name: str) -> None:
    command = COMMANDS[name]
    first = (command.help or "").splitlines()[0]
    assert first.endswith(".")
    assert len(first) <= 66  # one line in the list of commands, on a screen of 80 columns
    assert len([line for line in examples(command) if line.startswith("monochord ")]) >= 2
    assert all(option.help for option in command.params if isinstance(option, click.Option))


@pytest.mark.parametrize("line", sorted(set(EXAMPLES)))
def test_every_example_names_a_command_and_options_that_parse(line: str) -> None:
    name, *words = shlex.split(line)
    assert name == "monochord"
    command: click.Command | None = cli.monochord
    context = click.Context(cli.monochord, info_name=name)
    while isinstance(command, click.Group):
        name = words.pop(0)
        command = command.get_command(context, name)
        assert command, name
    assert command
    with command.make_context(name, words, parent=context) as parsed:
        assert parsed.command is command


FEW = "groups=[{name='hold', sessions=2, grid=[3, 1], hold=0.3}]"


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with short sessions, and one of them under the name that the examples use."""
    path = tmp_path_factory.mktemp("sessions")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        assert cli.run(["collect", "quick", "--out", "sessions", "--set", FEW, "--workers", "1"]) == 0
        copy("sessions/hold_000.mcap", "session.mcap")
        assert cli.run(["sessions", "export", "wav-csv", "session.mcap", "--out", "tables"]) == 0
        assert cli.run(["sessions", "resample", "session.mcap", "--out", "slow.mcap", "--rate", "22050"]) == 0
        Path("take.csv").write_text("begin,end,position,force\n0.1,0.5,0.1,1\n", encoding="utf-8")
        assert (
            cli.run(["simulate", "prototype", "--model", "twin", "--seconds", "2", "--out", "two.wav"]) == 0
        )
        assert cli.run(["sessions", "import", "two.wav", "--out", "take.mcap"]) == 0
        for name, driven in (("pluck.wav", False), ("driven.wav", True)):
            twin = VirtualSensor("prototype", seed=1)
            twin.drive(driven, driven)
            soundfile.write(name, twin.advance(2.0)[0].T, twin.sample_rate, subtype="FLOAT")
        ends = "start = [0, 0, 0]\nend = [0.2, 0, 0]\npress = [0, 0, -1]\nsensor = 'prototype'\n"
        Path("finger.toml").write_text(f"link = 'finger'\n[strings.top]\n{ends}", encoding="utf-8")
        Path("arm.urdf").write_text("<robot name='arm'><link name='finger'/></robot>", encoding="utf-8")
        copy("take.csv", "touches.csv")
        copy("session.mcap", "touches.mcap")
    return path


@pytest.fixture(scope="module")
def folder(sessions: Path) -> Path:
    """Return that folder with longer sessions, a dataset, another split of it, a model, and its report."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(sessions)
        rmtree("sessions")
        assert cli.run(["collect", "quick", "--out", "sessions"]) == 0
        assert cli.run(["build", "sessions", "--out", "dataset"]) == 0
        copy("dataset/split.json", "other.json")
        assert cli.run(["train", "--dataset", "dataset", "--out", "run"]) == 0
        assert cli.run(["evaluate", "run", "--dataset", "dataset", "--out", "report"]) == 0
    return sessions


def work(line: str, place: Path, here: Path) -> None:
    """Run an example in a copy of a folder, in which what it writes is not there yet."""
    _, *words = shlex.split(line)
    copytree(place, here, copy_function=os.link)
    written = (
        words[1:2]
        if words[0] == "record"
        else words[words.index("--out") + 1 :][:1]
        if "--out" in words
        else []
    )
    for out in (here / name for name in written):
        if out.is_dir():
            rmtree(out)
        out.unlink(missing_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(here)
        found = [sorted(map(str, Path().glob(word))) if word.endswith("*.mcap") else [word] for word in words]
        assert cli.run([each for files in found for each in files]) == 0
    assert all((here / name).exists() for name in written)


def is_run(line: str) -> bool:
    """Return whether an example needs no device and no download, ends by itself, and runs nowhere else."""
    return not line.endswith(UNENDING) and not any(word in line for word in OTHER_MEANS + RUN_ELSEWHERE)


LASTS = re.compile(
    "monochord (build|audit|train|publish|figure scatter|evaluate (run|--estimator)|collect|calibrate"
    "|sessions check|sessions export lerobot)"
)
"""Begins examples that train, or that take seconds over all sessions of a folder."""


@pytest.mark.parametrize(
    "line", sorted({line for line in EXAMPLES if is_run(line) and not LASTS.match(line)})
)
def test_examples_work_as_they_stand(line: str, sessions: Path, take: Take, tmp_path: Path) -> None:
    if "take.wav" in line and not (sessions / "take.wav").exists():
        copy(take(0.2, channels=1), sessions / "take.wav")
    work(line, sessions, tmp_path / "here")


@pytest.mark.slow
@pytest.mark.parametrize("line", sorted({line for line in EXAMPLES if LASTS.match(line)}))
def test_long_examples_work_as_they_stand(line: str, folder: Path, tmp_path: Path) -> None:
    work(line, folder, tmp_path / "here")
