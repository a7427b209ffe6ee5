"""Processor time of the sinks that send datagrams, for each window and string.

Prints its rows in a minute: ``python -m studies.sink_cost``.
"""

import subprocess
import sys
import threading
import time
from collections.abc import Container, Generator, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from studies._command import measure

from monochord import Run, Sink, VirtualSensor, listen
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SinkCost(Benchmark):
    """Processor time of a sink's threads for a window and string, those of the DDS library included.

    A model estimates a touched virtual sensor at 100 windows a second, as in a live run, so that the
    processor is neither asleep nor busy; the updates of all strings are handed over at once. Another process
    reads the topics of `ros2` by reliable delivery.

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
        """Measure each sink."""
        for count in self.strings:
            names = [f"s{number}" for number in range(count)]
            below = [f"{NAMESPACE}/{name}" for name in names]
            ros2 = SINKS.build("ros2", {"namespace": NAMESPACE, "domain": DOMAIN})
            for name, sink, places in (
                ("udp", SINKS.build("udp"), []),
                ("ros2, not read", ros2, []),
                ("ros2, every window read", ros2, below),
                ("ros2, markers read too", ros2, [*below, NAMESPACE]),
            ):
                with _reader(places) if places else nullcontext():
                    cost = self._cost(sink, names)
                yield row(f"{name}, strings: {count}", cost, "ms", "bound", BOUND)

    def _cost(self, sink: Sink, names: Sequence[str]) -> float:
        """Return the processor time for a window and string in ms."""
        sensor = VirtualSensor("prototype", seed=1)
        sensor.press(0.08, 1.0)
        stream = listen(sensor, model="demo")
        run = Run(signal=SIGNAL, strings=dict.fromkeys(names, SIGNAL))
        others = set(_tasks())
        with Delivery([sink], run, paced=True) as delivery:
            time.sleep(SETTLING)
            due, began = time.monotonic(), 0.0
            for number in range(WARM_UP + self.windows):
                if number == WARM_UP:
                    began = _spent(others)
                update = next(stream)
                for name in names:
                    delivery.hand_over(replace(update, string=name))
                due += HOP
                time.sleep(max(due - time.monotonic(), 0.0))
            spent = _spent(others) - began
        if sum(each.left_out for each in delivery.delivered):
            raise DeviceError("the sink left out windows; leave the machine idle meanwhile")
        return 1e-6 * spent / (self.windows * len(names))


def _tasks() -> dict[str, int]:
    """Return the processor time of each thread of this process in ns."""
    tasks = Path("/proc/self/task")
    return {each.name: int((each / "schedstat").read_text().split()[0]) for each in tasks.iterdir()}


def _spent(others: Container[str]) -> int:
    """Return the processor time of all threads but some, and but the one that passes updates on."""
    passing = {str(each.native_id) for each in threading.enumerate() if each.name == "delivery"}
    return sum(spent for task, spent in _tasks().items() if task not in others and task not in passing)


@contextmanager
def _reader(places: Sequence[str]) -> Generator[None]:
    """Read all topics of some namespaces in another process."""
    command = [sys.executable, str(READER), str(DOMAIN), *places]
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
