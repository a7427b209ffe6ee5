"""The command `locate`: estimates where a recorded string was touched, window by window."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli import INTERRUPTED
from monochord.cli._options import (
    STRING_OPTIONS,
    completes,
    model_and_input,
    refuse_unwritable,
    sensor_option,
    set_option,
    string_options,
    truncated_option,
    window_options,
)
from monochord.cli._output import echo
from monochord.cli.figure import SUFFIXES
from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.figures.base import require_matplotlib
from monochord.front.locate import locate as located
from monochord.front.locate_figure import draw
from monochord.perception.model.bundled import bundled_names


@click.command()
@click.argument("inputs", metavar="[MODEL] FILE", nargs=-1, required=True, **completes(bundled_names))
@sensor_option
@string_options
@window_options
@set_option("monochord list settings live")
@click.option("--frets", is_flag=True, help="Name the notes of a stopped string, with their frets.")
@click.option(
    "--figure",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Draw the places over time: .png, .pdf or .svg; with --frets, lines at the frets.",
)
@truncated_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per window.")
def locate(
    inputs: tuple[str, ...],
    *,
    allow_truncated: bool,
    frets: bool,
    figure: Path | None,
    as_json: bool,
    **options: Any,
) -> int:
    """Estimate where the string is touched in a recording.

    FILE is sound that libsndfile reads (wav, flac, mp3, ogg, aiff and others), or a session's .mcap. MODEL is
    the folder of a trained model, or a bundled one such as demo; without it, a closed-form estimator is used.
    Positions are in metres from pickup 1; on a stopped string, as on a guitar, from the nut. Control-C prints
    the result so far and exits with status 130.

    With --length and --open, position follows from pitch alone, so the sound must be of that string, pressed
    down, one note at a time: another instrument in its range gets a position too, and a bent string reads as
    another place. A light touch at 1/n of the string (a natural harmonic) sounds the note of a stop at
    1 - 1/n, and is stated there; a line of the output names both. Two channels count as a sensor's two
    microphones if each carries a different segment, and as one recording if both carry the same note; a line
    of the output states which.

    \b
    monochord locate take.wav --length 0.65 --open A2 --frets --figure take.png
    monochord locate demo session.mcap --json
    """  # noqa: D301
    model, file = model_and_input(inputs)
    if file is None:
        raise InputError(f"model {model} alone", "a FILE after it")
    if frets and model is not None:
        raise InputError(f"--frets with model {model}", "a stopped string: --length and --open")
    if figure is not None:
        refuse_unwritable(figure, SUFFIXES)
        require_matplotlib()
    given: dict[str, Any] = {name: options[name] for name in STRING_OPTIONS}
    if allow_truncated:
        given["allow_truncated"] = True
    places = located(
        Path(file),
        model,
        open=given.pop("open_frequency"),
        calibrate=options["calibrate"],
        settings=options["assignments"],
        each=(lambda place: echo(json.dumps(place.tree(frets=frets)))) if as_json else None,
        **given,
    )
    if figure is not None:
        with replacing(figure) as part:
            draw(places, frets=frets).savefig(part)
    if not as_json:
        drawn = [] if figure is None else [f"written to {figure}"]
        echo(file, *places.lines(frets=frets), *drawn)
    return INTERRUPTED if places.interrupted else 0
