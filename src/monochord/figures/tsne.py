"""How features lay out windows: t-SNE planes, coloured by contact, slip, position and force."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, Signal
from monochord.datasets.store import Dataset, Indices, open_dataset
from monochord.evaluation.tsne import MOST_ROWS, tsne
from monochord.figures import _style
from monochord.figures.base import Measured
from monochord.metrics import known, pearson_r
from monochord.perception.features import FEATURES
from monochord.physics.sensors import load_sensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PathCollection
    from matplotlib.figure import Figure as Canvas

TASKS = {
    "contact": ("untouched", "touched"),
    "slip": ("at rest", "sliding"),
    "position": (1e3, "x (mm)"),
    "force": (1.0, "F (N)"),
}
"""Labels that panels are coloured by: what no and yes are called, or a factor and what is shown."""
NEIGHBOURS = 10
BATCH = 64
"""Windows whose samples are read at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tsne(Measured):
    """Windows of a dataset in a plane, alike ones together, by feature (rows) and label (columns).

    Grey windows have no such label: untouched ones neither slip nor have a place. What stands near what means
    something; distances between groups, and the axes, do not.

    Parameters
    ----------
    dataset
        Folder that `monochord build` made.
    features
        Names of features, as `monochord list features` has them, with their defaults.
    windows
        Drawn by chance from those whose contact is known and whose every sample was recorded.
    perplexity
        About how many neighbours a window has.
    sensor
        Design of the sensor that was recorded, whose string features may use.
    seed
        Of what is drawn.
    """

    dataset: Path
    features: tuple[str, ...] = ("log_mel",)
    windows: int = 1000
    perplexity: float = 30.0
    sensor: str = "prototype"
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.features:
            raise InputError("no features", "one or more")
        if not 100 <= self.windows <= MOST_ROWS:
            raise InputError(f"windows {self.windows}", f"100 to {MOST_ROWS}")

    def numbers(self) -> dict[str, Any]:
        """Return how much a window's ten neighbours in the plane tell of it, by feature and label.

        Of contact and slip it is the mean share of neighbours of its own kind, beside the one that chance
        would give; of position and force the correlation with the neighbours' mean.
        """
        dataset, rows = self._drawn()
        labels = _labels(dataset, rows)
        told = {"simulated": _simulated(dataset), "windows": len(rows)}
        return told | {
            name: {task: _neighbourly(places, labels[task], task) for task in TASKS}
            for name, places in self._places(dataset, rows).items()
        }

    def draw(self) -> Canvas:
        """Compute the features and their planes, and draw them."""
        dataset, rows = self._drawn()
        labels = _labels(dataset, rows)
        page = _style.canvas(14.0 + 46.0 * len(self.features))
        panels = page.subplots(len(self.features), len(TASKS), squeeze=False)
        for number, (name, places) in enumerate(self._places(dataset, rows).items()):
            for axes, task in zip(panels[number], TASKS, strict=True):
                image = _draw(axes, places, labels[task], task)
                _style.dress(axes, "", "" if number else task, "", "")
                axes.set(xticks=[], yticks=[])
                if number == len(self.features) - 1:
                    _explain(page, axes, image, task)
            panels[number, 0].set_ylabel(name.replace("_", " "), fontsize=_style.LABEL, color=_style.INK)
        source = f"{len(rows)} windows of {dataset.path.name}"
        title = f"simulated: {source}" if _simulated(dataset) else source
        page.suptitle(title, fontsize=_style.LABEL, color=_style.INK)
        return page

    def _drawn(self) -> tuple[Dataset, Indices]:
        dataset = open_dataset(Path(self.dataset))
        there = np.flatnonzero(dataset.usable & np.isfinite(dataset.label("contact")))
        if len(there) < 100:
            raise InputError(f"{len(there)} windows whose contact is known", "100 or more")
        stream = np.random.default_rng(self.seed)
        return dataset, np.sort(stream.choice(there, min(self.windows, len(there)), replace=False))

    def _places(self, dataset: Dataset, rows: Indices) -> dict[str, Floats]:
        told = dataset.manifest
        string = load_sensor(self.sensor).string
        signal = Signal(sample_rate=told.sample_rate, channels=told.channels, string=string)
        places: dict[str, Floats] = {}
        for name in self.features:
            extract = FEATURES.build(name).prepare(signal, told.window)
            parts = [extract(dataset.batch(rows[at : at + BATCH])) for at in range(0, len(rows), BATCH)]
            places[name] = tsne(np.concatenate(parts).astype(np.float64), perplexity=self.perplexity)
        return places


def _simulated(dataset: Dataset) -> bool:
    return any(part.simulated for part in dataset.manifest.parts)


def _labels(dataset: Dataset, rows: Indices) -> dict[str, Floats]:
    """Return each task's label (n,) of rows, NaN where there is none."""
    blank = np.full(len(rows), np.nan)
    return {task: dataset.label(task)[rows] if task in dataset.labels else blank for task in TASKS}


def _neighbourly(places: Floats, label: Floats, task: str) -> dict[str, float] | None:
    some = known(label)
    own, at = label[some], places[some]
    if len(own) <= NEIGHBOURS or own.min() == own.max():
        return None
    apart = np.sum((at[:, None] - at) ** 2, axis=2)
    np.fill_diagonal(apart, np.inf)
    theirs = own[np.argpartition(apart, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]]
    if task in ("position", "force"):
        return {"r": pearson_r(own, theirs.mean(axis=1))}
    share = float(own.mean())
    return {"alike": float(np.mean(theirs == own[:, None])), "by_chance": share**2 + (1.0 - share) ** 2}


def _draw(axes: Axes, places: Floats, label: Floats, task: str) -> PathCollection:
    dots = {"s": 3.5, "lw": 0.0, "rasterized": True}
    some = known(label)
    axes.scatter(*places[~some].T, color=_style.PALE, alpha=0.35, **dots)
    name = TASKS[task]
    if not isinstance(name[0], str):
        return axes.scatter(*places[some].T, c=name[0] * label[some], cmap="viridis", **dots)
    shade = np.array(_style.SEGMENTS)[(label[some] == 1.0).astype(int)]
    return axes.scatter(*places[some].T, c=shade, **dots)


def _explain(page: Canvas, axes: Axes, image: PathCollection, task: str) -> None:
    name = TASKS[task]
    if not isinstance(name[0], str):
        bar = page.colorbar(image, ax=axes, location="bottom", pad=0.02, aspect=20, shrink=0.9)
        _style.dress_bar(bar, name[1])
        return
    for kind, colour in zip(name, _style.SEGMENTS, strict=True):
        axes.plot([], [], ls="", marker="o", ms=3.5, color=colour, label=kind)
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, fontsize=_style.TICK, frameon=False,
        handletextpad=0.1, columnspacing=0.8, labelcolor=_style.INK,
    )  # fmt: skip
