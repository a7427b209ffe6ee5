"""The paper's tables by feature: every variation is trained and evaluated by the same rules.

Makes `docs/results/paper.json` from the plan `paper`, in some five hours on two cores (half an hour
without the transformer):

`features.toml` lists the variations. Those with YAMNet need its package and weights
(`packages/monochord-yamnet/README.md`). Existing runs in the folder of `--out` are kept.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from studies._command import main

from monochord.core.config import from_tree, override
from monochord.core.errors import InputError, did_you_mean
from monochord.core.units import Seconds
from monochord.datasets import BuildOptions, Dataset, Split, build_dataset, find_sessions, open_dataset
from monochord.evaluation import EvaluationSettings, evaluate, keep_rows, paper_rows, write
from monochord.perception.training import TrainingSettings, config_path, train

VARIATIONS = Path(__file__).parent / "features.toml"
SENSOR, NOISE = "prototype", ("music:10",)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """A variation to train, or an estimator to evaluate unchanged.

    Parameters
    ----------
    feature
        Name of its rows; by default the feature's name.
    config, set
        Training preset, and overrides of it.
    hop
        Hop in s of a separate dataset; None for the original dataset.
    estimator, estimator_set
        An estimator without training, and its options, instead of a training.
    """

    feature: str = ""
    config: str = "paper"
    set: tuple[str, ...] = ()
    hop: Seconds | None = None
    estimator: str = ""
    estimator_set: tuple[str, ...] = ()


def variations(file: Path = VARIATIONS) -> dict[str, Variation]:
    """Return a file's variations by name."""
    tree = tomllib.loads(file.read_text(encoding="utf-8"))
    return {name: from_tree(Variation, own, name) for name, own in tree.items()}


def split_like(dataset: Dataset, base: Dataset, split: Split) -> Split:
    """Return a dataset's split with sessions in the same parts as in another dataset's split.

    Raises
    ------
    InputError
        If the split cuts sessions, or the dataset lacks one of its sessions.
    """
    if split.by == "time":
        raise InputError("a split by time for other windows", "one by session, object or day")
    names = np.array([part.name for part in dataset.manifest.parts])
    groups = {
        name: sorted({base.manifest.parts[at].name for at in base.session[rows].tolist()})
        for name, rows in split.parts.items()
    }
    absent = {name for group in groups.values() for name in group} - set(names.tolist())
    if absent:
        raise InputError(f"sessions without {min(absent)}", "all sessions of the split")
    parts = {name: np.flatnonzero(np.isin(names[dataset.session], group)) for name, group in groups.items()}
    return replace(
        split,
        parts=parts,
        dataset=dataset.checksum,
        left_out=len(dataset) - sum(len(rows) for rows in parts.values()),
        groups={name: tuple(group) for name, group in groups.items()},
    )


def data_of(variation: Variation, base: Dataset, sessions: Sequence[str], folder: Path) -> tuple[Path, Path]:
    """Return a variation's dataset and split, building them where its hop differs."""
    split = base.path / "split.json"
    if variation.hop is None:
        return base.path, split
    home = folder / f"every_{1e3 * variation.hop:g}ms"
    if not home.exists():
        window = base.manifest.window / base.manifest.sample_rate
        own = build_dataset(find_sessions(sessions), home, BuildOptions(window=window, hop=variation.hop))
        split_like(own, base, Split.read(split)).write(home / "split.json")
    return home, home / "split.json"


def settings_of(variation: Variation, dataset: Path, split: Path, run: Path) -> EvaluationSettings:
    """Return the settings of a variation's evaluation, training it first if needed."""
    common = EvaluationSettings(dataset=dataset, split=split, noises=NOISE)
    if variation.estimator:
        options = override({}, variation.estimator_set)
        return replace(common, estimator=variation.estimator, options=options, sensor=SENSOR)
    if not (run / "model").exists():
        train(training_of(variation, dataset=str(dataset), split=str(split), sensor=SENSOR), run)
    return replace(common, model=str(run))


def training_of(variation: Variation, **values: str) -> TrainingSettings:
    """Return a variation's training settings, with its paths and sensor."""
    tree = tomllib.loads(config_path(variation.config).read_text(encoding="utf-8"))
    return TrainingSettings.read(override({**tree, **values}, variation.set))


@click.command()
@click.option(
    "--dataset",
    type=click.Path(path_type=Path),
    required=True,
    help="Dataset of 'monochord build', with its split.",
)
@click.option("--sessions", multiple=True, required=True, help="Sessions of the dataset; repeatable.")
@click.option("--only", multiple=True, metavar="NAME", help="Only this variation; repeatable.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("ablation"), show_default=True)
@click.option(
    "--rows", type=click.Path(path_type=Path), help="Save the rows in this file, and a page beside it."
)
def ablation(
    *, dataset: Path, sessions: tuple[str, ...], only: tuple[str, ...], out: Path, rows: Path | None
) -> None:
    """Train and evaluate every variation, and save its rows of the paper's tables."""
    base, known = open_dataset(dataset), variations()
    for name in only:
        if name not in known:
            raise InputError(f"variation '{name}'", ", ".join(known), did_you_mean(name, known))
    for name in only or known:  # a feature that is not installed is told now, not after hours
        if not known[name].estimator:
            training_of(known[name]).resolved()
    for name in only or known:
        print(f"{name} ...", flush=True)
        variation, home = known[name], out / name
        data, split = data_of(variation, base, sessions, out)
        outcome = evaluate(settings_of(variation, data, split, home / "run"))
        write(home / "report", outcome)
        if rows is not None:
            keep_rows(rows, paper_rows(outcome.card, variation.feature or outcome.label, "test"))


if __name__ == "__main__":
    main(ablation)
