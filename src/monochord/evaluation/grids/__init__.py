"""What an ablation compares: a whole, and variations that differ from it in one thing each.

Grids are data, one TOML file each in this folder, found by its name.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from monochord.core.config import from_tree
from monochord.core.errors import InputError, did_you_mean
from monochord.core.presets import Presets
from monochord.core.units import Seconds

WHOLE = "whole"
"""Name of the variation that leaves everything in."""
SHARED = "datasets"
"""Folder of the datasets that variations share, each built once, beside the folders of the variations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """How a variation differs from the whole.

    Parameters
    ----------
    config
        Training settings: the name of a preset or a file. By default those of the grid.
    set
        Overrides of training settings, such as ``context.on=false``.
    window, hop
        Length and hop of the windows in s. The hop is the length where only the length is given; None for
        those of the grid's dataset.
    share
        Share of the training sessions that is used, drawn at random.
    sessions
        Other sessions of the same names, such as those recorded with one driver: files, folders, patterns.
    estimator, estimator_set
        An estimator that learns nothing from the dataset, and its options, in place of a training.
    feature
        Name of its rows in the paper's table. By default that of its feature, followed by that of the
        variation if it is another.
    """

    config: str = ""
    set: tuple[str, ...] = ()
    window: Seconds | None = None
    hop: Seconds | None = None
    share: float = 1.0
    sessions: tuple[str, ...] = ()
    estimator: str = ""
    estimator_set: tuple[str, ...] = ()
    feature: str = ""

    def __post_init__(self) -> None:
        if not 0.0 < self.share <= 1.0:
            raise InputError(f"share {self.share:g} of the training sessions", "above 0, up to 1")
        if self.estimator and (self.config or self.set or self.share < 1.0):
            given = f"training settings beside the estimator {self.estimator}"
            raise InputError(given, "one of both", "put options of the estimator into estimator_set")
        if self.estimator_set and not self.estimator:
            raise InputError(
                "estimator_set without an estimator", "its name", 'write estimator = "closed_form"'
            )

    @property
    def is_built(self) -> bool:
        """Whether it needs a dataset of its own."""
        return self.window is not None or self.hop is not None or bool(self.sessions)


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What is compared, and on which data.

    Parameters
    ----------
    title
        Title in a few words.
    config
        Training settings: the name of a preset or a file.
    dataset, split
        Dataset and split of training and evaluation; by default the split in the dataset's folder.
    sessions
        Files, folders or patterns that the dataset was built from, for windows of other lengths.
    sensor
        Preset of the sensor whose string features and estimators are given; empty for that of `config`.
    part
        Part that is evaluated: "validation" to choose by, "test" once all is chosen.
    set
        Overrides of the settings of every training.
    noise
        Noises that are evaluated too, such as ``music:10``.
    seed
        Random seed of the draw of training sessions.
    whole
        Whether the whole is compared too, as the first.
    variations
        Variations by name.
    """

    title: str = ""
    config: str = "paper"
    dataset: Path = Path("dataset")
    split: Path | None = None
    sessions: tuple[str, ...] = ()
    sensor: str = ""
    part: Literal["validation", "test"] = "validation"
    set: tuple[str, ...] = ()
    noise: tuple[str, ...] = ()
    seed: int = 0
    whole: bool = True
    variations: dict[str, Variation] = field(default_factory=dict[str, Variation])

    def __post_init__(self) -> None:
        for name, variation in self.variations.items():
            if not name.replace("_", "").replace("-", "").isalnum() or name in (WHOLE, SHARED):
                allowed = f"letters, digits, - and _, and not '{WHOLE}' or '{SHARED}'"
                raise InputError(f"variation '{name}'", allowed)
            if variation.is_built and not (variation.sessions or self.sessions):
                given = f"variation {name} with windows of its own"
                raise InputError(given, "the sessions to cut them from", "name them: sessions = [...]")
        if not self.compared:
            raise InputError("a grid that compares nothing", "variations, or whole = true")

    @property
    def compared(self) -> dict[str, Variation]:
        """All variations by name, the whole first."""
        return {**({WHOLE: Variation()} if self.whole else {}), **self.variations}

    def only(self, names: Iterable[str]) -> "Grid":
        """Return the grid with only these variations.

        Raises
        ------
        InputError
            For an unknown name.

        Examples
        --------
        >>> grid = Grid(variations={"half": Variation(share=0.5), "tenth": Variation(share=0.1)})
        >>> list(grid.only(["whole", "tenth"]).compared)
        ['whole', 'tenth']
        """
        chosen = list(names)
        for name in chosen:
            if name not in self.compared:
                known = ", ".join(self.compared)
                raise InputError(f"variation '{name}'", known, did_you_mean(name, self.compared))
        variations = {name: variation for name, variation in self.variations.items() if name in chosen}
        return replace(self, whole=WHOLE in chosen, variations=variations)


GRIDS = Presets(
    package=__name__, kind="grid", read=lambda tree, where: from_tree(Grid, tree, where), named=False
)


def grid_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> grid_names()
    ['features', 'parts']
    """
    return GRIDS.names()


def load_grid(name: str, differs: Mapping[str, Any] | None = None, assignments: Sequence[str] = ()) -> Grid:
    """Return the grid of a preset or of a TOML file.

    Parameters
    ----------
    name
        A name of `grid_names`, or the path of a TOML file of the same layout.
    differs
        Values that replace those of the file, by name.
    assignments
        Overrides as text, such as ``variations.one_driver.sessions=["one"]``; they apply last.

    Raises
    ------
    InputError
        If there is no such preset, or the file cannot be used.

    Examples
    --------
    >>> load_grid("parts").part, load_grid("parts", {"part": "test"}).part
    ('validation', 'test')
    """
    return GRIDS.load(name, assignments, differs)
