"""The cost of a string, by the number of strings that one or two processes serve.

Makes `docs/figures/strings.png` in some four minutes on two cores:
``python -m studies.strings_cost --out docs/figures/strings.png``.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from itertools import cycle
from typing import TYPE_CHECKING, Any

from studies._command import draw
from studies._strings import StringsCost, refuse_options, strings_cost

from monochord.core.units import Seconds
from monochord.figures import style
from monochord.figures.base import Measured, require_matplotlib

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas


@dataclass(frozen=True, slots=True, kw_only=True)
class Strings(Measured):
    """Processor time of an estimate, and estimates per second of each string, by number of strings.

    Measured on this machine while drawing, as by `strings_speed`: leave the machine idle meanwhile.

    Parameters
    ----------
    strings
        Numbers of strings.
    seconds
        Duration of the sound, and of the run, for each.
    hop
        Hop in seconds.
    model
        Folder or name of the model.
    processes
        Numbers of processes that share the strings, one curve each.
    """

    strings: tuple[int, ...] = (1, 2, 4, 8, 16, 32)
    seconds: Seconds = 5.0
    hop: Seconds = 0.01
    model: str = "demo"
    processes: tuple[int, ...] = (1, 2)

    def __post_init__(self) -> None:
        for processes in self.processes:
            refuse_options(self.strings, self.seconds, processes)

    def numbers(self) -> dict[str, Any]:
        """Return rate (1/s), cost (s), latency (s) and share of skipped windows for each number of both."""
        runs = [{"processes": processes, **asdict(seen)} for processes, seen in _measured(self)]
        return {"hop": self.hop, "model": self.model, "simulated": True, "runs": runs}

    def draw(self) -> Canvas:
        """Measure, and draw cost and rate side by side."""
        require_matplotlib()
        every: list[dict[str, Any]] = self.numbers()["runs"]
        figure = style.canvas(65.0)
        left, right = figure.subplots(1, 2)
        for processes, colour in zip(self.processes, cycle(style.SEGMENTS), strict=False):
            runs = [run for run in every if run["processes"] == processes]
            counts = [run["strings"] for run in runs]
            name = "one process" if processes == 1 else f"{processes} processes"
            left.plot(
                counts, [1e3 * run["cost"] for run in runs], "o-", color=colour, markersize=4, label=name
            )
            right.plot(counts, [run["rate"] for run in runs], "o-", color=colour, markersize=4)
        left.set_ylim(bottom=0.0)
        left.legend(fontsize=style.TICK, frameon=False, loc="lower right", labelcolor=style.INK)
        right.axhline(1.0 / self.hop, color=style.PALE, linestyle=style.THEORY, linewidth=0.8)
        right.set_ylim(bottom=0.0)
        counts = sorted({run["strings"] for run in every})
        for axes in (left, right):
            axes.set_xscale("log", base=2)
            axes.set_xticks(counts, [str(count) for count in counts])
        style.dress(left, "A", "processor time of an estimate", "strings", "ms")
        style.dress(right, "B", "estimates of each string (dashed: asked for)", "strings", "1/s")
        return figure


@cache
def _measured(figure: Strings) -> list[tuple[int, StringsCost]]:
    """Return the number of processes and the measurements, cached so that numbers match the figure."""
    return [
        (
            processes,
            strings_cost(
                count, seconds=figure.seconds, hop=figure.hop, model=figure.model, processes=processes
            ),
        )
        for processes in figure.processes
        for count in figure.strings
        if count >= processes
    ]


if __name__ == "__main__":
    draw(Strings)
