"""What an ablation compares: a whole, and variations that differ from it in one thing each."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from monochord.core.errors import InputError, did_you_mean
from monochord.core.units import Seconds

WHOLE = "whole"
"""The variation that leaves everything in."""
SHARED = "datasets"
"""Folder of the datasets that variations need, each built once, beside those of the variations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """What differs from the whole.

    Parameters
    ----------
    config
        The training's settings, a preset's name or a file; those of the grid where it is left out.
    set
        Settings of the training, such as ``context.on=false``.
    window, hop
        Length of a window in s, and their distance, which is the length where only that is given; None for
        those of the grid's dataset.
    share
        Of the training sessions, drawn at random.
    sessions
        Other sessions of the same names, such as those that one driver alone made: files, folders, patterns.
    estimator, estimator_set
        One that learns nothing, and its options, in place of a training.
    feature
        What its rows are called; where that is left out, as its feature, and then as the variation, where
        that is another name.
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
            given = f"settings of a training beside the estimator {self.estimator}"
            raise InputError(given, "one of both", "options of an estimator stand in estimator_set")
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
    sensor
        Whose string features and estimators are told; empty for that of `config`, and for none.
    part
        What is judged on: "validation" to choose by, "test" once all is chosen.
    set
        Settings for all that are trained.
    noise
        Also judged in these noises, such as ``music:10``.
    seed
        Of the training sessions that are drawn.
    whole
        Whether what leaves everything in is compared too, as the first.
    variations
        By name.
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
                raise InputError(given, "sessions that they are cut from", "name them: sessions = [...]")
        if not self.compared:
            raise InputError("a grid that compares nothing", "variations, or whole = true")

    @property
    def compared(self) -> dict[str, Variation]:
        """All that is compared, by name, the whole first."""
        return {**({WHOLE: Variation()} if self.whole else {}), **self.variations}

    def only(self, names: Iterable[str]) -> "Grid":
        """Return the grid of these variations alone.

        Raises
        ------
        InputError
            For a name that it has not.

        Examples
        --------
        >>> grid = Grid(variations={"half": Variation(share=0.5), "tenth": Variation(share=0.1)})
        >>> list(grid.only(["whole", "tenth"]).compared)
        ['whole', 'tenth']
        """
        there = self.compared
        wanted = list(names)
        for name in wanted:
            if name not in there:
                raise InputError(f"variation '{name}'", ", ".join(there), did_you_mean(name, there))
        kept = {name: variation for name, variation in self.variations.items() if name in wanted}
        return replace(self, whole=WHOLE in wanted, variations=kept)
