"""The command `simulate`: the sound of a known string under a touch."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import completes, refuse_unwritable, set_option
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.core.errors import InputError
from monochord.core.files import refuse_existing, replacing, sound_written
from monochord.physics.sensors import sensor_names
from monochord.physics.simulate import simulate as simulated
from monochord.physics.simulators import SIMULATORS, Sound
from monochord.physics.strings import string_names

SUBTYPES = {".wav": "FLOAT", ".flac": "PCM_24"}


@click.command()
@click.argument("preset", **completes(string_names, sensor_names))
@click.option(
    "--model",
    default="split_string",
    show_default=True,
    metavar="NAME",
    help="Simulator, from 'monochord list simulators'.",
    **completes(SIMULATORS.names),
)
@options_of(simulated, "position", flags=("--at",))
@options_of(simulated, "force")
@click.option("--untouched", is_flag=True, help="Do not touch the string.")
@options_of(simulated, "seconds")
@click.option(
    "--route", metavar="NAME", help="Numerical method, if the simulator has several: fdtd, modal, reference."
)
@click.option("--out", type=click.Path(path_type=Path), help="Write the sound to a .wav or .flac file.")
@set_option("monochord list settings simulate")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def simulate(
    preset: str,
    *,
    model: str,
    position: float | None,
    force: float | None,
    untouched: bool,
    seconds: float,
    route: str | None,
    out: Path | None,
    assignments: tuple[str, ...],
    as_json: bool,
) -> None:
    """Simulate a touched string and compare its peaks with theory.

    PRESET is a string of 'monochord list strings', or a sensor for the model twin.

    \b
    monochord simulate appendix --at 0.2275
    monochord simulate appendix --untouched --out open.wav --json
    """  # noqa: D301
    if out is not None:
        refuse_unwritable(out, SUBTYPES)
        refuse_existing(out)
    if untouched and not (position is None and force is None):
        raise InputError("--untouched with --at or --force", "only one of them")
    sound = simulated(
        preset,
        position=position,
        force=force,
        touched=not untouched,
        seconds=seconds,
        simulator=model,
        settings=assignments,
        **({} if route is None else {"route": route}),
    )
    result: dict[str, Any] = {
        "preset": preset,
        "model": model,
        **sound.summary,
        "seconds": sound.microphones.shape[1] / sound.sample_rate,
        "sample_rate": sound.sample_rate,
    }
    if out is not None:
        result |= {"out": str(out), "gain": _write(out, sound)}
    echo(*([json.dumps(result)] if as_json else _lines(result)))


def _write(path: Path, sound: Sound) -> float:
    """Write both microphones and return the gain, which is 1 unless they would clip."""
    import soundfile  # noqa: PLC0415  (loads its library on use)

    gain = 1.0 / max(1.0, float(abs(sound.microphones).max()) / 0.99)
    suffix = path.suffix.lower()
    with sound_written(path), replacing(path) as part:
        soundfile.write(part, gain * sound.microphones.T, sound.sample_rate, subtype=SUBTYPES[suffix])
    return gain


def _lines(result: dict[str, Any]) -> list[str]:
    touch = "untouched"
    if result["position"] is not None:
        touch = f"touched at {1e3 * result['position']:.1f} mm with {result['force']:g} N"
    lines = [f"{result['preset']}, {touch} ({result['model']}, {result['seconds']:g} s, simulated)"]
    for side, (peak, expected) in enumerate(zip(result["peaks"], result["theory"], strict=True), start=1):
        measured = "silent" if peak is None else f"{peak:.2f} Hz"
        lines.append(f"  peak {side}   {measured:>12}   theory {expected:.2f} Hz")
    if "settled" in result:
        lines.append(f"  {_labels(result)}")
    if "out" in result:
        quieter = "" if result["gain"] == 1.0 else f", scaled by {result['gain']:.3g} to avoid clipping"
        lines.append(f"  written to {result['out']}{quieter}")
    return lines


def _labels(result: dict[str, Any]) -> str:
    """Return the labels after the transient, for a simulator with labels."""
    calm = "settled" if result["settled"] else "not settled"
    if result["felt"] is None:
        return calm
    shares = f"in contact {result['contact']:.0%} of the time, sliding {result['slip']:.0%}"
    return f"{calm}; felt {result['felt']:.3g} N, {shares}"
