"""What each part of a perceiver buys: it is trained again without it, and judged by the same rules.

Every variation is trained and evaluated by the programs that a person would start, one after the other, in a
process of their own. What is there already is not made again, so that a grid can be interrupted and grown.
"""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from monochord.config import Tree, from_tree, load_toml, to_tree
from monochord.datasets.build import Options, build_dataset, find_sessions
from monochord.datasets.manifest import FILE, checksum
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.errors import InputError, MonochordError
from monochord.units import Seconds

Told: TypeAlias = Callable[[str, str], None]
"""Is told the name of a variation, and what is being done with it."""
PROGRAM = (sys.executable, "-c", "from monochord.cli import main; main()")
DONE = "variation.json"
"""What a variation was made by, in its folder: written last."""
WHOLE = "whole"
"""The variation that leaves everything in."""


class AblationError(MonochordError):
    """A training or an evaluation of a grid failed; its own line says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """What differs from the whole.

    Parameters
    ----------
    set
        Settings of the training, such as ``context.on=false``.
    window
        Length of a window in s, and their distance; None for that of the grid's dataset.
    share
        Of the training sessions, drawn at random.
    """

    set: tuple[str, ...] = ()
    window: Seconds | None = None
    share: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.share <= 1.0:
            raise InputError(f"share {self.share:g} of the training sessions", "above 0, up to 1")


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What is compared.

    Parameters
    ----------
    title
        In a few words.
    config
        The training's settings: a preset's name, or a file.
    dataset, split
        What is trained and judged on; by default the split in the dataset's folder.
    sessions
        Files, folders or patterns that the dataset was built of, for windows of other lengths.
    part
        What is judged on: "validation" to choose by, "test" once all is chosen.
    set
        Settings for all.
    noise
        Also judged in these noises, such as ``music:10``.
    seed
        Of the training sessions that are drawn.
    variations
        By name.
    """

    title: str = ""
    config: str = "paper"
    dataset: Path
    split: Path | None = None
    sessions: tuple[str, ...] = ()
    part: Literal["validation", "test"] = "validation"
    set: tuple[str, ...] = ()
    noise: tuple[str, ...] = ()
    seed: int = 0
    variations: dict[str, Variation] = field(default_factory=dict[str, Variation])

    @classmethod
    def read(cls, file: Path) -> "Grid":
        """Read a grid from a TOML file; raises `InputError` where it cannot be used."""
        grid = from_tree(cls, load_toml(file), file.name)
        for name, variation in grid.variations.items():
            if not name.replace("_", "").replace("-", "").isalnum() or name == WHOLE:
                allowed = f"letters, digits, - and _, and not '{WHOLE}'"
                raise InputError(f"variation '{name}'", allowed)
            if variation.window is not None and not grid.sessions:
                given = f"variation {name} with windows of its own"
                raise InputError(given, "sessions that they are cut from", "name them: sessions = [...]")
        return replace(grid, variations={WHOLE: Variation(), **grid.variations})


def ablate(grid: Grid, out: Path, told: Told = lambda *_: None) -> dict[str, Tree]:
    """Return the scores of every variation of a grid, as `monochord evaluate --json` gives them.

    Parameters
    ----------
    grid
        What is compared.
    out
        Folder that gets one for each variation, with its run and its report.
    told
        Told of every step.

    Raises
    ------
    InputError
        If the dataset, the split or the sessions cannot be used.
    AblationError
        If a training or an evaluation failed, with its own line.

    Examples
    --------
    ``monochord ablate grid.toml --out ablation`` does so.
    """
    found: dict[str, Tree] = {}
    for name, variation in grid.variations.items():
        found[name] = _scores(grid, name, variation, out / name, told)
    return found


def as_dealt(dataset: Dataset, base: Dataset, split: Split, share: float = 1.0, seed: int = 0) -> Split:
    """Return the split of a dataset that deals sessions as another's does, to a share of those trained on.

    Parameters
    ----------
    dataset
        Of the same sessions, by name.
    base, split
        The other dataset, and its split by whole sessions.
    share
        Of the training sessions that stay, one at least, drawn by `seed`.

    Raises
    ------
    InputError
        If the split cuts sessions, or there is one that the other dataset has not.
    """
    if split.by == "time":
        raise InputError(
            "a split by time for other windows or fewer sessions", "one by session, object or day"
        )
    held = {
        name: sorted({base.manifest.parts[at].name for at in base.session[rows].tolist()})
        for name, rows in split.parts.items()
    }
    names = np.array([part.name for part in dataset.manifest.parts])
    for name in (each for some in held.values() for each in some):
        if name not in names:
            raise InputError(f"sessions without {name}", "all that the split deals out")
    count = max(1, round(share * len(held["train"])))
    held["train"] = sorted(np.random.default_rng(seed).permutation(held["train"])[:count].tolist())
    parts = {name: np.flatnonzero(np.isin(names[dataset.session], some)) for name, some in held.items()}
    left = len(dataset) - sum(len(rows) for rows in parts.values())
    own = checksum(dataset.path / FILE)
    groups = {name: tuple(some) for name, some in held.items()}
    return replace(split, parts=parts, dataset=own, left_out=left, groups=groups)


def _scores(grid: Grid, name: str, variation: Variation, home: Path, told: Told) -> Tree:
    """Return the scores of a variation; make them where they are not there."""
    how = {"grid": to_tree(replace(grid, variations={})), "variation": to_tree(variation)}
    done = home / DONE
    if done.is_file():
        held: Tree = json.loads(done.read_text(encoding="utf-8"))
        if held.get("how") == json.loads(json.dumps(how)):
            return held["scores"]
        given = f"{home}, a variation of another grid"
        raise InputError(given, "a new folder, or the grid that was begun with", "name another --out")
    home.mkdir(parents=True, exist_ok=True)
    told(name, "dataset")
    dataset, split = _material(grid, variation, home)
    settings = [f"dataset={dataset}", f"split={split}", *grid.set, *variation.set]
    told(name, "training")
    _run(name, "train", grid.config, *_each("--set", settings), "--out", str(home / "run"), "--json")
    told(name, "evaluation")
    asked = ["--part", grid.part, *_each("--noise", grid.noise), "--out", str(home / "report"), "--json"]
    scores = json.loads(_run(name, "evaluate", str(home / "run"), *asked))
    done.write_text(json.dumps({"how": how, "scores": scores}) + "\n", encoding="utf-8")
    return scores


def _material(grid: Grid, variation: Variation, home: Path) -> tuple[Path, Path]:
    """Return the dataset and the split of a variation, made where they differ from the grid's."""
    base = open_dataset(grid.dataset)
    file = grid.split or base.path / "split.json"
    if variation.window is None and variation.share == 1.0:
        return base.path, file.absolute()
    dataset = base
    if variation.window is not None:
        folder = home / "dataset"
        options = Options(window=variation.window, hop=variation.window)
        dataset = (
            open_dataset(folder)
            if folder.exists()
            else build_dataset(find_sessions(grid.sessions), folder, options)
        )
    own = home / "split.json"
    as_dealt(dataset, base, Split.read(file), variation.share, grid.seed).write(own)
    return dataset.path, own.absolute()


def _each(option: str, values: Sequence[str]) -> list[str]:
    return [word for value in values for word in (option, value)]


def _run(name: str, *arguments: str) -> str:
    """Return what a verb prints; raise with its own line where it fails."""
    ended = subprocess.run([*PROGRAM, *arguments], capture_output=True, text=True, check=False)  # noqa: S603  (our own)
    if ended.returncode:
        line = (ended.stderr.strip().splitlines() or ["no reason given"])[-1].removeprefix("monochord: ")
        raise AblationError(f"variation {name}, {arguments[0]}: {line}")
    return ended.stdout


def compared(scores: Mapping[str, Tree], condition: str = "clean") -> list[dict[str, Any]]:
    """Return a row for each variation, of all objects: what it has, and how far that is from the whole.

    Examples
    --------
    >>> compared({"whole": {"table": [], "contact": {}, "slip": {}}})
    []
    """
    rows: list[dict[str, Any]] = []
    for name, card in scores.items():
        told = [
            each for each in card["table"] if each["state"] == "touched" and each["condition"] == condition
        ]
        if not told:
            continue
        row = told[-1]  # all objects, where there are several
        contact = card["contact"].get(row["object"], {}).get(condition, {})
        slip = card["slip"].get(row["object"], {}).get(condition, {})
        rows.append(
            {
                "variation": name,
                "windows": row["position"]["windows"],
                "position_mae": row["position"]["mae"]["value"],
                "position_within": row["position"]["within"]["value"],
                "force_mae": row["force"]["mae"]["value"],
                "force_within": row["force"]["within"]["value"],
                "contact_accuracy": contact.get("accuracy", {}).get("value"),
                "slip_area": slip.get("area", {}).get("value"),
                "simulated": card["simulated"],
            }
        )
    return rows
