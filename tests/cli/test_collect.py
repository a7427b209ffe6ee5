"""The command `collect`."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from tests.cli.running import Capture, record, refusal

from monochord import cli
from monochord.capture.jack.server import JackServer
from monochord.sessions import check, read_session


def test_the_small_plan_and_once_more(tmp_path: Path, capsys: Capture) -> None:
    arguments = ["collect", "small", "--out", str(tmp_path / "out"), "--workers", "1"]
    result = record(capsys, *arguments)
    assert (result["plan"], result["count"], result["kept"], result["simulated"]) == ("small", 2, 0, True)
    assert result["windows"]["static"] > 100
    assert result["windows"]["slip"] > 100
    assert result["size"] == sum(path.stat().st_size for path in (tmp_path / "out").iterdir())
    assert {entry["name"] for entry in result["sessions"]} == {"hold_000", "slide_000"}
    assert all(read_session(Path(entry["path"])).complete for entry in result["sessions"])
    assert cli.run(arguments) == 0
    text = capsys.readouterr().out
    assert "2 sessions (2 kept)" in text
    assert result["sha256"] in text
    assert text.count("kept\n") == 2


def test_a_plan_of_ones_own(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('[[groups]]\nname = "one"\ngrid = [1, 1]\nhold = 0.2\n', encoding="utf-8")
    assert cli.run(["collect", str(file), "--out", str(tmp_path), "--seed", "3"]) == 0
    assert "simulated" in capsys.readouterr().out
    assert read_session(tmp_path / "one_000.mcap").description.seed == 3


def test_the_same_plan_with_one_driver(tmp_path: Path) -> None:
    one = "groups=[{name='hold', grid=[1, 1], hold=0.3}]"
    arguments = ["collect", "small", "--out", str(tmp_path), "--set", one]
    assert cli.run([*arguments, "--set", "sensor=prototype_one_driver"]) == 0
    recorded = read_session(tmp_path / "hold_000.mcap").description
    assert recorded.sensor["name"] == "prototype_one_driver"
    assert recorded.sensor["drivers"][1]["limit"] == 0.0
    assert cli.run(arguments) == 2  # not this session of this plan


@pytest.mark.parametrize(
    ("options", "words"),
    [(["--set", "sensor=prototipe"], "'prototype'"), (["--real-time", "--server", "nobody"], "'nobody'")],
)
def test_what_a_worker_refuses_is_one_line(
    options: list[str], words: str, tmp_path: Path, capfd: Capture
) -> None:
    assert words in refusal(capfd, "collect", "small", "--out", tmp_path / "out", *options)


def test_two_collections_into_one_folder_are_not_taken_at_once(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    first = ["collect", "small", "--out", str(out), "--workers", "1"]
    with subprocess.Popen([sys.executable, "-m", "monochord", *first], stdout=subprocess.PIPE) as process:
        until(lambda: bool(list(out.glob("*.part-*"))), process)
        begun = {path.name for path in out.iterdir()}
        for more in (["--seed", "1"], ["--real-time"]):
            assert f"process {process.pid} " in refusal(capsys, *first[:4], *more)
        assert begun <= {path.name for path in out.iterdir()}
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert record(capsys, *first, "--seed", "1", "--only", "hold")["kept"] == 0
    assert [path.name for path in out.iterdir()] == ["hold_000.mcap"]


def until(reached: Callable[[], bool], process: "subprocess.Popen[bytes]", limit: float = 240.0) -> None:
    """Wait for something that a running process does."""
    deadline = time.monotonic() + limit
    while not reached():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.jack
@pytest.mark.real_time
@pytest.mark.parametrize(
    ("number", "sign"),
    [
        (signal.SIGINT, "temporary/monochord-scratch-*/player.npz"),
        pytest.param(signal.SIGTERM, "out/hold_000.mcap.part", marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, "out/hold_000.mcap.part", marks=pytest.mark.slow),
    ],
)
def test_played_in_real_time_it_ends_its_processes_and_leaves_nothing_behind(
    number: signal.Signals, sign: str, jack_server: JackServer, tmp_path: Path
) -> None:
    temporary, out = tmp_path / "temporary", tmp_path / "out"
    temporary.mkdir()
    part = out / "hold_000.mcap.part"
    command = ["collect", "small", "--only", "hold", "--out", str(out), "--real-time"]
    with subprocess.Popen(
        [sys.executable, "-m", "monochord", *command, "--server", jack_server.name],
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(temporary)},
    ) as process:
        until(lambda: bool(list(tmp_path.glob(sign))), process)
        parts = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(number)
        _, error = process.communicate(timeout=20)
    assert process.returncode == cli.INTERRUPTED
    assert error.endswith(b"monochord: interrupted\n")
    assert b"Traceback" not in error
    assert not [each for each in parts if each.is_running()]
    assert not list(temporary.iterdir())
    assert {path.name for path in out.iterdir()} <= {part.name}


@pytest.mark.jack
@pytest.mark.real_time
@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_plan_is_played_in_real_time(jack_server: JackServer, tmp_path: Path, capsys: Capture) -> None:
    plan = tmp_path / "tiny.toml"
    plan.write_text('[[groups]]\nname = "hold"\ngrid = [1, 1]\nhold = 0.3\n')
    command = ["collect", str(plan), "--out", str(tmp_path), "--real-time", "--server", jack_server.name]
    result = record(capsys, *command)
    assert check(tmp_path / "hold_000.mcap").sound
    assert {file.name for file in tmp_path.iterdir()} == {"tiny.toml", "hold_000.mcap"}
    assert record(capsys, *command)["sha256"] == result["sha256"]
