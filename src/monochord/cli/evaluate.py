"""The verb `evaluate`: test sessions through an estimator, and what it is worth."""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from monochord.cli._bar import bar_of_sessions
from monochord.cli._drawings import drawings
from monochord.cli._kept_rows import keep
from monochord.cli._options import refuse_without
from monochord.cli._output import echo
from monochord.cli._scorecard_lines import lines
from monochord.cli.build import SPLIT_FILE
from monochord.core.config import Tree, load_toml, override
from monochord.core.errors import InputError
from monochord.core.ownership import scratch_folder
from monochord.core.types import StringParams
from monochord.core.units import Newtons
from monochord.datasets.build import Options, build_dataset, find_sessions
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation.harness import (
    Trained,
    audited,
    noise,
    refuse_trained_on,
    refuse_unwritable,
    room_recordings,
    suite,
    wants_recordings,
    write_folder,
)
from monochord.evaluation.harness import evaluate as evaluated
from monochord.evaluation.limits import force_floor
from monochord.evaluation.paper_rows import labelled, paper_rows
from monochord.evaluation.replay import Course
from monochord.evaluation.scorecard import scorecard
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import load
from monochord.perception.model.definition import Definition
from monochord.physics.sensors import load_sensor
from monochord.sessions import read_session

CONFIG = "config.toml"
"""Settings of a run, in its folder."""
LEARNED, PHYSICS = "model", "closed_form"
PARTS = ("test", "validation")
RANDOM = "random"
"""What the columns of a feature with random weights begin with."""


@click.command()
@click.argument("run", required=False, type=click.Path(path_type=Path))
@click.option("--dataset", type=click.Path(path_type=Path), metavar="DIR", help="[default: that of RUN]")
@click.option(
    "--split", type=click.Path(path_type=Path), metavar="FILE", help="[default: that of RUN, or of DIR]"
)
@click.option("--part", type=click.Choice(PARTS), default="test", show_default=True, help="Of the split.")
@click.option("--sessions", multiple=True, metavar="FILES", help="Sessions to test on instead; repeatable.")
@click.option("--estimator", metavar="NAME", help=f"Who is tested, without RUN.  [default: {PHYSICS}]")
@click.option("--set", "assignments", multiple=True, metavar="A=B", help="An option of the estimator.")
@click.option("--sensor", metavar="PRESET", help="Whose string the estimator is told.")
@click.option("--noise", "noises", multiple=True, metavar="KIND:DB", help="Once more with noise; repeatable.")
@click.option("--suite", "all_noises", is_flag=True, help="Every kind of noise, at 0 to 25 dB.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the noise.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Write results and a page there.")
@click.option(
    "--rows", type=click.Path(path_type=Path), metavar="FILE", help="Keep the paper's rows in FILE."
)
@click.option("--feature", metavar="NAME", help="What the rows are called.  [default: the feature]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def evaluate(run: Path | None, **options: Any) -> None:
    """Test what RUN learned, or an estimator of NAME, on sessions that it has not heard.

    Every test session is played window by window, as live. A split that leaks is refused, and so is a session
    that RUN was trained on. RUN is a folder that monochord train made.

    \b
    monochord evaluate run --out report --noise music:10
    monochord evaluate run --sessions monday/*.mcap
    monochord evaluate --estimator closed_form --dataset dataset --sensor prototype --suite
    """  # noqa: D301
    _refuse_unused(run, options)
    with ExitStack() as stack:
        told = _Told.of(run)
        course, split, floors, notes = _course(stack, told, options)
        estimator, name = _estimator(run, options)
        if options["out"] is not None:
            refuse_unwritable(options["out"])
        if told.definition is not None and not (split and options["part"] != PARTS[0]):
            trained = Trained(sessions=told.definition.sessions, dataset=told.definition.dataset)
            notes += refuse_trained_on(course, trained, split)
        rate = course.dataset.manifest.sample_rate
        recorded = options["all_noises"] or wants_recordings(options["noises"])
        recordings = room_recordings(rate, _music()) if recorded else {}
        chosen = [noise(text, recordings, options["seed"]) for text in options["noises"]]
        chosen += suite(recordings, seed=options["seed"]) if options["all_noises"] else ()
        progress = stack.enter_context(bar_of_sessions())
        notes += told.notes
        results = evaluated(course, estimator, name=name, noises=chosen, notes=notes, progress=progress)
        results = replace(results, options={**results.options, **told.about})
        card = scorecard(results, string=course.string, force_floor=floors)
        if options["out"] is not None:
            write_folder(options["out"], results, card, lambda file: drawings(file, results))
    if options["rows"] is not None:
        feature = options["feature"] or (told.definition.feature.name if told.definition else name)
        rows = paper_rows(card, labelled(feature, drawn=told.is_drawn), options["part"])
        keep(options["rows"], rows)
    echo(*([json.dumps(card.tree(), allow_nan=False)] if options["as_json"] else lines(card)))


def _refuse_unused(run: Path | None, options: dict[str, Any]) -> None:
    if run is not None and options["estimator"] is not None:
        raise InputError(f"run {run} beside --estimator {options['estimator']}", "one of both")
    if options["sessions"]:
        refuse_without("--split or --part beside --sessions", "all of the sessions", "split", "part")
    if options["rows"] is None:
        refuse_without("--feature without --rows", "beside --rows, whose name it is", "feature")
    if not (options["noises"] or options["all_noises"]):
        refuse_without("--seed without noise", "beside --noise or --suite, whose it is", "seed")


class _Told:
    """What a run's folder tells, or nothing without one."""

    def __init__(self, definition: Definition | None, config: Tree) -> None:
        self.definition, self.config = definition, config

    @classmethod
    def of(cls, run: Path | None) -> "_Told":
        if run is None:
            return cls(None, {})
        config = load_toml(run / CONFIG) if (run / CONFIG).is_file() else {}
        return cls(load(run).definition, config)

    @property
    def about(self) -> Tree:
        """What a model was made of, for who reads the results."""
        told = self.definition
        if told is None:
            return {}
        return {
            "feature": {"name": told.feature.name, **told.feature.options},
            "reference": told.reference.feature.name if told.reference else "",
            "heads": list(told.heads),
            "weights": told.weights,
            "trained_on_sessions": len(told.sessions),
        }

    @property
    def notes(self) -> tuple[str, ...]:
        """What of a model has to be known before its scores are."""
        if self.definition is None:
            return ()
        name = self.definition.feature.name
        line = f"the weights of the feature {name} are random, nothing was learned there"
        return (line,) if self.is_drawn else ()

    @property
    def is_drawn(self) -> bool:
        """Whether the feature's weights are random."""
        told = self.definition
        return told is not None and any(column.startswith(RANDOM) for column in told.feature.columns)

    def path(self, name: str) -> Path | None:
        """Return a path that the settings of the run name."""
        return Path(self.config[name]) if self.config.get(name) else None


def _estimator(run: Path | None, options: dict[str, Any]) -> tuple[Estimator, str]:
    table: Tree = {} if run is None else {"path": str(run)}
    name = (LEARNED if run is not None else options["estimator"] or PHYSICS).replace("-", "_")
    return ESTIMATORS.build(name, override(table, options["assignments"])), name


def _course(
    stack: ExitStack, told: _Told, options: dict[str, Any]
) -> tuple[Course, Split | None, dict[str, Newtons], tuple[str, ...]]:
    """Return what is played, its split, the floors of its force sensors, and what has to be noted."""
    string = load_sensor(options["sensor"]).string if options["sensor"] else None
    if string is None and told.definition is not None:
        string = told.definition.string
    if options["sessions"]:
        if options["dataset"] is not None:
            raise InputError("--sessions beside --dataset", "one of both")
        dataset, floors, own = _of_sessions(stack, options["sessions"], told)
        return Course(dataset=dataset, rows=np.arange(len(dataset)), string=string or own), None, floors, ()
    folder = options["dataset"] or told.path("dataset")
    if folder is None:
        raise InputError("no sessions to test on", "--dataset DIR or --sessions FILES", "name some")
    dataset = open_dataset(folder)
    own_split = told.path("split") if options["dataset"] is None else None
    split = Split.read(options["split"] or own_split or folder / SPLIT_FILE)
    notes = audited(dataset, split, learned=told.definition is not None)
    if options["part"] != PARTS[0]:
        notes += (f"the {options['part']} part, by which choices were made, and no test",)
    return Course(dataset=dataset, rows=split.parts[options["part"]], string=string), split, {}, notes


def _of_sessions(
    stack: ExitStack, names: Sequence[str], told: _Told
) -> tuple[Dataset, dict[str, Newtons], StringParams | None]:
    """Return the dataset of sessions, the floors of their force sensors, and the string that they tell."""
    files = find_sessions(names)
    window = 0.1 if told.definition is None else told.definition.window / told.definition.sample_rate
    hop = 0.1 if told.definition is None else told.definition.hop / told.definition.sample_rate
    folder = stack.enter_context(scratch_folder()) / "dataset"
    with bar_of_sessions() as progress:
        dataset = build_dataset(files, folder, Options(window=window, hop=hop), progress)
    floors: dict[str, Newtons] = {}
    strings: list[StringParams | None] = []
    for path in files:
        session = read_session(path)
        strings.append(session.description.string)
        floor = force_floor(session, window)
        if floor is not None:
            floors[path.stem] = floor
    alike = all(string == strings[0] for string in strings)
    return dataset, floors, strings[0] if alike else None


def _music() -> Any:
    """Return synthetic music, for where there is no recording of any."""
    from monochord.lab.music import loop  # noqa: PLC0415

    return loop(0)
