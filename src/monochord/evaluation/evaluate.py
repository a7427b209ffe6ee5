"""Runs a whole evaluation: load an estimator, select windows, replay them, score; `write` keeps the outcome.

`load` and `select` are in `monochord.evaluation.select`, which keeps test and training data apart, and
`scorecard` in `monochord.evaluation.scorecard`.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

from monochord.core.errors import InputError
from monochord.core.files import usable_path, write_text
from monochord.core.ownership import scratch_folder
from monochord.core.workers import ALL_CORES, ONE_PROCESS, Spread
from monochord.dsp.music import loop
from monochord.evaluation.baselines import baseline_results
from monochord.evaluation.noise import RECORDED, Disturbance, noise_recordings, noise_suite, parse_noise
from monochord.evaluation.replay import conditions_of, replay_all
from monochord.evaluation.report import page
from monochord.evaluation.results import Results, join, write_csv, write_results
from monochord.evaluation.scorecard import Scorecard, scorecard
from monochord.evaluation.select import EvaluatedEstimator, EvaluationData, EvaluationSettings, load, select

RESULTS, TABLE, SCORES, PAGE = "results.npz", "results.csv", "scores.json", "report.html"
"""Files written by an evaluation."""

Draw: TypeAlias = Callable[[Path, Results], Mapping[str, str]]
"""Returns the figures of a results file, as SVG texts by title."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Result of an evaluation: estimates, scores, and the candidate's name in tables of features."""

    results: Results
    card: Scorecard
    label: str


def evaluate(settings: EvaluationSettings, spread: Spread = ALL_CORES) -> Evaluation:
    """Evaluate an estimator on sessions that it was not trained on, and return estimates and scores.

    They do not depend on the number of processes.

    Parameters
    ----------
    settings
        The estimator, the data, and the noises.
    spread
        Where sessions are replayed; by default, small evaluations run in this process.

    Raises
    ------
    InputError
        If an input is unusable, the split leaks, or a session was used for training.

    Examples
    --------
    ``monochord evaluate demo --sessions take.mcap`` does so with the bundled model.
    """
    with ExitStack() as stack:
        candidate = load(settings)
        data = select(settings, candidate, stack.enter_context(scratch_folder()), spread)
        noises = _noises(settings, data.selection.dataset.manifest.sample_rate)
        results = replay_conditions(data, candidate, noises, spread)
        beside: dict[str, Results] = {}
        if settings.baselines and data.training is not None:
            beside = baseline_results(data.selection, data.training, candidate.feature, noises, spread)
        card = scorecard(
            results, baselines=beside, string=data.selection.string, force_floor=data.force_floor
        )
    return Evaluation(results=results, card=card, label=candidate.label)


def replay_conditions(
    data: EvaluationData,
    candidate: EvaluatedEstimator,
    noises: Sequence[Disturbance] = (),
    spread: Spread = ONE_PROCESS,
) -> Results:
    """Return the estimates of all windows as recorded, then with each noise.

    Sessions recorded with ambient noise get no added noise.
    """
    conditions = conditions_of(data.selection, noises)
    parts = replay_all(conditions, [candidate.estimator], name=candidate.name, spread=spread)
    results = join([part for (part,) in parts])
    return replace(results, notes=data.notes, options={**results.options, **candidate.about})


def write(folder: Path, evaluation: Evaluation, draw: Draw = lambda *_: {}) -> None:
    """Write results, their table, the scores and the report into a folder, in place of earlier ones.

    Parameters
    ----------
    folder
        The output folder.
    evaluation
        The evaluation to write.
    draw
        Returns the figures of the report.

    Raises
    ------
    InputError
        If the folder cannot be created.

    Examples
    --------
    ``monochord evaluate --out FOLDER`` writes one.
    """
    results, card = evaluation.results, evaluation.card
    with usable_path(f"folder {folder}", "a folder that can be created"):
        folder.mkdir(parents=True, exist_ok=True)
    write_results(results, folder / RESULTS)
    write_csv(results, folder / TABLE)
    scores = json.dumps(card.tree(), indent=1, allow_nan=False)
    for name, text in ((SCORES, scores + "\n"), (PAGE, page(card, draw(folder / RESULTS, results)))):
        write_text(folder / name, text)


def refuse_unwritable(folder: Path) -> None:
    """Raise `InputError` for a folder that cannot be created, and leave no folder behind.

    So is one with files of these names that are no evaluation's; an earlier evaluation is replaced.
    """
    names = PAGE, SCORES, RESULTS, TABLE
    there = [name for name in names if (folder / name).exists()]
    if 0 < len(there) < len(names):
        given = f"folder {folder}, which already has {', '.join(there)}"
        raise InputError(given, "a new folder, or that of an evaluation", "choose another name")
    made: list[Path] = []
    try:
        for each in (*reversed(folder.parents), folder):
            if not each.is_dir():
                each.mkdir()
                made.append(each)
    except OSError as error:
        raise InputError(f"folder {folder} ({error.strerror})", "a folder that can be created") from error
    finally:
        for each in reversed(made):
            each.rmdir()


def _noises(settings: EvaluationSettings, sample_rate: int) -> list[Disturbance]:
    """Return the noises of the evaluation; synthetic music replaces missing recordings of music."""
    recorded = settings.suite or any(text.partition(":")[0] in RECORDED for text in settings.noises)
    recordings = noise_recordings(sample_rate, loop(0)) if recorded else {}
    noises = [parse_noise(text, recordings, settings.seed) for text in settings.noises]
    return [*noises, *(noise_suite(recordings, seed=settings.seed) if settings.suite else ())]
