"""A live run of a recording that is killed while a sink writes."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

RUN = """
import sys
from monochord.cli import main
main(["live", sys.argv[1], "--length", "0.65", "--open-frequency", "110", "--set", "source.repeat=0",
      "--set", "source.speed=1", "--json", "--sink", sys.argv[2]])
"""


def killed(recording: Path, sink: str, windows: int) -> float:
    """Run with a sink, kill -9 it after that many windows, and return the time of the last."""
    command = [sys.executable, "-c", RUN, str(recording), sink]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        lines = [process.stdout.readline() for _ in range(windows)]
        os.kill(process.pid, signal.SIGKILL)
    return float(json.loads(lines[-1])["time"])
