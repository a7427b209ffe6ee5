"""A dataset into a model: what ``monochord train`` does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from monochord.core.config import load_toml, override, to_tree
from monochord.core.files import replacing
from monochord.core.progress import progress_bar
from monochord.core.ranges import Count, checked
from monochord.core.types import Progress
from monochord.core.workers import refuse_both
from monochord.datasets.split import SPLIT_FILE
from monochord.datasets.store import Dataset
from monochord.figures import FIGURES
from monochord.perception.data import LabelledData
from monochord.perception.heads.base import Task
from monochord.perception.model import Model
from monochord.perception.training.choice import MethodChoice
from monochord.perception.training.configs import DEFAULT, config_path
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import HeadScores
from monochord.perception.training.train import train as train_model

SHOWN = {"m": "mm"}
"""Displayed unit by SI unit; other units are shown unchanged."""
LEARNING = "learning"
"""The figure that is drawn into the folder of a run, under its own name."""


@dataclass(frozen=True, kw_only=True)
class TrainedModel(Model):
    """A trained model, with the folder of its `run`, its `scores` and `choices` by head, and its `epochs`.

    The scores are those of the validation part, in SI units: of a quantity ``windows``, ``mae``,
    ``median_error``, ``r``, ``std`` and ``baseline_mae``, of contact and slip ``windows``, ``accuracy``,
    ``auc`` and ``baseline_accuracy``. A choice is the `method` of a head, with the validation `errors` of all
    methods that were tried. `left_out` says how to install PyTorch if no network was tried without it.
    """

    run: Path
    scores: Mapping[str, HeadScores] = field(repr=False)
    epochs: int
    choices: Mapping[str, MethodChoice] = field(repr=False)
    left_out: str = ""

    __repr__ = Model.__repr__

    def tree(self) -> dict[str, Any]:
        """Return the run, the scores and the checksum of the weights as plain values."""
        return {
            "path": str(self.run),
            "simulated": self.definition.simulated,
            "feature": self.definition.feature.name,
            "epochs": self.epochs,
            "part": "validation",
            "heads": self.scores,
            "methods": to_tree(self.choices),
            "weights": self.definition.weights,
        }

    def lines(self) -> list[str]:
        """Return the run and its scores as lines of text, in a person's units."""
        definition = self.definition
        kind = ", simulated" if definition.simulated else ""
        tasks = {name: record.task for name, record in definition.heads.items()}
        noises = next((", ".join(choice.noises) for choice in self.choices.values()), "")
        in_noise = f", in quiet and in noise ({noises})" if noises else ""
        return [
            f"{self.run}{kind}: feature {definition.feature.name}, {self.epochs} epochs",
            f"the method with the smallest error on the validation part{in_noise}:",
            *choice_lines(self.choices, tasks),
            "on the validation part, which chose the method of each head and its calibration:",
            *score_lines(self.scores, tasks),
        ]


@checked
def train(
    data: LabelledData | Dataset | str | Path | None = None,
    out: str | Path = "run",
    *,
    config: str | Path = DEFAULT,
    settings: Sequence[str] = (),
    workers: Count | None = None,
    cluster: str = "",
    progress: Progress | None = None,
) -> TrainedModel:
    """Train a model on a dataset, or go on where a run of the same settings was interrupted.

    Each head is learned by a network, by ridge regression and by extra trees, and keeps the method with the
    smallest error on the validation part, in quiet and in each kind of noise of the training. Without
    PyTorch, the network is left out.

    The folder of the run holds its settings, its history, also drawn where matplotlib is installed, the model
    and its scores on the validation part.

    Parameters
    ----------
    data
        What `build` or `load_dataset` returned, or the dataset's folder; that of `config` by default.
    out
        Run folder: a new one, or that of an interrupted run with the same settings.
    config
        A preset's name or a TOML file; by default that of the published results.
    settings
        Overrides of the configuration, such as ``"optimiser.epochs=20"``.
    workers, cluster
        Processes that compute the features, or the address of a dask scheduler.
    progress
        Called with the progress; by default there is a bar on a terminal and in a notebook.

    Returns
    -------
    TrainedModel
        The model, with its run's folder, its scores and its epochs.

    Raises
    ------
    InputError
        If a setting, the dataset or the split cannot be used, `out` is something else, or the network is the
        only method and PyTorch is not installed: the error says how to install it.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> folder, twin = mkdtemp(), ["groups=[{name='hold', sessions=3, grid=[3, 2], hold=0.3}]"]
    >>> data = mc.build(mc.collect("quick", f"{folder}/sessions", settings=twin), f"{folder}/dataset")
    >>> few = ["heads={contact={}, position={}}", "optimiser.epochs=2"]
    >>> model = mc.train(data, f"{folder}/run", settings=few)
    >>> model.epochs, sorted(model.scores)
    (2, ['contact', 'position'])
    """
    refuse_both(workers, cluster)
    tree = load_toml(config_path(str(config)))
    if data is not None:
        path = data.path if isinstance(data, LabelledData | Dataset) else Path(data)
        tree["dataset"] = str(path)
        file = data.split_file if isinstance(data, LabelledData) else None
        if file is not None and file.absolute() != (path / SPLIT_FILE).absolute():
            tree["split"] = str(file)
    read, folder = TrainingSettings.read(override(tree, settings)), Path(out)
    with progress_bar("windows", progress) as report:
        result = train_model(read, folder, report, workers=workers, cluster=cluster)
    if result.epochs:
        _draw(folder)
    known = {each.name: getattr(result.model, each.name) for each in fields(Model)}
    return TrainedModel(
        **known,
        run=folder,
        scores=result.scores,
        epochs=result.epochs,
        choices=result.choices,
        left_out=result.left_out,
    )


def choice_lines(choices: Mapping[str, MethodChoice], tasks: Mapping[str, Task]) -> list[str]:
    """Return each head's method with its error, and those of the other methods, as lines of text."""
    lines: list[str] = []
    for name, choice in choices.items():
        unit = "log loss" if tasks[name].is_probability else SHOWN.get(tasks[name].unit, tasks[name].unit)
        factor = 1e3 if unit == "mm" else 1.0
        reached, *others = (
            f"{method.replace('_', ' ')} {factor * choice.errors[method]:.3g}"
            for method in sorted(choice.errors, key=lambda method: method != choice.method)
        )
        beside = f" ({', '.join(others)})" if others else ""
        lines.append(f"  {name:<10} {reached} {unit}{beside}")
    return lines


def score_lines(scores: Mapping[str, HeadScores], tasks: Mapping[str, Task]) -> list[str]:
    """Return scores by head as lines of text, with the units that a person reads."""
    lines: list[str] = []
    for name, score in scores.items():
        count = f"{score['windows']:.0f} windows"
        if tasks[name].is_probability:
            text = f"{100 * score['accuracy']:.2f} % right, area under the curve {score['auc']:.4f}"
            text += f" ({count}; always the same answer: {100 * score['baseline_accuracy']:.1f} %)"
        else:
            factor, unit = (1e3, "mm") if tasks[name].unit == "m" else (1.0, tasks[name].unit)
            error, std, mean = (f"{factor * score[key]:.3g} {unit}" for key in ("mae", "std", "baseline_mae"))
            text = f"mean error {error}, stated +-{std} (median), r {score['r']:.3f}"
            text += f" ({count}; the mean label: {mean})"
        lines.append(f"  {name:<10} {text}")
    return lines


def _draw(out: Path) -> None:
    """Draw the history of a run into its folder if matplotlib is installed; equal runs give equal bytes."""
    if find_spec("matplotlib") is None:
        return
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context({"svg.hashsalt": LEARNING}):
        figure = FIGURES.build(LEARNING, {"run": str(out)}).draw()
        with replacing(out / f"{LEARNING}.svg") as part:
            figure.savefig(part, metadata={"Date": None})
