"""Scores a model or an estimator on test sessions, like ``monochord evaluate``."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from monochord.core.config import override
from monochord.core.errors import InputError
from monochord.core.notebook import lines
from monochord.core.ownership import scratch_folder
from monochord.core.progress import progress_bar
from monochord.core.ranges import Count, Seed, checked
from monochord.core.types import Progress
from monochord.core.workers import Spread, refuse_both
from monochord.datasets.split import SPLIT_FILE
from monochord.datasets.store import Dataset
from monochord.evaluation.evaluate import Evaluation, write
from monochord.evaluation.evaluate import evaluate as evaluate_settings
from monochord.evaluation.paper import keep_rows, paper_rows
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import Scorecard
from monochord.evaluation.scores import Regression
from monochord.evaluation.select import EvaluationSettings, Part
from monochord.evaluation.table import Scores, score_rows
from monochord.front.build import Sessions, session_names
from monochord.front.drawings import drawings
from monochord.front.train import TrainedModel
from monochord.perception.data import LabelledData
from monochord.perception.model import Model, folder_of, load

DEFAULT_ESTIMATOR = "closed_form"
"""Estimator evaluated by default, without a model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationReport:
    """The result of an evaluation: estimates beside the truth, and all scores."""

    evaluation: Evaluation
    part: Part

    @property
    def results(self) -> Results:
        """Estimates beside the truth, one row per window, in SI units."""
        return self.evaluation.results

    @property
    def card(self) -> Scorecard:
        """All scores, with their intervals."""
        return self.evaluation.card

    def __repr__(self) -> str:
        card, kind = self.card, ", simulated" if self.card.simulated else ""
        rows = [row for row in card.table if row.state == "touched" and row.condition == "clean"]
        facts = [("windows", f"{card.windows} of {card.sessions} sessions")]
        for row in rows[-1:]:  # the last one is of all objects
            facts.append(("position", _error(row.position, 1e3, "mm")))
            facts.append(("force", _error(row.force, 1.0, "N")))
        return lines(f"EvaluationReport: {card.estimator} on the {self.part} part{kind}", facts)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()

    def table(self) -> Scores:
        """Return the printed table: a row for each object, condition and estimator."""
        return score_rows(self.card)

    def tree(self) -> dict[str, Any]:
        """Return all scores as plain values for JSON."""
        return self.card.tree()

    def lines(self) -> list[str]:
        """Return the number of windows, the notes and the table as text lines."""
        card = self.card
        kind = ", simulated" if card.simulated else ""
        first = f"{card.estimator}{kind}: {card.windows} windows of {card.sessions} sessions"
        return [first, *(f"note: {note}" for note in card.notes), *self.table().lines()]

    @checked
    def write(self, folder: str | Path) -> None:
        """Write results, their table, the scores and a report with figures into a folder.

        Figures need matplotlib. Raises `InputError` if the folder cannot be created.
        """
        write(Path(folder), self.evaluation, drawings)

    @checked
    def keep_rows(self, file: str | Path, feature: str | None = None) -> None:
        """Put the table's rows into a JSON file, replacing those of the same name, and print all beside it.

        `feature` is the rows' name; by default the model's feature, or the estimator. Raises `InputError` if
        the file has other content.
        """
        keep_rows(Path(file), paper_rows(self.card, feature or self.evaluation.label, self.part))


def _error(score: Regression, scale: float, unit: str) -> str:
    """Return a mean error and the share of answers as text; empty where nothing was answered."""
    error, answered = score.mae.value, score.answered
    return "" if error is None else f"{scale * error:.2f} {unit} off, {answered or 0.0:.0%} answered"


@checked
def evaluate(
    model: str | Path | Model | None = None,
    data: LabelledData | Dataset | str | Path | None = None,
    *,
    sessions: Sessions = (),
    skip: bool = False,
    split: str | Path | None = None,
    part: Part = "test",
    estimator: str | None = None,
    settings: Sequence[str] = (),
    sensor: str | Path | None = None,
    tuned: bool = False,
    noise: Sequence[str] = (),
    suite: bool = False,
    seed: Seed = 0,
    baselines: bool = True,
    workers: Count | None = None,
    cluster: str = "",
    progress: Progress | None = None,
) -> EvaluationReport:
    """Test a model, or another estimator, on sessions outside its training.

    Every test session is replayed window by window, as live. Ridge regression and extra trees on the same
    features are fitted to the training windows, if available, for comparison.

    Parameters
    ----------
    model
        A model, its folder, its training run's folder, or a bundled model's name.
    data
        Dataset to test on, or its folder; by default the training run's.
    sessions
        Session files, folders or patterns to test on instead of a dataset.
    skip
        Whether to leave out sessions that cannot be used; the notes name them.
    split
        File of the split; by default the training run's split, or the dataset's own.
    part
        Part of the split to test on.
    estimator
        Estimator to test if there is no model; by default ``"closed_form"``.
    settings
        Overrides of the estimator's options, such as ``"tension_law=geometric"``.
    sensor
        Sensor preset whose string the estimator assumes.
    tuned
        Whether to tune that string to each session's untouched beginning.
    noise
        Also test with added noise, such as ``"music:10"``: its kind, and the signal-to-noise ratio in dB.
    suite
        Whether to test with every kind of noise too, at 0 to 25 dB.
    seed
        Random seed of the noise.
    baselines
        Whether to test ridge regression and extra trees too.
    workers, cluster
        Worker processes, or the address of a dask scheduler.
    progress
        Called with the progress; by default there is a bar on a terminal and in a notebook.

    Returns
    -------
    EvaluationReport
        The report: `table` has the rows printed by the command; `write` creates a folder of results.

    Raises
    ------
    InputError
        If an input is unusable, the split leaks, or a session was used for training.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> twin = ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> report = mc.evaluate("demo", sessions=mc.collect("quick", mkdtemp(), settings=twin))
    >>> row = report.table()[0]
    >>> row["object"], row["estimator"], row["position_error"] < 2e-3
    ('plastic', 'model', True)
    """
    if model is not None and estimator is not None:
        raise InputError(f"model {_named(model)} with --estimator {estimator}", "one of both")
    refuse_both(workers, cluster)
    dataset = data.path if isinstance(data, LabelledData | Dataset) else Path(data) if data else None
    if split is None and isinstance(data, LabelledData):
        split = _file_of(data)
    with _folder(model) as folder:
        read = EvaluationSettings(
            model=folder,
            estimator=estimator or DEFAULT_ESTIMATOR,
            options=override({}, settings),
            dataset=dataset,
            split=Path(split) if split else None,
            part=part,
            sessions=tuple(session_names(sessions)),
            skip=skip,
            sensor=None if sensor is None else str(sensor),
            tuned=tuned,
            noises=tuple(noise),
            suite=suite,
            seed=seed,
            baselines=baselines,
        )
        with progress_bar(progress=progress) as report:
            outcome = evaluate_settings(read, Spread(workers=workers, cluster=cluster, progress=report))
    return EvaluationReport(evaluation=outcome, part=part)


def _named(model: str | Path | Model) -> str:
    return "in memory" if isinstance(model, Model) else str(model)


def _file_of(data: LabelledData) -> Path | None:
    """Return the file of a dataset's split where it differs from the dataset's own file."""
    file = data.split_file
    return None if file is None or file.absolute() == (data.path / SPLIT_FILE).absolute() else file


@contextmanager
def _folder(model: str | Path | Model | None) -> Generator[str | None]:
    """Yield a model's folder or name; a model in memory is written to a temporary folder.

    An unchanged model of a training run stays in its folder, since its settings name dataset and split.
    """
    if not isinstance(model, Model):
        yield None if model is None else str(model)
        return
    if isinstance(model, TrainedModel) and _is_on_disk(model):
        yield str(model.run)
        return
    with scratch_folder() as scratch:
        model.save(scratch / "model")
        yield str(scratch / "model")


def _is_on_disk(model: TrainedModel) -> bool:
    """Return whether the folder of a model's run holds exactly this model."""
    return folder_of(model.run) is not None and load(model.run).definition == model.definition
