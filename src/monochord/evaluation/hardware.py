"""An estimator and its baselines on a sensor as hardware may have it: a row of figures for each condition.

The sessions of all conditions have the same touches and differ in one thing each; the virtual laboratory
makes them, see `monochord.lab.hardware`. They are replayed window by window, as every evaluation is. Where a
condition changes the open string's pitch, each estimator is tested twice: with the string as its design
states it, and with the string as tuned, estimated from the untouched sound of each session as by
`monochord tune`.
"""

from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from pathlib import Path

from monochord.core.ownership import scratch_folder
from monochord.evaluation.baselines import Baselines, fit_baselines
from monochord.evaluation.replay import Progress, Selection, replay
from monochord.evaluation.results import CLEAN, Results, join
from monochord.evaluation.select import Candidate, EvaluationData, EvaluationSettings, load, select
from monochord.evaluation.summary import SummaryRow, summary_row
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator

CLOSED_FORM, PHYSICS = "closed_form", {"tension_law": "geometric"}
"""Estimator that stands beside every model, and its options for the twin."""
TUNED = ", tuned"
"""End of the name of a condition in which estimators know the string as it is tuned."""
WORLD = "ideal"
"""World of the suite's sensor, in which one thing is changed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareEvaluation:
    """Outcome of the suite: a row for each condition and estimator, and the estimates by estimator.

    `notes` are what a reader must know.
    """

    rows: tuple[SummaryRow, ...]
    results: Mapping[str, Results]
    notes: tuple[str, ...] = ()


def evaluate_hardware(
    settings: EvaluationSettings,
    sessions: Mapping[str, Path],
    *,
    name: str = "",
    retuned: AbstractSet[str] = frozenset(),
    progress: Progress = lambda *_: None,
) -> HardwareEvaluation:
    """Return how well an estimator and its baselines do in every condition.

    Parameters
    ----------
    settings
        What is evaluated; its sessions are those of each condition in turn. Ridge regression and extra trees
        are fitted where the training dataset of the model is there.
    sessions
        Folder of the sessions of each condition, by its name.
    name
        Name of the estimator in the rows; by default its own.
    retuned
        Conditions in which the string may be tuned otherwise.
    progress
        Called for every session.

    Raises
    ------
    InputError
        If something cannot be used, or a session was trained on.

    Examples
    --------
    ``monochord evaluate demo --suite hardware`` does so.
    """
    candidate = load(settings)
    rivals: _Rivals | None = None
    parts: dict[str, list[Results]] = {}
    rows: list[SummaryRow] = []
    notes: dict[str, None] = {}
    for condition, folder in sessions.items():
        with scratch_folder() as scratch:
            first = settings.baselines and rivals is None  # they are fitted once
            data = select(replace(settings, sessions=(str(folder),), baselines=first), candidate, scratch)
            rivals = rivals or _Rivals.of(settings, candidate, data, name or candidate.name, progress)
            selections = {condition: replace(data.selection, tuned=False)}
            if condition in retuned:
                selections[condition + TUNED] = replace(data.selection, tuned=True)
            for label, each in selections.items():
                for rival, results in rivals.results(each, label, progress):
                    parts.setdefault(rival, []).append(results)
                    rows.append(summary_row(results, model=rival, world=WORLD, condition=label))
            notes |= dict.fromkeys(data.notes)
    return HardwareEvaluation(
        rows=tuple(rows), results={rival: join(each) for rival, each in parts.items()}, notes=tuple(notes)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rivals:
    """All that is tested: the estimator, the closed form, and baselines on the estimator's feature."""

    name: str
    estimators: Mapping[str, Estimator]
    baselines: Baselines | None

    @classmethod
    def of(
        cls,
        settings: EvaluationSettings,
        candidate: Candidate,
        data: EvaluationData,
        name: str,
        progress: Progress,
    ) -> "_Rivals":
        """Return them, with the baselines fitted where there are training windows."""
        estimators = {name: candidate.estimator}
        if candidate.name != CLOSED_FORM:
            estimators[CLOSED_FORM] = ESTIMATORS.build(CLOSED_FORM, PHYSICS)
        baselines: Baselines | None = None
        if settings.baselines and data.training is not None:
            progress("fitting baselines", 0, 1)
            baselines = fit_baselines(data.training, candidate.feature)
        return cls(name=name, estimators=estimators, baselines=baselines)

    def results(
        self, selection: Selection, condition: str, progress: Progress
    ) -> Iterator[tuple[str, Results]]:
        """Yield the name and the results of each, in a condition."""

        def report(session: str, done: int, of: int) -> None:
            progress(f"{condition}, {session}" if session else condition, done, of)

        for name, estimator in self.estimators.items():
            results = replay(selection, estimator, name=name, progress=report)
            yield name, _in_condition(results, condition)
        fitted = self.baselines.results(selection, progress=report) if self.baselines else {}
        for kind, results in fitted.items():
            yield f"{self.name}, {kind.replace('_', ' ')}", _in_condition(results, condition)


def _in_condition(results: Results, condition: str) -> Results:
    """Return results in a condition that the sound of their sessions had when it was made."""
    noise = "" if condition == CLEAN else condition
    trials = tuple(replace(trial, noise=noise, ratio=None) for trial in results.trials)
    return replace(results, trials=trials)
