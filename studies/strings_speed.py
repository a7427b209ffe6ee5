"""Many strings on this machine: estimates per second for each, and the cost per string.

Prints its table in some forty seconds: ``python -m studies.strings_speed``.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from studies._command import measure
from studies._strings import refuse_options, strings_cost

from monochord.benchmarks.base import Benchmark, Row
from monochord.core.ranges import Checked
from monochord.core.units import Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Strings(Benchmark):
    """Rate and processor time of a trained model on several simulated strings of one source.

    The loop runs in real time. When it is late, it skips to the newest window, and all strings get the same,
    lower rate. The processor time of an estimate is compared with that of a single string in the same run.
    The strings hold the rate if they need fewer cores than there are processes, each on a core of its own.

    Parameters
    ----------
    strings
        Numbers of strings; the first one is the baseline.
    seconds
        Duration of the sound, and of the run, for each number.
    hop
        Hop in seconds.
    model
        Folder or name of the model.
    processes
        Number of processes that share the strings, like several runs of `monochord live`.
    """

    strings: tuple[int, ...] = (1, 2, 4, 8, 16, 32)
    seconds: Seconds = 5.0
    hop: Seconds = 0.01
    model: str = "demo"
    processes: int = 1

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        refuse_options(self.strings, self.seconds, self.processes)

    def run(self) -> Iterator[Row]:
        """Measure each number of strings in turn."""
        alone = None
        for strings in self.strings:
            seen = strings_cost(
                strings, seconds=self.seconds, hop=self.hop, model=self.model, processes=self.processes
            )
            alone = alone or seen
            name, first = f"N = {strings}", f"N = {alone.strings}"
            yield Row(
                name=f"{name}, rate of each",
                value=seen.rate,
                unit="1/s",
                baseline="asked for",
                baseline_value=1.0 / self.hop,
            )
            yield Row(
                name=f"{name}, cost of an estimate",
                value=1e3 * seen.cost,
                unit="ms",
                baseline=first,
                baseline_value=1e3 * alone.cost,
            )
            yield Row(
                name=f"{name}, cores needed",
                value=strings * seen.cost / self.hop,
                unit="1",
                baseline="processes",
                baseline_value=float(self.processes),
            )
            yield Row(name=f"{name}, latency p99", value=1e3 * seen.latency, unit="ms")
            yield Row(name=f"{name}, windows skipped", value=100.0 * seen.skipped, unit="%")


if __name__ == "__main__":
    measure(Strings)
