"""The command `locate`: estimates where a recorded string was touched, window by window."""

import dataclasses
from typing import Any

import click

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
from monochord.live.positions import PositionTable
from monochord.perception.model.bundled import bundled_names


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
    string: another instrument in its range gets a position too. A light touch at 1/n of the string sounds the
    note of a stop at 1 - 1/n, and is stated there; a line of the output names both. Two channels count as a
    sensor's two microphones if each carries a different segment, and as one recording if both carry the same
    note; a line of the output states which.

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
    table = PositionTable(stopped=options["open_frequency"] is not None, by_pitch=model is None)
    summary = run(setup if as_json else dataclasses.replace(setup, sinks=(table,)))
    refuse_short(file, setup, summary)
    if not as_json:
        echo(file, *table.lines())
    return INTERRUPTED if summary.interrupted else 0
