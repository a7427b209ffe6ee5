"""A live run of a recording that is killed while its sinks write: less than a second is lost."""

import csv
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

from monochord.sessions import read_session

RUN = """
import sys
from monochord.cli import main
main(["live", sys.argv[1], "--length", "0.65", "--open-frequency", "110", "--set", "source.repeat=0",
      "--set", "source.speed=1", "--json", "--sink", sys.argv[2], "--sink", sys.argv[3]])
"""


def test_a_kill_loses_less_than_a_second(recording: Path, tmp_path: Path) -> None:
    table, session = tmp_path / "out.csv", tmp_path / "out.mcap"
    command = [sys.executable, "-c", RUN, str(recording), f"csv={table}", f"mcap={session}"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        lines = [process.stdout.readline() for _ in range(150)]
        os.kill(process.pid, signal.SIGKILL)
    last = float(json.loads(lines[-1])["time"])
    text = table.read_text(encoding="utf-8")
    assert text.endswith("\n")
    written = list(csv.DictReader(text.splitlines(), strict=True))
    assert float(written[-1]["time"]) > last - 1.0
    assert {len(row) for row in written} == {len(written[0])}
    recorded = read_session(session)
    assert recorded.readings("estimates").time[-1] > last - 1.0
    assert recorded.audio.samples.shape[1] > (last - 1.0) * 44100
