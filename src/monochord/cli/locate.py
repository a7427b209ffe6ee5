"""Where a recorded string was touched, window by window."""

import dataclasses
import statistics
from collections import Counter
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from typing import Any

import click

from monochord.cli._options import calibrated, put, recording, refuse_short, string_options, window_options
from monochord.config import Tree
from monochord.live import Settings, run
from monochord.sinks.base import Moment, Sink, Writer
from monochord.types import Prediction, Signal


@click.command()
@click.argument("file")
@string_options
@window_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object a window.")
def locate(
    file: str,
    estimator: str | None,
    length: float | None,
    open_frequency: float | None,
    calibrate: tuple[tuple[str, float], ...],
    window: float | None,
    hop: float | None,
    as_json: bool,  # noqa: FBT001
) -> None:
    """Locate the touch in a recording: position in metres from the nut, for every window.

    \b
    monochord locate take.wav --length 0.65 --open-frequency 110 --json
    """  # noqa: D301
    tree: Tree = {"source": recording(file), "sinks": {"jsonl": {"everything": False}} if as_json else {}}
    put(tree, "estimator", name=estimator or "closed-form", length=length, open_frequency=open_frequency)
    put(tree, "window", length=window, hop=hop)
    tree = calibrated(tree, calibrate)
    table = _Table()
    session = Settings.read(tree).session()
    summary = run(session if as_json else dataclasses.replace(session, sinks=(table,)))
    refuse_short(file, session, summary)
    if not as_json:
        click.echo("\n".join([file, *table.lines()]))


class _Table(Sink, Writer):
    """Collects every prediction and says what they have in common."""

    def __init__(self) -> None:
        self._seen: list[Prediction] = []

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:  # noqa: ARG002
        yield self

    def write(self, moment: Moment) -> None:
        self._seen.append(moment.prediction)

    def lines(self) -> list[str]:
        positions = [p.estimates["position"] for p in self._seen]
        valid = sorted(e.value for e in positions if e.valid)
        share = f"{len(valid)} of {len(positions)} ({100 * len(valid) / len(positions):.1f} %)"
        reasons = Counter(e.why_not for e in positions if not e.valid)
        lines = [f"  windows with a position  {share}"]
        if valid:
            middle = statistics.median(valid)
            low, high = valid[len(valid) // 10], valid[-1 - len(valid) // 10]
            std = statistics.median(e.std for e in positions if e.valid)
            lines += [
                f"  position                 {1e3 * middle:.2f} mm from the nut (median)",
                f"  standard error           {1e3 * std:.2f} mm (median)",
                f"  middle four fifths       {1e3 * low:.2f} to {1e3 * high:.2f} mm",
                f"  frequency                {_median_frequency(self._seen):.3f} Hz (median)",
            ]
        return lines + [f"  no position              {n} windows: {why}" for why, n in reasons.most_common()]


def _median_frequency(predictions: Iterable[Prediction]) -> float:
    seen: list[Any] = [p.estimates["frequency"] for p in predictions]
    return statistics.median(e.value for e in seen if e.valid)
