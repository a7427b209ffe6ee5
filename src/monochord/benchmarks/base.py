"""The contract of a benchmark: frozen options that run and yield comparable rows."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

from monochord.core.ranges import Checked


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One figure of a benchmark.

    `unit` is "1" for a plain number. `baseline` and `baseline_value` are the name and value of the reference,
    measured in the same run or, for accuracy, a stated bound; `ratio` is value / baseline_value. They are
    None without a reference.
    """

    name: str
    value: float
    unit: str
    baseline: str | None = None
    baseline_value: float | None = None

    @property
    def ratio(self) -> float | None:
        """Value over baseline."""
        return self.value / self.baseline_value if self.baseline_value else None


def row(
    name: str, value: float, unit: str, baseline: str | None = None, compared: float | None = None
) -> Row:
    """Return a row from positional values, in reading order.

    >>> row("loop p99", 6.0, "ms", "bound", 3.0).ratio
    2.0
    """
    return Row(name=name, value=value, unit=unit, baseline=baseline, baseline_value=compared)


class Benchmark(Checked, ABC):
    """Options of a benchmark, as a frozen keyword-only dataclass."""

    @abstractmethod
    def run(self) -> Iterator[Row]:
        """Measure, and yield rows as they are ready."""
