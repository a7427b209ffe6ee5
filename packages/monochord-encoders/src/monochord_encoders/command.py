"""The command `weights`: downloads and verifies pretrained networks."""

import json
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from monochord.cli import echo
from monochord.core.errors import InputError
from monochord_encoders.weights import checked_sum, find_weights, load_known, weight_names
from monochord_encoders.weights.fetch import describe, fetch

DIR, FILE = click.Path(path_type=Path, file_okay=False), click.Path(path_type=Path)
SUFFIX = ".onnx"
json_object = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


def _names(context: click.Context, parameter: click.Parameter, word: str) -> list[CompletionItem]:  # noqa: ARG001
    return [CompletionItem(name) for name in weight_names() if name.startswith(word)]


@click.group()
def weights() -> None:
    """Download, check and export pretrained encoder weights.

    The encoder of the feature ast is the Audio Spectrogram Transformer.

    \b
    monochord weights get ast
    monochord weights check ast
    """  # noqa: D301


@weights.command()
@click.argument("name", shell_complete=_names)
@click.option(
    "--folder", type=DIR, metavar="DIR", help="Folder to save to.  [default: the user's data folder]"
)
@click.option(
    "--sha256",
    default="",
    metavar="SUM",
    help="Expected checksum.  [default: the published one]",
)
@json_object
def get(name: str, *, folder: Path | None, sha256: str, as_json: bool) -> None:
    """Download pretrained weights and verify their checksum.

    NAME is a network whose weights are published: ast.

    \b
    monochord weights get ast
    monochord weights get ast --folder weights
    """  # noqa: D301
    known = load_known(name)
    known = replace(known, sha256=sha256 or known.sha256)
    path = known.usual_path if folder is None else folder / known.file
    with click.progressbar(length=1000, label=known.file, file=sys.stderr, show_pos=False) as bar:
        digest = fetch(known, path, lambda done, due: bar.update(1000 * done // due - bar.pos if due else 0))
    _print(path, digest, describe(known, path), as_json=as_json)


@weights.command()
@click.argument("name", shell_complete=_names)
@click.option("--path", type=click.Path(), default="", metavar="PATH", help="Weights file, or its folder.")
@json_object
def check(name: str, *, path: str, as_json: bool) -> None:
    """Show the path and checksum of a weights file, and verify it.

    \b
    monochord weights check ast
    monochord weights check ast --path weights
    """  # noqa: D301
    known = load_known(name)
    file = find_weights(known, path)
    _print(file, checked_sum(known, file), describe(known, file), as_json=as_json)


@weights.command()
@click.argument("name", shell_complete=_names)
@click.option("--path", type=click.Path(), default="", metavar="PATH", help="Weights file, or its folder.")
@click.option("--out", type=FILE, required=True, metavar="FILE.onnx", help="File to write.")
@click.option(
    "--frames", type=click.IntRange(min=1), default=100, show_default=True, help="Frames per spectrogram."
)
@click.option("--int8", is_flag=True, help="Quantise the matrix products to 8 bits.")
@json_object
def export(name: str, *, path: str, out: Path, frames: int, int8: bool, as_json: bool) -> None:
    """Export a pretrained network as an ONNX file, for other programs.

    \b
    monochord weights export ast --out ast.onnx
    monochord weights export ast --out ast.onnx --int8
    """  # noqa: D301
    known = load_known(name)
    if not known.exporter:
        allowed = ", ".join(other for other in weight_names() if load_known(other).exporter)
        raise InputError(f"weights '{name}' as an ONNX file", allowed)
    if out.suffix.lower() != SUFFIX:
        raise InputError(f"file '{out}'", f"a name that ends in {SUFFIX}")
    if not out.parent.is_dir():
        raise InputError(f"file '{out}'", "a file in an existing folder", f"create '{out.parent}' first")
    file = find_weights(known, path)
    import_module(known.exporter).export(str(file), out, frames=frames, int8=int8)
    _print(out, checked_sum(known, file), f"{known.title}, {'int8' if int8 else 'float32'}", as_json=as_json)


def _print(path: Path, digest: str, what: str, *, as_json: bool) -> None:
    result = {"path": str(path), "sha256": digest, "bytes": path.stat().st_size, "holds": what}
    lines = [f"{path}: {what}", f"SHA-256 {digest}, {result['bytes']} bytes"]
    echo(*([json.dumps(result)] if as_json else lines))
