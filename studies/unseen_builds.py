"""Accuracy of a model on builds outside its training, by number of known touches.

Makes the rows of `docs/results/builds.json` from sessions of a sealed plan, such as those that
``monochord collect studies/plans/sealed_8.toml`` renders, in some 40 minutes on two cores:
``python -m studies.unseen_builds MODEL --sessions FILES --rows FILE``.

The model is adapted to the first touches of each session, or of all sessions of a build, and scored on the
later touches. It is compared with ridge regression on the same feature, fitted to the same training windows
and corrected by the same touches, and with ridge regression fitted to these touches only. For a string far
from its nominal tuning, all of them use the tension estimated from its untouched sound.
"""

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import click
import numpy as np
from studies._command import lines_of, main, progress_bar
from studies._rows import EXPLAINED, HEADS, INTERVALS, SummaryRow, cells, keep_summary, summary_row

from monochord.core.errors import InputError
from monochord.core.types import Flags
from monochord.datasets import MEASURED, BuildOptions, Dataset, Labelling, build_dataset, find_sessions
from monochord.evaluation import (
    EVERYTHING,
    RIDGE,
    Baselines,
    EvaluatedEstimator,
    EvaluationSettings,
    Results,
    Selection,
    features_of,
    fit_baselines,
    join,
    load,
    refuse_trained_on,
    regression_rows,
    replay_estimators,
    training_of,
)
from monochord.figures import COLOURS, style
from monochord.lab import run_all
from monochord.metrics import normal_coverage
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import Model
from monochord.perception.model import load as load_model
from monochord.perception.training import (
    REMEDY,
    Objects,
    Replayed,
    adapt,
    read_in_turn,
    stream_of,
    touches_of,
)
from monochord.perception.tuning import retuned_strings, tension_estimator
from monochord.sessions import read_session

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOUCHES = (0, 1, 5, 10, 25, 50, 100)
"""Numbers of known touches."""
MIN_LEFT = 3
"""Smallest number of touches left for scoring, where some are known."""
SCRATCH = "from scratch"
"""Name of the ridge regression trained only on the known touches."""
UNSEEN = "unseen builds"
"""Condition of the rows."""
PRIOR_TOUCHES, MIN_SLOPE, MIN_SPREAD = 1.0, 4, 1e-9
"""Limits of a baseline's correction.

Number of error-free touches that shrink an offset, fewest touches for a slope, and smallest spread of
estimates.
"""
QUANTITIES = ("position", "force")

COUNTED = (
    "The column of windows (`n` in the rows) counts touched windows of 0.1 s whose position or force is "
    "known, answered or not. All figures of position and force are of these. Windows of known touches, of "
    "the taps that align the streams, and with the beginning or the end of a touch are left out. Contact is "
    "also scored on untouched windows, which `n` does not count: where only motors sound, it is 0."
)

PANELS = {
    "position_mae_mm": ("error of x (mm)", 1.0),
    "force_mae_n": ("error of F (N)", 1.0),
    "coverage_1se": ("within 1 std. error (%)", 1e2),
}
"""Label of each panel, and factor of its column."""

Per: TypeAlias = Literal["session", "build"]
Curves: TypeAlias = dict[tuple[str, int], Results]
"""Results by estimator name and number of known touches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Sessions of one build, adapted to together for `objects`; `world` is "" for real sound."""

    files: tuple[Path, ...]
    world: str
    objects: Objects = "same"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rivals:
    """The trained model, its name in the rows, and the ridge regression beside it."""

    name: str
    model: Model
    candidate: EvaluatedEstimator
    ridge: Baselines | None


Outcome: TypeAlias = Curves | InputError
"""A group's curves, or the reason why it has none."""


def evaluate_builds(
    settings: EvaluationSettings,
    *,
    name: str = "",
    touches: Sequence[int] = TOUCHES,
    per: Per = "session",
    condition: str = UNSEEN,
    labels: Labelling = "",
    run: Callable[[Sequence[Group], Callable[[Group], Outcome]], Iterable[tuple[Group, Outcome]]] = run_all,
    progress: Callable[[str, int, int], None] = lambda *_: None,
    refused: Callable[[str], None] = lambda _: None,
) -> list[SummaryRow]:
    """Return a row of figures for each world, estimator, number of known touches, and object or mount.

    A group with too few touches left (`MIN_LEFT`) is left out of that number's rows; each row states its
    number of builds.

    Parameters
    ----------
    settings
        A model with corrections, and sessions of builds outside its training.
    name
        Name of the model in the rows; by default "model".
    touches
        Numbers of known touches.
    per
        Whether to adapt to each session, which has its own object, or to all sessions of a build, for other
        objects than those of the known touches.
    condition
        Of the rows.
    labels
        Labels used for adapting and scoring; see `BuildOptions`. The condition states measured labels.
    run
        Spreads the groups over processes.
    progress
        Called for every group.
    refused
        Called with the reason why a group is left out because of an unusable session.

    Raises
    ------
    InputError
        If the model has no corrections, a session was used for training, or no group has enough touches.
    """
    candidate = load(settings)
    model = load_model(settings.model or "")
    if not model.corrections:
        raise InputError("a model without corrections", "a model that can be adapted", REMEDY)
    if min(touches, default=-1) < 0:
        raise InputError(f"{len(touches)} numbers of touches", "one or more, each 0 or more")
    training = training_of(candidate, model.definition.string) if settings.baselines else None
    ridge = fit_baselines(training, candidate.feature, (RIDGE,)) if training else None
    rivals = _Rivals(name=name or candidate.name, model=model, candidate=candidate, ridge=ridge)
    groups = groups_of(find_sessions(settings.sessions), per)
    work = partial(_curves, rivals=rivals, touches=tuple(sorted(set(touches))), labels=labels)
    parts: dict[tuple[str, str, int], list[Results]] = {}
    errors: list[InputError] = []
    for done, (group, outcome) in enumerate(run(groups, work), start=1):
        if isinstance(outcome, InputError):
            errors.append(outcome)
        else:
            for (model_name, count), results in outcome.items():
                parts.setdefault((group.world, model_name, count), []).append(results)
        progress("builds", done, len(groups))
    if len(errors) == len(groups):
        raise errors[0]
    for error in errors:
        refused(str(error))
    if not parts:
        given = f"{len(groups)} groups of sessions"
        raise InputError(given, f"one with {MIN_LEFT} touches beside the known ones", "take fewer --touches")
    return _rows_of(parts, f"{condition}, {labels} labels" if labels == MEASURED else condition)


def groups_of(files: Sequence[Path], per: Per = "session") -> list[Group]:
    """Return the groups of sessions: single sessions, or all of a build and world."""
    groups: dict[tuple[str, ...], list[Path]] = {}
    for file in files:
        description = read_session(file).description
        world = description.more.get("world", "ideal") if description.simulated else ""
        build = "" if description.build is None else str(description.build)
        groups.setdefault((world, build, *([file.name] if per == "session" else [])), []).append(file)
    objects: Objects = "same" if per == "session" else "others"
    return [Group(files=tuple(own), world=key[0], objects=objects) for key, own in groups.items()]


def _rows_of(parts: Mapping[tuple[str, str, int], list[Results]], condition: str) -> list[SummaryRow]:
    """Return the rows of results by world, estimator and number of known touches, and by class of mount."""
    names = list(dict.fromkeys(model_name for _, model_name, _ in parts))
    rows: list[SummaryRow] = []
    for key in sorted(parts, key=lambda key: (key[0], names.index(key[1]), key[2])):
        world, model_name, count = key
        for body, results in _by_object(join(parts[key])).items():
            row = summary_row(
                results, model=model_name, world=world, touches=count, body=body, condition=condition
            )
            rows.append(row)
        for mount, results in _by_mount(join(parts[key])).items():
            held = f"{condition}, {mount} mount"
            rows.append(summary_row(results, model=model_name, world=world, touches=count, condition=held))
    return rows


def _curves(group: Group, *, rivals: _Rivals, touches: tuple[int, ...], labels: Labelling = "") -> Outcome:
    """Return every estimator's results for each number of known touches that leaves enough to score.

    A group with an unusable session gives the reason instead.
    """
    definition = rivals.model.definition
    window, hop = (size / definition.sample_rate for size in (definition.window, definition.hop))
    curves: Curves = {}
    with TemporaryDirectory() as folder:
        scratch = Path(folder)
        options = BuildOptions(window=window, hop=hop, labels=labels)
        try:
            listen = tension_estimator(definition.string)
            dataset = build_dataset(group.files, scratch / "dataset", options, listen=listen)
        except InputError as error:
            return error
        whole = Selection(dataset=dataset, rows=np.arange(len(dataset)), string=definition.string)
        refuse_trained_on(whole, definition, None)
        touch, counted = touches_of(dataset), _labelled(dataset)
        numbers = np.unique(touch[counted])
        counts = [count for count in touches if not count or len(numbers) >= count + MIN_LEFT]
        known = {count: touch < numbers[count] if count else np.zeros(len(dataset), bool) for count in counts}
        others = [replace(whole, rows=np.flatnonzero(~known[count])) for count in counts]
        rows = stream_of(dataset, whole.rows) if any(counts) else whole.rows[:0]
        replayed_rows = read_in_turn(rivals.model, dataset, rows)
        estimators: list[Estimator] = []
        for count in counts:
            home = scratch / f"model_{count}"
            _adapted(rivals.model, dataset, known[count], group.objects, replayed_rows).save(home)
            estimators.append(ESTIMATORS.build("model", {"path": str(home)}))
        replayed: list[list[Results]] = [[] for _ in counts]
        by_session = [{each.sessions[0]: each for each in _by_string(every)} for every in others]
        for session in whole.sessions:
            left = [number for number, own in enumerate(by_session) if session in own]
            own = [by_session[number][session] for number in left]
            results = replay_estimators(own, [estimators[n] for n in left], name=rivals.name) if left else []
            for number, each in zip(left, results, strict=True):
                replayed[number].append(each)
        baselines = _Ridges(rivals, whole) if rivals.ridge is not None or any(counts) else None
        for number, count in enumerate(counts):
            curves[rivals.name, count] = _joined(replayed[number])
            first = replace(whole, rows=np.flatnonzero(known[count])) if count else None
            ridges = baselines.results(first, others[number]) if baselines else {}
            curves |= {(name, count): results for name, results in ridges.items()}
    return curves


def _labelled(dataset: Dataset) -> Flags:
    """Return the windows (n,) of a touch with known position or force."""
    touched = (dataset.label("contact") == 1.0) & dataset.usable
    return touched & (np.isfinite(dataset.label("position")) | np.isfinite(dataset.label("force")))


def _adapted(model: Model, dataset: Dataset, known: Flags, objects: Objects, replayed: Replayed) -> Model:
    """Return a model adapted to the usable known windows (n,); no other label is visible to it."""
    if not known.any():
        return model
    seen = {name: valid & known for name, valid in dataset.valid.items()}
    try:
        return adapt(model, replace(dataset, valid=seen), objects=objects, replayed=replayed).model
    except InputError:  # none of these touches was detected
        return model


class _Ridges:
    """Both ridge regressions on a group's windows; features are computed once for all numbers of touches."""

    def __init__(self, rivals: _Rivals, whole: Selection) -> None:
        self._rivals, feature = rivals, rivals.candidate.feature
        rows, scales = zip(
            *(features_of(each, feature, whole.string) for each in _by_string(whole)), strict=True
        )
        self._rows, self._scale = np.concatenate(rows), np.concatenate(scales)

    def results(self, known: Selection | None, others: Selection) -> dict[str, Results]:
        """Return each one's results, where there are training data or a known touch."""
        rivals, curves = self._rivals, dict[str, Results]()
        if rivals.ridge is not None:
            before = self._results_of(rivals.ridge, known) if known is not None else None
            name, after = f"{rivals.name}, {RIDGE}", self._results_of(rivals.ridge, others)
            curves[name] = corrected(after, before) if before is not None else after
        if known is not None:
            alone = fit_baselines(known, rivals.candidate.feature, (RIDGE,))
            curves[SCRATCH] = self._results_of(alone, others)
        return {name: replace(results, estimator=name) for name, results in curves.items()}

    def _results_of(self, baselines: Baselines, selection: Selection) -> Results:
        return _joined(
            baselines.results(each, features=(self._rows[each.rows], self._scale[each.rows]))[RIDGE]
            for each in _by_string(selection)
        )


def corrected(results: Results, known: Results) -> Results:
    """Return results with position and force corrected by the errors of known touches.

    The expected error is a + b times the estimate, fitted to the mean of each touch; b is shrunk by
    leave-one-touch-out validation. Below `MIN_SLOPE` touches only a is fitted, shrunk by `PRIOR_TOUCHES`
    error-free touches.

    Parameters
    ----------
    results
        The results to correct.
    known
        Results of the windows with known truth only.
    """
    from sklearn.linear_model import RidgeCV  # noqa: PLC0415

    value = dict(results.value)
    for name in QUANTITIES:
        rows = regression_rows(known, name) & np.isfinite(known.estimate(name))
        if name not in value or not rows.any():
            continue
        touch = np.cumsum(np.diff(np.flatnonzero(rows), prepend=-2) > 1)
        estimate, error = (
            np.array([column[rows][touch == each].mean() for each in np.unique(touch)])
            for column in (known.estimate(name), -known.error_of(name))
        )
        if len(error) < MIN_SLOPE:
            value[name] = value[name] + error.sum() / (len(error) + PRIOR_TOUCHES)
            continue
        spread = max(float(estimate.std()), MIN_SPREAD)
        scaled = (estimate[:, None] - estimate.mean()) / spread
        line: Any = RidgeCV(np.logspace(-2.0, 2.0, 5)).fit(scaled, error)
        slope = float(line.coef_[0]) / spread
        value[name] = value[name] + float(line.intercept_) + slope * (value[name] - estimate.mean())
    return replace(results, value=value)


def _by_string(selection: Selection) -> list[Selection]:
    """Return the sessions of a selection, each with its tuned string where that is far from nominal."""
    dataset, design = selection.dataset, selection.string
    strings = retuned_strings(dataset, design) if design is not None else {}
    of_rows = dataset.session[selection.rows]
    return [
        replace(selection, rows=selection.rows[of_rows == session], string=strings.get(session, design))
        for session in selection.sessions
    ]


def _joined(parts: Iterable[Results]) -> Results:
    return join(list(parts))


def _by_object(results: Results) -> dict[str, Results]:
    """Return the results of all objects together and, where there are several, of each."""
    column = results.of_trials("object")
    names = np.unique(column).tolist()
    each = {name: results.where(column == name) for name in names} if len(names) > 1 else {}
    return {EVERYTHING: results, **each}


def _by_mount(results: Results) -> dict[str, Results]:
    """Return the results of each class of mount that sessions name."""
    column = results.of_trials("mount")
    return {name: results.where(column == name) for name in np.unique(column).tolist() if name}


def builds_page(rows: Sequence[SummaryRow]) -> str:
    """Return the rows of unseen builds as text: a table for each world, condition and object."""
    parts = [
        "# Unseen builds",
        "",
        "Each build is adapted to by its first touches, of known position and force, and scored on the "
        'touches after them. "Ridge" is ridge regression on the same feature, fitted to the same training '
        'windows and corrected by the same touches; "from scratch" is one fitted to these touches '
        "alone. "
        + EXPLAINED
        + " In brackets are intervals of 95 %, drawn over builds where there are five or more.",
        "",
        COUNTED,
        "",
    ]
    kinds = dict.fromkeys((row["world"], row["condition"], row["object"]) for row in rows)
    for world, condition, body in kinds:
        own = [
            row for row in rows if (row["world"], row["condition"], row["object"]) == (world, condition, body)
        ]
        where = f"{world} world, simulated" if world else "real sound"
        parts += [f"## {condition.capitalize()}, {body.replace('_', ' ')}, {where}", "", *_table(own), ""]
    return "\n".join(parts).rstrip() + "\n"


def _table(rows: Sequence[SummaryRow]) -> Iterator[str]:
    yield "| " + " | ".join(["estimator", "touches", *HEADS, "builds", "windows"]) + " |"
    yield "|---|" + "---:|" * (len(HEADS) + 3)
    for row in rows:
        figures = list(cells(row))
        for name, at in INTERVALS.items():
            figures[at] += _interval(row, name)
        name = row["model"].replace("_", " ")
        line = [name, str(row["touches"]), *figures, str(row["builds"]), str(row["n"])]
        yield "| " + " | ".join(line) + " |"


def _interval(row: SummaryRow, name: str) -> str:
    low_high = row.get("intervals", {}).get(name)
    return f" ({low_high[0]:.3g} to {low_high[1]:.3g})" if low_high else ""


def plain_name(model: str) -> str:
    """Return the name of a model in the legend of a figure.

    >>> plain_name("demo"), plain_name("demo, ridge"), plain_name("my_model")
    ('trained model', 'ridge regression, same feature', 'my model')
    """
    names = {
        "demo": "trained model",
        "demo, ridge": "ridge regression, same feature",
        SCRATCH: "ridge regression, known touches alone",
    }
    return names.get(model, model.replace("_", " "))


def drawn(rows: Sequence[SummaryRow]) -> "Figure":
    """Return a figure of position and force errors and coverage over the known touches, a line per estimator.

    The rows are for one condition and object. Shades are 95 % intervals over builds; the dashed line is the
    coverage of normal errors with correct standard errors.
    """
    counts = sorted({row["touches"] for row in rows})
    page = style.canvas(62.0)
    panels = page.subplots(1, len(PANELS))
    for letter, axes, (column, (label, factor)) in zip("ABC", panels, PANELS.items(), strict=True):
        style.dress(axes, letter, "", "known touches", label)
        for number, model in enumerate(dict.fromkeys(row["model"] for row in rows)):
            own = [row for row in rows if row["model"] == model and row[column] is not None]
            at = [counts.index(row["touches"]) for row in own]
            colour = COLOURS[number % len(COLOURS)]
            values = [factor * row[column] for row in own]
            axes.plot(at, values, marker="o", ms=3.0, lw=1.0, color=colour, label=plain_name(model))
            bounds = [row.get("intervals", {}).get(column) or (row[column], row[column]) for row in own]
            low, high = factor * np.array(bounds, float).reshape(-1, 2).T
            axes.fill_between(at, low, high, color=colour, alpha=0.15, lw=0)
        axes.set_xticks(range(len(counts)), [str(count) for count in counts])
        axes.set_ylim(bottom=0.0)
        axes.grid(axis="y", lw=0.3, color=style.PALE)
    panels[2].axhline(100.0 * normal_coverage(1.0), lw=0.6, ls=style.THEORY, color=style.INK)
    panels[2].set_ylim(0.0, 100.0)
    kind = "simulated" if all(row.get("simulated") for row in rows) else "recorded"
    title = f"{kind}: {rows[0]['condition']}, {rows[0]['object'].replace('_', ' ')}"
    page.suptitle(title, fontsize=style.LABEL)
    style.key(page, *panels)
    return page


@click.command()
@click.argument("model")
@click.option("--sessions", multiple=True, required=True, metavar="FILES", help="Unseen builds; repeatable.")
@click.option(
    "--touches",
    default=",".join(map(str, TOUCHES)),
    show_default=True,
    metavar="N,N",
    help="Numbers of known touches.",
)
@click.option(
    "--per",
    type=click.Choice(["session", "build"]),
    default="session",
    show_default=True,
    help="Adapt to each session, with its object, or to all sessions of a build, for other objects.",
)
@click.option("--condition", default=UNSEEN, show_default=True, metavar="TEXT", help="Name of the condition.")
@click.option(
    "--labels",
    type=click.Choice(["recorded", "measured"]),
    help="Use the labels of the session, or derive them from force and pose.  [default: recorded, if any]",
)
@click.option("--name", default="", metavar="NAME", help="Name of the model in the rows.  [default: MODEL]")
@click.option(
    "--baselines/--no-baselines",
    default=True,
    show_default=True,
    help="Also test ridge regression on the same feature.",
)
@click.option(
    "--rows",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Save the rows in FILE, a JSON, and a page beside it.",
)
@click.option("--figure", type=click.Path(path_type=Path), metavar="FILE", help="Draw all objects to FILE.")
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes.  [default: one a core]")
def unseen_builds(
    model: str,
    *,
    sessions: tuple[str, ...],
    touches: str,
    per: Per,
    condition: str,
    labels: Labelling | None,
    name: str,
    baselines: bool,
    rows: Path | None,
    figure: Path | None,
    workers: int | None,
) -> None:
    """Test MODEL on builds outside its training, adapted to 0, 1, 5 ... touches of each.

    For every session, the model is adapted to the first touches and scored on the others, beside ridge
    regression on the same feature, corrected by the same touches, and ridge regression trained only on these
    touches. With --labels measured, the touches' labels come from robot and force sensor, errors included.
    """
    settings = EvaluationSettings(model=model, sessions=sessions, baselines=baselines)
    with progress_bar("builds") as progress:
        result = evaluate_builds(
            settings,
            name=name or Path(model).name,
            touches=_numbers(touches),
            per=per,
            condition=condition,
            labels=labels or "",
            run=partial(run_all, workers=workers),
            progress=progress,
            refused=lambda why: print(f"left out: {why}", file=sys.stderr),
        )
    if rows is not None:
        keep_summary(rows, result, builds_page)
    if figure is not None:
        drawn([row for row in result if row["object"] == EVERYTHING]).savefig(figure)
    names = ("world", "object", "estimator", "touches")
    own = [(row["world"] or "real", row["object"], row["model"], str(row["touches"])) for row in result]
    table = [(*each, *cells(row), str(row["builds"])) for each, row in zip(own, result, strict=True)]
    print(*lines_of((*names, *HEADS, "builds"), table), sep="\n")


def _numbers(text: str) -> tuple[int, ...]:
    try:
        numbers = tuple(int(each) for each in text.split(","))
    except ValueError as error:
        raise InputError(f"--touches {text}", "whole numbers with commas between, such as 0,10") from error
    if min(numbers) < 0:
        raise InputError(f"--touches {text}", "0 or more")
    return numbers


if __name__ == "__main__":
    main(unseen_builds)
