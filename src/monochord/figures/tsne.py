"""Feature spaces as t-SNE planes, coloured by contact, slip, position and force."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked
from monochord.core.types import Floats, Indices, Signal
from monochord.datasets.store import Dataset, open_dataset
from monochord.figures import _style
from monochord.figures.base import Measured
from monochord.metrics import finite_rows, pearson_r
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
"""Labels that colour the panels, with class names, or a factor and axis label."""
NEIGHBOURS = 10
COMPONENTS = 50
"""Number of principal components used for distances."""
MIN_WINDOWS, MAX_WINDOWS = 100, 5000
BATCH = 64
"""Number of windows read at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tsne(Measured):
    """Windows of a dataset in a plane, similar ones close together, by feature (rows) and label (columns).

    Windows without the label are grey: an untouched window has neither slip nor position. Neighbourhoods are
    meaningful; distances between groups, and the axes, are not (van der Maaten and Hinton 2008).

    Parameters
    ----------
    dataset
        Folder from `monochord build`.
    features
        Names of features, as in `monochord list features`, with default options.
    windows
        Number of windows, drawn from those with a known contact and no lost samples.
    perplexity
        Approximate number of neighbours of a window.
    sensor
        Sensor of the recording; features may use its string.
    seed
        Random seed of the selection and of t-SNE.
    """

    dataset: Path
    features: tuple[str, ...] = ("fft_harmonic",)
    windows: Annotated[int, Meta(ge=MIN_WINDOWS, le=MAX_WINDOWS)] = 1000
    perplexity: Annotated[float, Meta(gt=1.0)] = 30.0
    sensor: str = "prototype"
    seed: int = 0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if not self.features:
            raise InputError("no features", "one or more")
        if self.perplexity >= self.windows / 3.0:
            raise InputError(
                f"perplexity {self.perplexity:g}", f"less than a third of {self.windows} windows"
            )

    def numbers(self) -> dict[str, Any]:
        """Return how well the ten nearest neighbours in the plane predict a window's label.

        For contact and slip, it is the mean share of neighbours with the same label, beside the chance level;
        for position and force, the correlation with the neighbours' mean.
        """
        dataset, rows = self._drawn()
        labels = _labels(dataset, rows)
        return {
            "simulated": _is_simulated(dataset),
            "windows": len(rows),
            **{
                name: {task: _neighbour_scores(places, labels[task], task) for task in TASKS}
                for name, places in self._places(dataset, rows).items()
            },
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
                    _add_key(page, axes, image, task)
            panels[number, 0].set_ylabel(name.replace("_", " "), fontsize=_style.LABEL, color=_style.INK)
        source = f"{len(rows)} windows of {dataset.path.name}"
        title = f"simulated: {source}" if _is_simulated(dataset) else source
        page.suptitle(title, fontsize=_style.LABEL, color=_style.INK)
        return page

    def _drawn(self) -> tuple[Dataset, Indices]:
        dataset = open_dataset(Path(self.dataset))
        rows = np.flatnonzero(dataset.usable & np.isfinite(dataset.label("contact")))
        if len(rows) < MIN_WINDOWS:
            raise InputError(f"{len(rows)} windows with a known contact", f"{MIN_WINDOWS} or more")
        stream = np.random.default_rng(self.seed)
        return dataset, np.sort(stream.choice(rows, min(self.windows, len(rows)), replace=False))

    def _places(self, dataset: Dataset, rows: Indices) -> dict[str, Floats]:
        """Return the windows' positions (n, 2) in each feature's plane."""
        manifest = dataset.manifest
        string = load_sensor(self.sensor).string
        signal = Signal(sample_rate=manifest.sample_rate, channels=manifest.channels, string=string)
        places: dict[str, Floats] = {}
        for name in self.features:
            extract = FEATURES.build(name).prepare(signal, manifest.window)
            parts = [extract(dataset.batch(rows[at : at + BATCH])) for at in range(0, len(rows), BATCH)]
            places[name] = embedded(np.concatenate(parts).astype(np.float64), self.perplexity, self.seed)
        return places


def embedded(rows: Floats, perplexity: float, seed: int = 0) -> Floats:
    """Return positions in a plane (n, 2) where similar rows are close together, by t-SNE.

    Columns of `rows` (n, columns) are standardised, and the first 50 principal components are used;
    `perplexity` is about the number of neighbours of a row. Raises `InputError` if all rows are equal.

    References
    ----------
    van der Maaten and Hinton (2008), Visualizing data using t-SNE, J. Machine Learning Research 9, 2579.
    """
    from sklearn.decomposition import PCA  # noqa: PLC0415
    from sklearn.manifold import TSNE  # noqa: PLC0415
    from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

    varied = rows[:, np.ptp(rows, axis=0) > 0.0]
    if not varied.shape[1]:
        raise InputError(f"{len(rows)} equal rows of features", "rows that differ")
    scaled = StandardScaler().fit_transform(varied)
    components = PCA(min(COMPONENTS, *scaled.shape), random_state=seed).fit_transform(scaled)
    if components.shape[1] == 1:
        components = np.column_stack([components, np.zeros(len(components))])
    return TSNE(2, perplexity=perplexity, init="pca", random_state=seed).fit_transform(components)


def _is_simulated(dataset: Dataset) -> bool:
    return any(part.simulated for part in dataset.manifest.parts)


def _labels(dataset: Dataset, rows: Indices) -> dict[str, Floats]:
    """Return each task's label (n,) of the rows, NaN where there is none."""
    blank = np.full(len(rows), np.nan)
    return {task: dataset.label(task)[rows] if task in dataset.labels else blank for task in TASKS}


def _neighbour_scores(places: Floats, label: Floats, task: str) -> dict[str, float] | None:
    labelled = finite_rows(label)
    values, at = label[labelled], places[labelled]
    if len(values) <= NEIGHBOURS or values.min() == values.max():
        return None
    distances = np.sum((at[:, None] - at) ** 2, axis=2)
    np.fill_diagonal(distances, np.inf)
    theirs = values[np.argpartition(distances, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]]
    if task in ("position", "force"):
        return {"r": pearson_r(values, theirs.mean(axis=1))}
    share = float(values.mean())
    return {"alike": float(np.mean(theirs == values[:, None])), "by_chance": share**2 + (1.0 - share) ** 2}


def _draw(axes: Axes, places: Floats, label: Floats, task: str) -> PathCollection:
    dots = {"s": 3.5, "lw": 0.0, "rasterized": True}
    labelled = finite_rows(label)
    axes.scatter(*places[~labelled].T, color=_style.PALE, alpha=0.35, **dots)
    names = TASKS[task]
    if not isinstance(names[0], str):
        return axes.scatter(*places[labelled].T, c=names[0] * label[labelled], cmap="viridis", **dots)
    shade = np.array(_style.SEGMENTS)[(label[labelled] == 1.0).astype(int)]
    return axes.scatter(*places[labelled].T, c=shade, **dots)


def _add_key(page: Canvas, axes: Axes, image: PathCollection, task: str) -> None:
    names = TASKS[task]
    if not isinstance(names[0], str):
        bar = page.colorbar(image, ax=axes, location="bottom", pad=0.02, aspect=20, shrink=0.9)
        _style.dress_bar(bar, names[1])
        return
    for kind, colour in zip(names, _style.SEGMENTS, strict=True):
        axes.plot([], [], ls="", marker="o", ms=3.5, color=colour, label=kind)
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=2, fontsize=_style.TICK, frameon=False,
        handletextpad=0.1, columnspacing=0.8, labelcolor=_style.INK,
    )  # fmt: skip
