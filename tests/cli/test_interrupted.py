"""Control-C at any moment: one line, status 130, nothing under the final name and no child left."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.lab.tiny import tiny

from monochord import cli
from monochord.lab.bench import make
from monochord.lab.plan import assignments

VERBS = {
    "build": ["build", "{home}/hold_000.mcap", "--out", "{out}"],
    "collect": ["collect", "small", "--out", "{out}", "--workers", "2"],
    "evaluate": ["evaluate", "demo", "--sessions", "{home}/hold_000.mcap", "--suite", "--out", "{out}"],
    "simulate": ["simulate", "prototype", "--model", "twin", "--seconds", "60", "--out", "{out}.wav"],
    "train": ["train", "small", "--dataset", "{learnable}", "--out", "{out}"],
}
MOMENTS = (0.3, 0.8, 1.3, 2.0, 3.0)
"""Seconds after the start: within the loading, the start of workers, and the work."""


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("verb", VERBS)
def test_it_ends_the_same_way_whenever_it_comes(
    verb: str, number: signal.Signals, learnable: Path, tmp_path: Path
) -> None:
    home, out = make(assignments(tiny())[0], tmp_path).path.parent, tmp_path / "out"
    words = [word.format(home=home, out=out, learnable=learnable) for word in VERBS[verb]]
    ended: list[float] = []
    for moment in MOMENTS:
        with subprocess.Popen(
            [sys.executable, "-m", "monochord", *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE,
            text=True, start_new_session=True,
        ) as process:  # fmt: skip
            time.sleep(moment)
            if process.poll() is None:
                os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
            printed, error = process.communicate(timeout=60)
        if process.returncode == 0:  # done before
            break
        ended.append(moment)
        assert (process.returncode, error, printed) == (cli.INTERRUPTED, "monochord: interrupted\n", "")
        assert not list(tmp_path.glob("out.wav"))
        if verb == "build":
            assert {path.name for path in tmp_path.iterdir()} == {"hold_000.mcap"}
        if verb == "collect":
            assert not list(out.glob("*"))
        with pytest.raises(ProcessLookupError):
            os.killpg(process.pid, 0)
    assert ended
