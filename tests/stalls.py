"""Whether this machine stood still while a test ran, measured by a process that only sleeps.

A test that compares with the clock says nothing where the machine gave its processes no time, as machines do
that others share. Such a failure, and only such a one, is tried again.
"""

import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

PERIOD = 0.002
STALL = 0.005
"""What a sleep of `PERIOD` may be late, in s. 1 ms is usual on a quiet machine, and a period of JACK."""
FAILED_ATTEMPTS = 5
QUIET = 2.0
"""For so many seconds a machine stands still nowhere before a test is tried again, if that comes soon."""
PATIENCE = 30.0


class Stalls:
    """The stalls that the sleeping process has reported so far."""

    def __init__(self, process: "subprocess.Popen[str]", report: Path) -> None:
        self._process, self._report = process, report

    def longest_since(self, begin: float) -> float:
        """Return by how much a sleep was late since a time of the monotonic clock, in s; 0.0 for no stall."""
        assert self._process.poll() is None, "the process that watches for stalls ended"
        pairs = (line.split() for line in self._report.read_text().splitlines())
        return max((float(length) for end, length in pairs if float(end) > begin), default=0.0)

    def wait_for_quiet(self) -> None:
        """Return once the machine has not stood still for `QUIET`, or after `PATIENCE`."""
        begin = time.monotonic()
        while self.longest_since(max(begin, time.monotonic() - QUIET)) or time.monotonic() < begin + QUIET:
            if time.monotonic() > begin + PATIENCE:
                return
            time.sleep(0.1)


@contextmanager
def watched(report: Path) -> Generator[Stalls]:
    """Start the process that sleeps, and end it afterwards; it ends by itself where we are killed."""
    report.touch()
    process = subprocess.Popen([sys.executable, __file__, str(report)], stdin=subprocess.PIPE, text=True)
    try:
        yield Stalls(process, report)
    finally:
        process.kill()
        process.wait()


def watch(report: Path) -> None:
    """Sleep again and again, and write down when a sleep ended late and by how much."""
    from select import select

    while True:
        begin = time.monotonic()
        closed = select([sys.stdin], [], [], PERIOD)[0]
        end = time.monotonic()
        if closed:
            return
        if end - begin - PERIOD > STALL:
            with report.open("a", encoding="ascii") as file:
                file.write(f"{end} {end - begin - PERIOD}\n")


if __name__ == "__main__":
    watch(Path(sys.argv[1]))
