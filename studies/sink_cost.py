"""Processor time of the sinks that send datagrams, for each window and string.

Prints its rows in some forty seconds: ``python -m studies.sink_cost``.
"""

import itertools
import subprocess
import sys
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from studies._command import measure

from monochord import Run, Sink, Update, VirtualSensor, Writer, listen
from monochord.benchmarks.base import Benchmark, Row, row
from monochord.core.errors import DeviceError
from monochord.core.ranges import Count
from monochord.core.types import Signal
from monochord.core.units import Seconds
from monochord.live.delivery import Delivery
from monochord.live.sinks import SINKS

SIGNAL = Signal(sample_rate=44100, channels=2)
HOP: Seconds = 0.01
SETTLING: Seconds = 1.0
"""Time in which writers and readers find each other."""
WARM_UP = 100
"""Windows before those that count."""
BOUND = 0.25
"""Processor time for each window and string, in ms."""
NAMESPACE, DOMAIN = "/monochord_cost", 78
READER = Path(__file__).with_name("_dds_reader.py")


class _Nothing(Writer):
    def write(self, update: Update) -> None:
        """Write nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Nothing(Sink):
    """A sink that takes updates and does nothing: what delivery alone costs."""

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Yield a writer that does nothing."""
        yield _Nothing()


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkCost(Benchmark):
    """Processor time of a process that delivers to a sink, less that of one without: for a window and string.

    Updates of a touched virtual sensor are handed over at 100 windows a second, as the live loop does, those
    of all strings at once. The threads of the DDS library count. Another process reads all topics of `ros2`
    by reliable delivery; a socket takes the datagrams of `udp`.

    Parameters
    ----------
    strings
        Numbers of strings.
    windows
        Windows that count, of each string.
    """

    strings: tuple[Count, ...] = (1, 4)
    windows: Count = 500

    def run(self) -> Iterator[Row]:
        """Measure each sink beside none."""
        sensor = VirtualSensor("prototype", seed=1)
        sensor.press(0.08, 1.0)
        updates = list(itertools.islice(listen(sensor, model="demo"), 200))[100:]
        for count in self.strings:
            names = [f"s{number}" for number in range(count)]
            alone = self._cost(Nothing(), names, updates)
            yield row(f"delivery alone, {count} strings", alone, "ms")
            for kind, read in (("udp", False), ("ros2", False), ("ros2", True)):
                options = {"namespace": NAMESPACE, "domain": DOMAIN} if kind == "ros2" else {}
                with _reader(names) if read else nullcontext():
                    cost = self._cost(SINKS.build(kind, options), names, updates)
                name = f"{kind}{' read by another' if read else ''}, {count} strings"
                yield row(name, cost - alone, "ms", "bound", BOUND)

    def _cost(self, sink: Sink, names: Sequence[str], updates: Sequence[Update]) -> float:
        """Return the processor time for a window and string in ms."""
        run = Run(signal=SIGNAL, strings=dict.fromkeys(names, SIGNAL))
        endless = itertools.cycle(updates)
        began = 0.0
        with Delivery([sink], run, paced=True) as delivery:
            time.sleep(SETTLING)
            due = time.monotonic()
            for number in range(WARM_UP + self.windows):
                if number == WARM_UP:
                    began = time.process_time()
                update = next(endless)
                for name in names:
                    delivery.hand_over(replace(update, string=name))
                due += HOP
                time.sleep(max(due - time.monotonic(), 0.0))
            spent = time.process_time() - began
        if sum(each.left_out for each in delivery.delivered):
            raise DeviceError("the sink left out windows", "leave the machine idle")
        return 1e3 * spent / (self.windows * len(names))


@contextmanager
def _reader(names: Sequence[str]) -> Generator[None]:
    """Read all topics in another process."""
    command = [sys.executable, str(READER), str(DOMAIN), *(f"{NAMESPACE}/{name}" for name in names)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:  # noqa: S603  (our own module)  # nosec B603
        if process.stdout is None or process.stdout.readline() != "ready\n":
            process.kill()
            raise DeviceError("the reader of the topics did not start")
        yield
        if not process.communicate(timeout=30)[0].strip().isdecimal():
            raise DeviceError("the reader of the topics failed")


if __name__ == "__main__":
    measure(SinkCost)
