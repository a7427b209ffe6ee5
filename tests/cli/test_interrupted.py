"""Control-C at any moment: one line, status 130, nothing but what is whole, and no child left."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from tests.lab.tiny import tiny

from monochord import cli, load_dataset
from monochord.lab.assignment import assignments
from monochord.lab.offline import make
from monochord.sessions import check

COMMANDS = {
    "build": "{home}/hold_000.mcap --out {out}",
    "collect": "paper --out {out} --workers 2",
    "evaluate": "demo --sessions {home}/hold_000.mcap --suite noise --out {out}",
    "simulate": "prototype --model twin --seconds 600 --out {out}.wav",
    "train": "paper --dataset {learnable} --out {out}",
}
MOMENTS = (0.0, 0.3, 0.8, 1.3, 2.0, 3.0)
"""Seconds after the program has taken the signals: within the loading, the start of workers, and the work."""


def takes_signals(process: "subprocess.Popen[str]") -> bool:
    """Return whether a process catches SIGTERM, which Python by itself does not."""
    caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{process.pid}/status").read_text(encoding="ascii"))
    assert caught
    return bool(int(caught[1], 16) >> signal.SIGTERM - 1 & 1)


def group_of(process: psutil.Process) -> int | None:
    """Return the process group, None for one that has ended."""
    with suppress(ProcessLookupError, psutil.NoSuchProcess):
        return None if process.status() == psutil.STATUS_ZOMBIE else os.getpgid(process.pid)
    return None


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("command", COMMANDS)
def test_it_ends_the_same_way_whenever_it_comes(
    command: str, number: signal.Signals, learnable: Path, tmp_path: Path
) -> None:
    home, out = make(assignments(tiny())[0], tmp_path).path.parent, tmp_path / "out"
    words = [word.format(home=home, out=out, learnable=learnable) for word in COMMANDS[command].split()]
    ended: list[float] = []
    for moment in MOMENTS:
        temporary = tmp_path / f"temporary {moment}"
        temporary.mkdir()
        with subprocess.Popen(
            [sys.executable, "-m", "monochord", command, *words],
            stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True,
            env={**os.environ, "TMPDIR": str(temporary)},
        ) as process:  # fmt: skip
            while process.poll() is None and not takes_signals(process):
                time.sleep(0.005)
            time.sleep(moment)
            if process.poll() is None:
                os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
            printed, error = process.communicate(timeout=60)
        if printed:  # done before, whatever the end of the interpreter makes of the signal
            assert process.returncode in {0, -number}
            break
        ended.append(moment)
        assert (process.returncode, error, printed) == (cli.INTERRUPTED, "monochord: interrupted\n", "")
        assert not list(tmp_path.glob("out.wav"))
        if command == "build":
            assert [path for path in tmp_path.iterdir() if "out" in path.name] in ([], [out])
            if out.exists():  # whole, split and audited: what is left was to say so
                data = load_dataset(out)
                data.dataset.verify()
                assert data.split
                break
        if command == "collect":
            assert all(check(path).sound for path in out.glob("*"))  # those that were done stay
        deadline = time.monotonic() + 10.0
        while [each for each in psutil.process_iter() if group_of(each) == process.pid]:
            assert time.monotonic() < deadline
            time.sleep(0.05)
    assert ended
