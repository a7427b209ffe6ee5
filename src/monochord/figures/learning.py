"""The history of a training run: loss, and each head's validation error, by epoch."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path
from string import ascii_uppercase
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import numpy as np

from monochord.core.config import load_toml, table
from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.figures import _style
from monochord.figures.base import Measured
from monochord.perception.heads import HEADS
from monochord.perception.training.run_folder import CONFIG, HISTORY, METRICS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

COLUMNS = 3
SHOWN = {"m": (1e3, "mm")}
"""Display factor and unit by SI unit; other units are drawn unchanged."""
LATEST_EPOCH = 1e9
LOG_RANGE = 3.0
"""A curve whose maximum is this many times its minimum is drawn logarithmically."""
BEST, MEAN = "best epoch, selected", "the mean label"


@dataclass(frozen=True, slots=True, kw_only=True)
class Learning(Measured):
    """Joint loss and each head's validation error over the epochs of a finished or running training.

    The error of a quantity is its mean absolute error, that of a probability its log loss. A dot marks the
    epoch whose weights a head uses. The dashed line is the error of a constant estimate, available once the
    run is finished: the mean training label of a quantity, or the positive share for a probability. Errors
    are over all rows used to select the epoch, augmented ones included.

    Parameters
    ----------
    run
        Folder of a run, from `monochord train`.
    """

    run: Path

    def numbers(self) -> dict[str, Any]:
        """Return epochs and joint loss (n,).

        By head its errors (n,), best epoch and constant-estimate error.
        """
        history, metrics = _history(Path(self.run)), _metrics(Path(self.run))
        epochs = history.pop("epoch").astype(int)
        loss, units = history.pop("loss"), _units(Path(self.run), list(history))
        heads: dict[str, Any] = {}
        for name, miss in history.items():
            best = int(np.nanargmin(miss)) if np.isfinite(miss).any() else None
            heads[name] = {
                "unit": units[name],
                "miss": _plain(miss),
                "best_epoch": None if best is None else int(epochs[best]),
                "best": None if best is None else float(miss[best]),
                "mean_label": _mean_label(metrics.heads.get(name, _Scores())),
            }
        about = {"simulated": metrics.simulated, "done": metrics.done, **_named(Path(self.run))}
        return about | {"epochs": epochs.tolist(), "loss": _plain(loss), "heads": heads}

    def draw(self) -> Canvas:
        """Read the run and draw a panel for the loss and one for each head."""
        numbers = self.numbers()
        heads: dict[str, Any] = numbers["heads"]
        rows = math.ceil((1 + len(heads)) / COLUMNS)
        page = _style.canvas(14.0 + 48.0 * rows)
        panels = page.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
        for axes in panels[1 + len(heads) :]:
            axes.set_visible(False)
        shown = panels[: 1 + len(heads)]
        loss = np.array(numbers["loss"], np.float64)
        _draw(shown[0], numbers["epochs"], loss)
        _style.dress(shown[0], "A", "all heads, training", "epoch", "joint loss")
        for letter, axes, (name, head) in zip(ascii_uppercase[1:], shown[1:], heads.items(), strict=False):
            _draw_head(axes, letter, name, numbers["epochs"], head)
        kind = {True: "simulated: ", False: "", None: "under way: "}
        title = f"{kind[numbers['simulated']]}{numbers['feature']}. {numbers['title']}".rstrip(". ")
        page.suptitle(title, fontsize=_style.LABEL, color=_style.INK)
        _style.key(page, *shown)
        return page


def _draw_head(axes: Axes, letter: str, name: str, epochs: list[int], head: dict[str, Any]) -> None:
    factor, unit = SHOWN.get(head["unit"], (1.0, head["unit"]))
    title = name.replace("_", " ")
    if head["mean_label"] is not None:
        axes.axhline(factor * head["mean_label"], color=_style.PALE, lw=0.8, ls=_style.THEORY, label=MEAN)
    _draw(axes, epochs, factor * np.array(head["miss"], np.float64))
    if head["best"] is not None:
        at, best = head["best_epoch"], factor * head["best"]
        title += f", best {best:.3g} {unit}".rstrip()
        axes.plot([at], [best], ls="", marker="o", ms=4.0, color=_style.SEGMENTS[1], label=BEST)
    _style.dress(axes, letter, title, "epoch", f"mean error ({unit})" if unit else "log loss")


def _draw(axes: Axes, epochs: list[int], values: Floats) -> None:
    """Draw a curve over epochs, logarithmically where it is positive throughout and falls far."""
    from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter  # noqa: PLC0415

    axes.plot(epochs, values, color=_style.SEGMENTS[0], lw=1.1, marker="." if len(epochs) == 1 else "")
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, integer=True))
    axes.tick_params(labelbottom=True)
    finite = values[np.isfinite(values)]
    if not finite.size or finite.min() <= 0.0 or finite.max() < LOG_RANGE * finite.min():
        return
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)))
    axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _history(run: Path) -> dict[str, Floats]:
    """Return the columns (n,) of a run's history by name."""
    file = run / HISTORY
    if not (run / CONFIG).is_file():
        raise InputError(f"run {run} (no {CONFIG} in it)", "a folder from monochord train")
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            names, *lines = list(csv.reader(stream))
        table = np.array(lines, np.float64)
        columns = dict(zip(names, table.T, strict=True))
        known = np.abs(columns["epoch"]) < LATEST_EPOCH
    except FileNotFoundError as error:
        raise InputError(f"run {run} (no epoch done yet)", "a run with at least one epoch") from error
    except (OSError, ValueError, KeyError, csv.Error) as error:
        raise InputError(f"history {file} (damaged)", "a table from monochord train") from error
    if "loss" not in columns or not table.size or not known.all():
        raise InputError(f"history {file} (damaged)", "a table from monochord train")
    return columns


class _Scores(msgspec.Struct):
    """The drawn scores of a head."""

    baseline_mae: float | None = None
    baseline_accuracy: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] | None = None


class _Metrics(msgspec.Struct):
    """The drawn metrics of a run."""

    simulated: bool | None = None
    heads: dict[str, _Scores] = {}
    done: bool = True


def _metrics(run: Path) -> _Metrics:
    """Return the metrics of a run; none while it is running."""
    file = run / METRICS
    if not file.is_file():
        return _Metrics(done=False)
    try:
        return msgspec.convert(json.loads(file.read_text(encoding="utf-8-sig")), _Metrics)
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"metrics {file} (damaged)", "the unchanged output of monochord train") from error


def _units(run: Path, names: list[str]) -> dict[str, str]:
    """Return each head's unit from the settings; empty for a probability."""
    options = table(load_toml(run / CONFIG), "heads")
    return {name: HEADS.build(name, table(options, name)).task().unit for name in names}


def _named(run: Path) -> dict[str, str]:
    """Return the run's title and feature from its settings."""
    settings = load_toml(run / CONFIG)
    feature = table(settings, "feature")
    name = str(feature.get("name", "")).replace("_", " ")
    name += ", random weights" if feature.get("random") is True else ""
    return {"title": str(settings.get("title", "")), "feature": name}


def _mean_label(scores: _Scores) -> float | None:
    """Return the error of a constant estimate from a head's scores.

    For a probability, it is the entropy of the more frequent label's share.
    """
    if scores.baseline_mae is not None or scores.baseline_accuracy is None:
        return scores.baseline_mae
    share = scores.baseline_accuracy
    return -sum(part * math.log(part) for part in (share, 1.0 - share) if part > 0.0)


def _plain(values: Floats) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
