"""Estimates from a running source, as they come."""

import dataclasses
from collections.abc import Generator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import click

from monochord.capture.sources import SOURCES
from monochord.cli._options import (
    USUAL_ESTIMATOR,
    amount,
    calibrated,
    first_field,
    put,
    refuse_short,
    refuse_string_twice,
    string_options,
    window_options,
)
from monochord.cli._output import echo
from monochord.core.compilation import compilation_shown
from monochord.core.config import Tree, dump_toml, load_toml, override, table
from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.live import Settings, run
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Listener, Moment, Sink, Writer
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.model import folder_of, load

LINES = "jsonl"  # the sink that --json stands for
LEARNED = "model"  # the estimator that RUN stands for


@click.command()
@click.argument("inputs", metavar="[RUN] [INPUT]", nargs=-1)
@click.option("--source", metavar="NAME", help="Where audio comes from.  [default: jack]")
@string_options
@window_options
@click.option(
    "--sink", "sinks", multiple=True, metavar="NAME[=WHERE]", help="[default: terminal]; repeatable."
)
@click.option("--seconds", type=amount, metavar="S", help="How much of the stream to look at.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a window on standard output.")
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="Settings from a TOML file.")
@click.option("--set", "assignments", multiple=True, metavar="A.B=C", help="Any setting; the last word.")
@click.option("--save-config", type=click.Path(path_type=Path), metavar="FILE", help="Save all settings.")
def live(inputs: tuple[str, ...], **options: Any) -> None:
    """Show where a sounding string is touched, live.

    INPUT is what the source opens: ports, a device, a file. RUN is a folder that monochord train made, or
    demo, which comes along: what was learned there estimates. Settings come from --config, then from the
    options, then from --set. Control-C or SIGTERM ends the run with its summary.

    \b
    monochord live --source jack --length 0.65 --open-frequency 110
    monochord live take.wav --source wav --length 0.65 --open-frequency 110 --json
    monochord live run session.mcap --source session
    monochord live demo --source twin
    """  # noqa: D301
    refuse_string_twice(options["string"], options["length"], options["open_frequency"])
    learned, opened = _told_apart(inputs)
    if learned is not None and options["estimator"]:
        raise InputError(f"run {learned} beside --estimator {options['estimator']}", "one of both")
    tree = _tree(opened, options, learned)
    tree = calibrated(override(tree, options["assignments"]), options["calibrate"])
    settings = Settings.read(tree)
    session = settings.session()
    saving: tuple[Sink, ...] = ()
    if options["save_config"]:
        saving = (_SavedSettings(options["save_config"], dump_toml(settings.resolved())),)
    with nullcontext() if options["as_json"] else compilation_shown():
        summary = run(dataclasses.replace(session, sinks=(*saving, *session.sinks)))
    refuse_short(opened or settings.source["name"], session, summary)
    # Standard output may carry data, of which the summary is no part.
    echo(*summary.lines(), err=options["as_json"])


def _told_apart(inputs: tuple[str, ...]) -> tuple[str | None, str | None]:
    """Return the folder of a model, and what the source opens, as far as they are given."""
    learned = [text for text in inputs if folder_of(Path(text))]
    opened = [text for text in inputs if text not in learned]
    if len(inputs) == 2 and not learned:
        load(inputs[0])  # says why it is no RUN
    if len(learned) > 1 or len(opened) > 1:
        given, remedy = f"inputs {', '.join(inputs)}", "a RUN is what monochord train made, or demo"
        raise InputError(given, "one RUN at most, and one INPUT at most", remedy)
    return next(iter(learned), None), next(iter(opened), None)


def _tree(opened: str | None, options: dict[str, Any], learned: str | None = None) -> Tree:
    tree: Tree = load_toml(options["config"]) if options["config"] else {}
    before = table(tree, "source")
    name = options["source"] or before.get("name", "jack")
    # Another source than the file's does not take over the options of the file's.
    tree["source"] = {**(before if before.get("name") == name else {}), "name": name}
    if opened is not None:
        put(tree, "source", **{first_field(SOURCES, name): opened})
    if learned is not None:
        tree["estimator"] = {"name": LEARNED, first_field(ESTIMATORS, LEARNED): learned}
    put(tree, "estimator", **{key: options[key] for key in ("length", "open_frequency")})
    named = table(tree, "estimator").get("name", USUAL_ESTIMATOR)
    put(tree, "estimator", name=options["estimator"] or named)
    put(tree, "window", length=options["window"], hop=options["hop"])
    given = {key: options[key] for key in ("string", "seconds") if options[key] is not None}
    configured = table(tree, "sinks") if "sinks" in tree else None
    return {**tree, **given, "sinks": _sinks(configured, options["sinks"], options["as_json"])}


def _sinks(configured: Tree | None, asked: tuple[str, ...], as_json: bool) -> Tree:  # noqa: FBT001
    """Return the sink tables: those asked for, else those of the configuration, else the terminal."""
    known, sinks = configured or {}, Tree()
    for text in asked:
        kind, equals, where = text.partition("=")
        if kind in sinks:  # whatever two of a kind write would run together
            raise InputError(f"--sink {kind} twice", "one of each kind")
        sinks[kind] = {**table(known, kind), **({first_field(SINKS, kind): where} if equals else {})}
    if as_json and sinks.get(LINES):
        raise InputError(f"--json beside --sink {LINES}", "one of both", "both write the same lines")
    if as_json:
        # Standard output is for the lines, so whatever can draws on standard error.
        for name, options in sinks.items():
            if "stderr" in {f.name for f in dataclasses.fields(SINKS.load(name))}:  # pyright: ignore[reportArgumentType]
                options.setdefault("stderr", True)
        sinks[LINES] = {**table(known, LINES), first_field(SINKS, LINES): "-"}
    if sinks or configured is not None:
        return sinks or known
    return {"terminal": {}}


class _SavedSettings(Listener):
    """Writes the settings into a file once the source is open and the estimator takes its signal."""

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._text = path, text

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:  # noqa: ARG002
        try:
            self._path.write_text(self._text, encoding="utf-8")
        except OSError as error:
            given = f"file {self._path} ({error.strerror})"
            raise InputError(given, "a path that can be written") from error
        yield self

    def write(self, moment: Moment) -> None:
        """Take nothing."""
