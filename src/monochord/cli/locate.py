"""Where a recorded string was touched, window by window."""

import dataclasses
from array import array
from collections import Counter

import click
import numpy as np

from monochord.cli import INTERRUPTED
from monochord.cli._options import (
    USUAL_ESTIMATOR,
    calibrated,
    put,
    recording,
    refuse_short,
    refuse_string_twice,
    string_options,
    window_options,
)
from monochord.cli._output import echo
from monochord.core.config import Tree
from monochord.live import Settings, run
from monochord.live.sinks.base import Listener, Moment


@click.command()
@click.argument("file")
@string_options
@window_options
@click.option("--allow-truncated", is_flag=True, help="Read what is there of a file that was cut short.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object a window.")
def locate(
    file: str,
    estimator: str | None,
    length: float | None,
    open_frequency: float | None,
    string: str | None,
    calibrate: tuple[tuple[str, float], ...],
    window: float | None,
    hop: float | None,
    allow_truncated: bool,  # noqa: FBT001
    as_json: bool,  # noqa: FBT001
) -> int:
    """Locate the touch in a recording: position in metres from the nut, for every window.

    Control-C ends it with what it has so far, and with status 130.

    \b
    monochord locate take.wav --length 0.65 --open-frequency 110 --json
    monochord locate two_microphones.wav --string prototype
    monochord locate session.mcap
    """  # noqa: D301
    source = {**recording(file), **({"allow_truncated": True} if allow_truncated else {})}
    tree: Tree = {"source": source, "sinks": {"jsonl": {"everything": False}} if as_json else {}}
    refuse_string_twice(string, length, open_frequency)
    put(tree, "estimator", name=estimator or USUAL_ESTIMATOR, length=length, open_frequency=open_frequency)
    put(tree, "window", length=window, hop=hop)
    tree = calibrated({**tree, "string": string or ""}, calibrate)
    table = _Table()
    session = Settings.read(tree).session()
    summary = run(session if as_json else dataclasses.replace(session, sinks=(table,)))
    refuse_short(file, session, summary)
    if not as_json:
        echo(file, *table.lines())
    return INTERRUPTED if summary.interrupted else 0


class _Table(Listener):
    """Keeps what a summary needs, 24 bytes a window, and says what the windows have in common."""

    def __init__(self) -> None:
        self._positions, self._stds, self._frequencies = array("d"), array("d"), array("d")
        self._reasons: Counter[str] = Counter()

    def write(self, moment: Moment) -> None:
        position, frequency = (moment.prediction.estimate(name) for name in ("position", "frequency"))
        if not position.valid:
            self._reasons[position.why_not] += 1
            return
        self._positions.append(position.value)
        self._stds.append(position.std)
        self._frequencies.append(frequency.value)

    def lines(self) -> list[str]:
        valid, total = len(self._positions), len(self._positions) + self._reasons.total()
        lines = [f"  windows with a position  {valid} of {total} ({100 * valid / max(total, 1):.1f} %)"]
        if valid:
            low, high = np.quantile(self._positions, [0.1, 0.9])
            lines += [
                f"  position                 {1e3 * np.median(self._positions):.2f} mm from the nut (median)",
                f"  standard error           {1e3 * np.median(self._stds):.2f} mm (median)",
                f"  middle four fifths       {1e3 * low:.2f} to {1e3 * high:.2f} mm",
                f"  frequency                {np.median(self._frequencies):.3f} Hz (median)",
            ]
        reasons = self._reasons.most_common()
        return lines + [f"  no position              {count} windows: {why}" for why, count in reasons]
