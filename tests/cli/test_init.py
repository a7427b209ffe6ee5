"""The command line as a whole; each command's own behaviour is tested beside it."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.shell_completion import BashComplete
from tests.cli.running import Capture

from monochord import __version__, cli
from monochord.core.registry import installed

COMMAND = '''
"""A command that does what its argument says."""

import click

from monochord.core.errors import DeviceError, InputError, MonochordError

FAULTS = {
    "input": InputError("force -1 N", "0 N or more", "press,\\n don't pull"),
    "device": DeviceError("no JACK server"),
    "own": MonochordError("gave up"),
    "file": FileNotFoundError(2, "No such file or directory", "take.wav"),
    "interrupt": KeyboardInterrupt(),
    "bug": ZeroDivisionError("a fault of ours"),
    "socket": ConnectionResetError(104, "Connection reset"),
    "full": OSError(28, "No space left on device"),
}


@click.command()
@click.argument("fault")
@click.option("--length", type=float, default=1.0)
@click.option("--status", type=int)
def pluck(fault: str, length: float, status: int | None) -> int | None:
    """Pluck the string.

    What follows the first line stands in the command's own help only.
    """
    if fault == "kernel":
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()
    if fault == "circle":
        FAULTS["bug"].__cause__, FAULTS["input"].__cause__ = FAULTS["input"], FAULTS["bug"]
        raise FAULTS["input"]
    if fault in FAULTS:
        raise FAULTS[fault]
    click.echo(f"{fault} {length}")
    return status
'''


@pytest.fixture(autouse=True)
def pluck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A command added as any command is: one file in the folder, nothing else edited."""
    (tmp_path / "pluck.py").write_text(COMMAND, encoding="utf-8")
    monkeypatch.setattr(cli, "__path__", [*cli.__path__, str(tmp_path)])
    yield
    sys.modules.pop("monochord.cli.pluck", None)


def test_a_new_file_is_a_new_command(capsys: Capture) -> None:
    assert cli.run(["pluck", "gently", "--length", "0.65"]) == 0
    assert capsys.readouterr().out == "gently 0.65\n"


def test_help_lists_every_command_without_loading_it(capsys: Capture) -> None:
    assert cli.run(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split() == ["pluck", "Pluck", "the", "string."] for line in lines)
    assert "monochord.cli.pluck" not in sys.modules


def test_every_command_stands_in_one_group_with_a_summary(capsys: Capture) -> None:
    assert cli.run(["--help"]) == 0
    groups, ungrouped = capsys.readouterr().out.split(f"{cli.UNGROUPED}:\n")
    assert re.findall(r"(?m)^  (\w+) +[A-Z]", ungrouped) == ["pluck", *installed("commands")]
    for name in [name for group in cli.GROUPS.values() for name in group]:
        assert len(re.findall(rf"(?m)^  {name} +[A-Z]", groups)) == 1


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ("monochord l", ["list", "live", "locate"]),
        ("monochord live --sou", ["--source"]),
        ("monochord live --source s", ["session", "soundcard", "split_string"]),
        ("monochord live d", ["demo"]),
        ("monochord locate --estimator c", ["closed_form"]),
        ("monochord figure sc", ["scatter"]),
        ("monochord record x.mcap --sensor prototype_e", ["prototype_ebow"]),
        ("monochord bench l", ["live"]),
        ("monochord list sou", ["sources"]),
    ],
)
def test_the_shell_completes_names(words: str, values: list[str]) -> None:
    complete = BashComplete(cli.monochord, {}, "monochord", "_MONOCHORD_COMPLETE")
    _, *arguments, incomplete = words.split()
    completed = complete.get_completions(arguments, incomplete)
    assert [item.value for item in completed if item.type == "plain"] == values


def test_no_argument_shows_the_help_and_does_no_work(capsys: Capture) -> None:
    assert cli.run([]) == 2
    assert "doctor" in capsys.readouterr().err


def test_version(capsys: Capture) -> None:
    assert cli.run(["--version"]) == 0
    assert __version__ in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["pluk"], 2, ["'pluk'", "'pluck'"]),
        (["pluck"], 2, ["'FAULT'", "'monochord pluck --help'"]),
        (["pluck", "it", "--lenght", "1"], 2, ["'--lenght'", "'--length'"]),
        (["pluck", "it", "--length", "long"], 2, ["--length", "'long'"]),
        (["pluck", "it", "--length"], 2, ["--length", "'monochord pluck --help'"]),
        (["--verbose"], 2, ["'--verbose'", "'monochord --help'"]),
        (["pluck", "input"], 2, ["force -1 N", "0 N or more", "press, don't pull"]),
        (["pluck", "device"], 2, ["no JACK server"]),
        (["pluck", "file"], 2, ["take.wav"]),
        (["pluck", "own"], 1, ["gave up"]),
        (["pluck", "full"], 2, ["No space left on device"]),
    ],
)
def test_an_error_is_one_line_and_a_status(
    capsys: Capture, arguments: list[str], status: int, words: list[str]
) -> None:
    assert cli.run(arguments) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("monochord: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


def test_a_command_may_return_its_own_status() -> None:
    assert cli.run(["pluck", "it", "--status", "3"]) == 3


def test_interrupted_is_130() -> None:
    assert cli.run(["pluck", "interrupt"]) == 130
    assert cli.run(["pluck", "kernel"]) == 130


@pytest.mark.timeout(30)
def test_errors_that_are_each_others_cause_end_it() -> None:
    assert cli.run(["pluck", "circle"]) == 2


@pytest.mark.parametrize(("fault", "kind"), [("bug", ZeroDivisionError), ("socket", ConnectionResetError)])
def test_a_fault_of_ours_is_not_hidden(fault: str, kind: type[Exception]) -> None:
    with pytest.raises(kind):
        cli.run(["pluck", fault])


def test_a_reader_that_goes_away_is_no_traceback() -> None:
    code = "import time; time.sleep(0.3); from monochord.cli import main; main(['--help'])"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as run:
        assert run.stdout
        run.stdout.close()
        assert run.stderr
        assert run.stderr.read() == b""
    assert run.returncode == 1


def test_output_that_cannot_be_written_is_one_line_and_status_2() -> None:
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(
            [sys.executable, "-c", "from monochord.cli import main; main()", "--help"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert "No space left on device" in done.stderr
    assert done.stderr.count("\n") == 1
