"""An estimator and its baselines on realistic hardware: a row of figures for each condition.

Makes `docs/results/hardware.json` and its figure in some 50 minutes on two cores:
``python -m studies.hardware_suite demo --out docs/results``. All of its sound is simulated.

`CONDITIONS` lists what is changed, one thing in each, and the plan `studies/plans/hardware.toml` the touches,
which are the same in all of them. In the last conditions a model should abstain: a driver or a microphone is
dead, the string is another, what touches is foam, or two things touch. Where a condition changes the open
string's pitch, each estimator is tested twice: with the string as its design states it, and with the string
as tuned, estimated from the untouched sound of each session as by `monochord tune`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click
from studies._command import lines_of, main, progress_bar
from studies._rows import EXPLAINED, HEADS, SummaryRow, cells, keep_summary, read_summary, summary_row

from monochord.core.errors import InputError, did_you_mean
from monochord.core.units import Metres
from monochord.evaluation import (
    CLEAN,
    Baselines,
    EvaluatedEstimator,
    EvaluationData,
    EvaluationSettings,
    Results,
    Selection,
    fit_baselines,
    load,
    replay,
    select,
)
from monochord.figures import COLOURS, style
from monochord.lab import NONE, Assignment, Deviation, Group, Plan, assignments, load_plan, make, run_all
from monochord.metrics import normal_coverage
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLAN = Path(__file__).parent / "plans" / "hardware.toml"
"""The touches repeated in every condition."""
QUICK_GRID = (2, 1)
"""Places and forces of a group in a quick suite."""
FIRST_BUILD = 1001
"""Seed of the first build, beyond those of the training plans."""

CLOSED_FORM, PHYSICS = "closed_form", {"tension_law": "geometric"}
"""Estimator listed beside every model, and its options for the twin."""
TUNED = ", tuned"
"""Suffix of a condition's name in which estimators know the tuned string."""
WORLD = "ideal"
"""World of the suite's sensor, in which one thing is changed."""
PANELS = {
    "position_mae_mm": ("error of x (mm)", 1.0, True),
    "force_mae_n": ("error of F (N)", 1.0, True),
    "coverage_1se": ("within 1 std. error (%)", 1e2, False),
    "answered": ("answered (%)", 1e2, False),
}
"""Label of each panel, factor of its column, and whether its axis is logarithmic."""
LINE_HEIGHT, MARGIN = 4.2, 26.0
"""Height per condition, and of the rest, in mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """The sensor and its surroundings in one part of the suite; no change is "clean".

    Parameters
    ----------
    name
        Name in tables.
    deviation
        Deviations of the sensor and the object.
    motors
        Whether the robot's motors sound in the frame.
    builds
        Number of builds to spread the touches over; 0 for the nominal design.
    material
        Material of the objects; empty for the plan's.
    second
        Distance in m of a second object that touches at the same time; 0 for none.
    is_retuned
        Whether the open string's pitch may change: estimators are then also tested with the string tuned by
        `monochord tune`.
    """

    name: str
    deviation: Deviation = NONE
    motors: bool = False
    builds: int = 0
    material: str = ""
    second: Metres = 0.0
    is_retuned: bool = False


CONDITIONS: tuple[Condition, ...] = (
    Condition(name="clean"),
    *(
        Condition(name=f"distortion {100.0 * share:g} %", deviation=Deviation(distortion=share))
        for share in (0.001, 0.003, 0.01)
    ),
    *(Condition(name=f"SNR {snr:g} dB", deviation=Deviation(snr=snr)) for snr in (50.0, 40.0, 30.0)),
    *(
        Condition(name=f"{warming:+g} K", deviation=Deviation(warming=warming), is_retuned=True)
        for warming in (20.0, -20.0)
    ),
    *(
        Condition(name=f"drive x{drive:g}", deviation=Deviation(drive=drive))
        for drive in (0.5, 2.0, 4.0, 8.0)
    ),
    Condition(name="spring 1e5 N/m", deviation=Deviation(spring=1e5)),
    Condition(name="spring 1e6 N/m", deviation=Deviation(spring=1e6)),
    Condition(name="linear contact", deviation=Deviation(linear=True)),
    Condition(name="yielding ends", deviation=Deviation(ends=True), is_retuned=True),
    Condition(name="motors", motors=True),
    Condition(name="16 builds", builds=16, is_retuned=True),
    Condition(name="driver 1 dead", deviation=Deviation(dead_driver=1)),
    Condition(name="driver 2 dead", deviation=Deviation(dead_driver=2)),
    Condition(name="microphone 1 dead", deviation=Deviation(dead_microphone=1)),
    Condition(name="microphone 2 dead", deviation=Deviation(dead_microphone=2)),
    Condition(name="microphones swapped", deviation=Deviation(swapped=True)),
    Condition(name="gauge x1.2", deviation=Deviation(gauge=1.2)),
    Condition(name="foam", material="foam"),
    Condition(name="two touches", second=0.03),
    *(
        Condition(name=f"tuning {percent:+d} %", deviation=Deviation(pitch=0.01 * percent), is_retuned=True)
        for percent in (-6, -4, -2, 2, 4, 6)
    ),
)
"""The conditions of the suite."""


def chosen_conditions(names: Sequence[str] = ()) -> list[Condition]:
    """Return the conditions of these names, with the clean one first; all of them without names.

    Raises
    ------
    InputError
        If a name is unknown.

    Examples
    --------
    >>> [condition.name for condition in chosen_conditions(["motors"])]
    ['clean', 'motors']
    """
    known = [condition.name for condition in CONDITIONS]
    for name in names:
        if name not in known:
            raise InputError(f"condition '{name}'", ", ".join(known), did_you_mean(name, known))
    return [each for each in CONDITIONS if not names or each.name in {CONDITIONS[0].name, *names}]


def plan_of(condition: Condition, sensor: str, *, quick: bool = False) -> Plan:
    """Return the plan of a condition: the same touches as in every other one.

    A `quick` plan has only `QUICK_GRID` touches of one object held, and of one sliding.

    Examples
    --------
    >>> plan_of(CONDITIONS[1], "prototype").deviation.distortion
    0.001
    """
    plan = load_plan(str(PLAN), [f"sensor={sensor}"])
    groups = list(plan.groups)
    if quick:
        first = {group.protocol: replace(group, grid=QUICK_GRID) for group in reversed(groups)}
        groups = list(reversed(first.values()))
    if condition.motors:
        groups = [replace(group, motors="synthetic") for group in groups]
    if condition.material:
        groups = [replace(group, material=condition.material) for group in groups]
    if condition.second:
        groups = [replace(group, second=condition.second) for group in groups]
    if condition.builds:
        groups = _spread(groups, condition.builds)
    return replace(plan, groups=tuple(groups), deviation=condition.deviation)


def render(
    conditions: Sequence[Condition],
    sensor: str,
    folder: Path,
    *,
    quick: bool = False,
    progress: Callable[[str, int, int], None] = lambda *_: None,
) -> dict[str, Path]:
    """Return the folder of each condition's sessions, by name; existing sessions are kept."""
    folders: dict[str, Path] = {}
    jobs: list[tuple[Assignment, Path]] = []
    for condition in conditions:
        plan = plan_of(condition, sensor, quick=quick)
        own = folder.resolve() / _slug(condition.name)
        own.mkdir(parents=True, exist_ok=True)
        folders[condition.name] = own
        jobs += [(each, own) for each in assignments(plan) if not (own / f"{each.name}.mcap").exists()]
    for done, _ in enumerate(run_all(jobs, _made), start=1):
        progress("rendering", done, len(jobs))
    return folders


def _made(job: tuple[Assignment, Path]) -> None:
    make(*job)


def _spread(groups: Sequence[Group], builds: int) -> list[Group]:
    """Return the groups with each protocol's touches spread over all builds, one session for each."""
    seeds: dict[str, Iterator[int]] = {}
    result: list[Group] = []
    for group in groups:
        share = builds // sum(other.protocol == group.protocol for other in groups)
        own = seeds.setdefault(group.protocol, cycle(range(FIRST_BUILD, FIRST_BUILD + builds)))
        share = min(share, group.grid[0] * group.grid[1])
        result.append(replace(group, builds=tuple(next(own) for _ in range(share)), sessions=share))
    return result


def _slug(name: str) -> str:
    """Return a condition's name as a folder name.

    >>> _slug("tuning -6 %"), _slug("+20 K")
    ('tuning_-6', '+20_k')
    """
    return "_".join(name.lower().replace("%", "").replace("/", "_").split())


def evaluate_suite(
    settings: EvaluationSettings,
    sessions: dict[str, Path],
    conditions: Sequence[Condition],
    *,
    name: str = "",
    progress: Callable[[str, int, int], None] = lambda *_: None,
) -> list[SummaryRow]:
    """Return a row of figures for each condition and estimator.

    Ridge regression and extra trees are fitted if the model's training dataset is available.
    """
    candidate = load(settings)
    rivals: _Rivals | None = None
    rows: list[SummaryRow] = []
    for condition in conditions:
        with TemporaryDirectory() as scratch:
            first = settings.baselines and rivals is None  # they are fitted once
            own = replace(settings, sessions=(str(sessions[condition.name]),), baselines=first)
            data = select(own, candidate, Path(scratch))
            rivals = rivals or _Rivals.of(settings, candidate, data, name or candidate.name)
            selections = {condition.name: replace(data.selection, tuned=False)}
            if condition.is_retuned:
                selections[condition.name + TUNED] = replace(data.selection, tuned=True)
            for label, each in selections.items():
                for rival, results in rivals.results(each, label, progress):
                    rows.append(summary_row(results, model=rival, world=WORLD, condition=label))
    return rows


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rivals:
    """All tested estimators: the model, the closed form, and baselines on the model's feature."""

    name: str
    estimators: Mapping[str, Estimator]
    baselines: Baselines | None

    @classmethod
    def of(
        cls,
        settings: EvaluationSettings,
        candidate: EvaluatedEstimator,
        data: EvaluationData,
        name: str,
    ) -> "_Rivals":
        """Return the estimators, with baselines fitted where there are training windows."""
        estimators = {name: candidate.estimator}
        if candidate.name != CLOSED_FORM:
            estimators[CLOSED_FORM] = ESTIMATORS.build(CLOSED_FORM, PHYSICS)
        baselines: Baselines | None = None
        if settings.baselines and data.training is not None:
            baselines = fit_baselines(data.training, candidate.feature)
        return cls(name=name, estimators=estimators, baselines=baselines)

    def results(
        self, selection: Selection, condition: str, progress: Callable[[str, int, int], None]
    ) -> Iterator[tuple[str, Results]]:
        """Yield each one's name and results in a condition."""

        def report(session: str, done: int, of: int) -> None:
            progress(f"{condition}, {session}" if session else condition, done, of)

        for name, estimator in self.estimators.items():
            results = replay(selection, estimator, name=name, progress=report)
            yield name, _in_condition(results, condition)
        fitted = self.baselines.results(selection, progress=report) if self.baselines else {}
        for kind, results in fitted.items():
            yield f"{self.name}, {kind.replace('_', ' ')}", _in_condition(results, condition)


def _in_condition(results: Results, condition: str) -> Results:
    """Return results in a condition that is part of their sessions' sound."""
    noise = "" if condition == CLEAN else condition
    trials = tuple(replace(trial, noise=noise, ratio=None) for trial in results.trials)
    return replace(results, trials=trials)


def hardware_page(rows: Sequence[SummaryRow], figure: str = "") -> str:
    """Return the rows as text: a table for each estimator, a line for each condition."""
    parts = [
        "# On sensors as hardware may have them",
        "",
        "All sound is simulated: the same touches in every condition, with one thing changed in each. "
        '"Tuned" means that the string is known as tuned, as monochord tune measures it. ' + EXPLAINED,
        "",
    ]
    parts += [f"![errors by condition]({figure})", ""] if figure else []
    for model in dict.fromkeys(row["model"] for row in rows):
        own = [row for row in rows if row["model"] == model]
        parts += [f"## {model.replace('_', ' ')}", "", *_table(own), ""]
    return "\n".join(parts).rstrip() + "\n"


def _table(rows: Sequence[SummaryRow]) -> Iterator[str]:
    yield "| " + " | ".join(["condition", *HEADS, "windows"]) + " |"
    yield "|---|" + "---:|" * (len(HEADS) + 1)
    for row in rows:
        yield "| " + " | ".join([row["condition"], *cells(row), str(row["n"])]) + " |"


def drawn(rows: Sequence[SummaryRow]) -> "Figure":
    """Return a figure of errors, coverage and answered share, a line for each condition.

    The dashed line in the coverage panel is for normal errors with correct standard errors.
    """
    from matplotlib.ticker import LogLocator, NullLocator  # noqa: PLC0415

    conditions = list(dict.fromkeys(row["condition"] for row in rows))
    page = style.canvas(MARGIN + LINE_HEIGHT * len(conditions))
    panels = page.subplots(1, len(PANELS), sharey=True)
    for letter, axes, column in zip("ABCD", panels, PANELS, strict=True):
        label, _, logarithmic = PANELS[column]
        style.dress(axes, letter, "", label, "")
        _marks(axes, rows, conditions, column)
        if logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_locator(NullLocator())
        else:
            axes.set_xlim(-4.0, 104.0)
        axes.grid(axis="y", lw=0.3, color=style.PALE)
        axes.set_axisbelow(True)
    panels[2].axvline(100.0 * normal_coverage(1.0), lw=0.6, ls=style.THEORY, color=style.INK)
    panels[0].set_yticks(range(len(conditions)), conditions)
    panels[0].set_ylim(len(conditions) - 0.5, -0.5)
    page.suptitle("simulated: one sensor, one thing changed", fontsize=style.LABEL)
    style.key(page, *panels)
    return page


def _marks(axes: "Axes", rows: Sequence[SummaryRow], conditions: Sequence[str], column: str) -> None:
    _, factor, _ = PANELS[column]
    models = list(dict.fromkeys(row["model"] for row in rows))
    for number, model in enumerate(models):
        own = {row["condition"]: row[column] for row in rows if row["model"] == model}
        at = [place for place, condition in enumerate(conditions) if own.get(condition) is not None]
        aside = 0.5 * ((number + 0.5) / len(models) - 0.5)
        axes.plot(
            [factor * own[conditions[place]] for place in at], [place + aside for place in at],
            ls="", marker="o", ms=3.0, mec="none", color=COLOURS[number % len(COLOURS)],
            label=model.replace("_", " "),
        )  # fmt: skip


@click.command()
@click.argument("model")
@click.option("--sensor", default="prototype", show_default=True, help="Preset or file of the sensor.")
@click.option("--only", multiple=True, metavar="NAME", help="Only this condition; repeatable.")
@click.option("--quick", is_flag=True, help="Use only a few touches in each condition.")
@click.option(
    "--baselines/--no-baselines",
    default=True,
    show_default=True,
    help="Also test ridge regression and extra trees.",
)
@click.option("--name", default="", help="Name of the model in the rows.  [default: MODEL]")
@click.option(
    "--cache",
    type=click.Path(path_type=Path),
    default=Path("hardware-sessions"),
    show_default=True,
    help="Folder of the sessions, reused for other models.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Save rows, page and figure in this folder.")
def hardware_suite(
    model: str,
    *,
    sensor: str,
    only: tuple[str, ...],
    quick: bool,
    baselines: bool,
    name: str,
    cache: Path,
    out: Path | None,
) -> None:
    """Test MODEL on simulated sensors with the same touches and one change in each condition."""
    conditions = chosen_conditions(only)
    settings = EvaluationSettings(model=model, baselines=baselines)
    with progress_bar("suite") as progress:
        sessions = render(conditions, sensor, cache, quick=quick, progress=progress)
        rows = evaluate_suite(
            settings, sessions, conditions, name=name or Path(model).name, progress=progress
        )
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        keep_summary(out / "hardware.json", rows, lambda every: hardware_page(every, "hardware.svg"))
        drawn(read_summary(out / "hardware.json")).savefig(out / "hardware.svg")
    table = [(row["condition"], row["model"], *cells(row)) for row in rows]
    print(*lines_of(("condition", "estimator", *HEADS), table), sep="\n")


if __name__ == "__main__":
    main(hardware_suite)
