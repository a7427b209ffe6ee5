"""The command `locate`: estimates where a recorded string was touched, window by window."""

import dataclasses
from array import array
from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import click
import numpy as np

from monochord.cli import INTERRUPTED
from monochord.cli._options import (
    calibrated,
    completes,
    model_and_input,
    put_estimator,
    recording,
    refuse_short,
    refuse_string_twice,
    sensor_option,
    set_option,
    string_options,
    window_options,
)
from monochord.cli._output import echo
from monochord.core.config import Tree, override
from monochord.core.errors import InputError
from monochord.live import LiveRun, run
from monochord.live.sinks.base import Listener, Run, Update, Writer
from monochord.perception.model.bundled import bundled_names

CONTACT = "contact"
"""The estimate that only the two-segment form provides."""


@click.command()
@click.argument("inputs", metavar="[MODEL] FILE", nargs=-1, required=True, **completes(bundled_names))
@sensor_option
@string_options
@window_options
@set_option("monochord list settings live")
@click.option("--allow-truncated", is_flag=True, help="Read a truncated file up to its end.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per window.")
def locate(inputs: tuple[str, ...], *, allow_truncated: bool, as_json: bool, **options: Any) -> int:
    """Estimate where the string is touched in a recording.

    FILE is a .wav, a .flac or a session's .mcap. MODEL is the folder of a trained model, or a bundled one
    such as demo; without it, a closed-form estimator is used. Positions are in metres from pickup 1; on a
    stopped string, as on a guitar, from the nut. Control-C prints the result so far and exits with status
    130.

    With --length and --open-frequency, position follows from pitch alone, so the sound must be of that
    string: another instrument in its range gets a position too. Two channels count as a sensor's two
    microphones if each carries a different segment, and as one recording if both carry the same note; a line
    of the output states which.

    \b
    monochord locate take.wav --length 0.65 --open-frequency 110
    monochord locate demo session.mcap --json
    """  # noqa: D301
    refuse_string_twice(options)
    model, file = model_and_input(inputs)
    if file is None:
        raise InputError(f"model {model} alone", "a FILE after it")
    source = {**recording(file), **({"allow_truncated": True} if allow_truncated else {})}
    tree: Tree = {"source": source, "sinks": {"jsonl": {"everything": False}} if as_json else {}}
    put_estimator(tree, options, model)
    tree = override(tree, options["assignments"])
    setup = LiveRun.read(calibrated(tree, options["calibrate"]))
    table = _Table(stopped=options["open_frequency"] is not None, by_pitch=model is None)
    summary = run(setup if as_json else dataclasses.replace(setup, sinks=(table,)))
    refuse_short(file, setup, summary)
    if not as_json:
        echo(file, *table.lines())
    return INTERRUPTED if summary.interrupted else 0


class _Table(Listener):
    """Collects 24 bytes per window, and summarises them as lines."""

    def __init__(self, *, stopped: bool, by_pitch: bool) -> None:
        self._origin = "the nut" if stopped else "pickup 1"
        self._positions, self._stds, self._frequencies = array("d"), array("d"), array("d")
        self._reasons: Counter[str] = Counter()
        self._stopped, self._by_pitch = stopped, by_pitch
        self._two_channels, self._one_note = False, 0

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        signal = run.signal
        self._two_channels = signal.channels == 2
        if signal.channels == 1:
            self._origin, self._stopped = "the nut", True
        yield self

    def write(self, update: Update) -> None:
        """Count one window."""
        position, frequency = (update.prediction.estimate(name) for name in ("position", "frequency"))
        if not position.valid:
            self._reasons[position.reason] += 1
            return
        self._one_note += CONTACT not in update.prediction.estimates
        self._positions.append(position.value)
        self._stds.append(position.std)
        self._frequencies.append(frequency.value)

    def lines(self) -> list[str]:
        """Return the medians as lines of text."""
        valid, total = len(self._positions), len(self._positions) + self._reasons.total()
        lines = [f"  windows with a position  {valid} of {total} ({100 * valid / max(total, 1):.1f} %)"]
        if valid:
            low, high = np.quantile(self._positions, [0.1, 0.9])
            median = 1e3 * np.median(self._positions)
            lines += [
                f"  position                 {median:.2f} mm from {self._origin} (median)",
                f"  standard error           {1e3 * np.median(self._stds):.2f} mm (median)",
                f"  middle four fifths       {1e3 * low:.2f} to {1e3 * high:.2f} mm",
            ]
        if np.isfinite(self._frequencies).any():
            lines.append(f"  frequency                {np.nanmedian(self._frequencies):.3f} Hz (median)")
        if valid and self._stopped and self._by_pitch:
            lines += self._assumptions(valid)
        reasons = self._reasons.most_common()
        return lines + [f"  no position              {count} windows: {why}" for why, count in reasons]

    def _assumptions(self, valid: int) -> list[str]:
        """Return the assumptions behind positions on a stopped string."""
        lines = ["  assumes                  the sound is this string's: position follows from its pitch"]
        if self._two_channels:
            split = (
                f"one note in {self._one_note}, two segments in {valid - self._one_note} of {valid} windows"
            )
            lines.insert(0, f"  both channels carry      {split}")
        return lines
