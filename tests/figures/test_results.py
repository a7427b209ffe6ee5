"""Figures of an evaluation show the scores of its results."""

import importlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from threadpoolctl import threadpool_limits

from monochord.core.errors import InputError
from monochord.figures.confusion import Confusion
from monochord.figures.error_map import ErrorMapFigure
from monochord.figures.scatter import Scatter
from monochord.figures.snr_curves import SnrCurves
from monochord.figures.tsne import Tsne, embedded

Write = Callable[..., Path]


def test_scatter_draws_the_answered_windows_and_those_beyond_the_axes_at_their_edge(write: Write) -> None:
    file = write(outliers=7)
    position = Scatter(results=file).draw().axes[0]
    low, high = position.get_ylim()
    assert len(position.collections) == 2
    drawn, edges = 0, dict[str, int]()
    for points in position.collections:
        truth, estimate = np.asarray(points.get_offsets()).T
        np.testing.assert_allclose(np.abs(estimate - truth), 1.0, atol=1e-9)
        drawn += len(truth)
    for marker, edge in (("^", high), ("v", low)):
        lines = [np.asarray(line.get_ydata()) for line in position.lines if line.get_marker() == marker]
        edges[marker] = sum(values.size for values in lines)
        assert {*np.concatenate([np.zeros(0), *lines]).tolist()} <= {edge}
    assert edges["^"] == 7
    assert any(text.get_text().startswith("7 ") for text in position.texts)
    assert drawn + sum(edges.values()) == 2 * (160 - 16)
    thinned = Scatter(results=file, points=10).draw().axes[0]
    assert all(0 < len(np.asarray(points.get_offsets())) <= 10 for points in thinned.collections)


def test_scatter_has_scores_by_object_and_condition(write: Write) -> None:
    file = write(simulated=False)
    clean, noisy = (Scatter(results=file, condition=name).numbers() for name in ("clean", "hum 0 dB"))
    assert clean["simulated"] is False
    assert clean["position"]["wood"]["mae"]["value"] == pytest.approx(1e-3)
    assert clean["position"]["all"]["answered"] == pytest.approx(0.9)
    assert noisy["force"]["all"]["mae"]["value"] == pytest.approx(0.55)


def test_confusion_counts_by_truth_and_estimate(write: Write) -> None:
    figure = Confusion(results=write())
    numbers = figure.numbers()
    assert numbers["contact"] == [[160, 0, 0], [0, 320, 0]]
    assert numbers["slip"] == [[120, 40, 0], [40, 120, 0]]
    shares = np.asarray(figure.draw().axes[1].images[0].get_array())
    np.testing.assert_allclose(shares, [[0.75, 0.25, 0.0], [0.25, 0.75, 0.0]])
    silent = Confusion(results=write(quiet=("contact",)))
    assert silent.numbers()["contact"] == [[0, 0, 160], [0, 0, 320]]
    shares = np.asarray(silent.draw().axes[0].images[0].get_array())
    np.testing.assert_allclose(shares, [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]])  # of each truth


def test_error_maps_have_mean_errors_and_cross_cells_with_few_windows(write: Write) -> None:
    def drawn(figure: ErrorMapFigure, panel: int) -> np.ma.MaskedArray:
        (mesh,) = (one for one in figure.draw().axes[panel].collections if isinstance(one, QuadMesh))
        return np.ma.asarray(mesh.get_array())

    every = ErrorMapFigure(results=write(), least=1)
    np.testing.assert_allclose(drawn(every, 0).compressed(), 1.0)
    np.testing.assert_allclose(drawn(every, 1).compressed(), 0.05)
    figure = ErrorMapFigure(results=write(), least=4)
    cells = figure.numbers()["position"]
    few = (np.array(cells["answered"]) < 4) & (np.array(cells["windows"]) > 0)
    assert 0 < few.sum() < few.size
    assert (drawn(figure, 0).mask == (np.array(cells["answered"]) < 4)).all()
    (crosses,) = figure.draw().axes[0].lines
    assert np.size(crosses.get_xdata()) == few.sum()
    noisy = ErrorMapFigure(results=write(), condition="white 10 dB").numbers()["force"]
    assert (np.sum(noisy["windows"]), np.sum(noisy["answered"])) == (320, 288)


def test_snr_curves_are_the_scores_at_each_ratio(write: Write) -> None:
    def curve(axes: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
        (bars,) = (one for one in axes.containers if one.get_label() == name)
        return np.asarray(bars[0].get_xdata(), np.float64), np.asarray(bars[0].get_ydata(), np.float64)

    position, force, contact, slip = SnrCurves(results=write()).draw().axes[:4]
    for axes, factor in ((position, 1.0), (force, 0.05)):
        for noise in ("white", "hum"):
            ratio, error = curve(axes, noise)
            assert ratio.tolist() == [0.0, 10.0, 20.0]
            np.testing.assert_allclose(error, factor * (1.0 + 10.0 * 10.0 ** (-ratio / 20.0)))
        (clean,) = (line for line in axes.lines if line.get_label() == "clean")
        np.testing.assert_allclose(np.asarray(clean.get_ydata(), np.float64), factor)
    assert curve(contact, "hum")[1].tolist() == [100.0, 100.0, 100.0]
    np.testing.assert_allclose(curve(slip, "hum")[1], 0.75)
    silent = SnrCurves(results=write(quiet=("slip",))).draw().axes[3]
    assert not silent.containers
    curves = SnrCurves(results=write(), draws=20).numbers()["curves"]
    assert len(curves) == 7
    for one in curves:
        assert one["slip"]["low"] <= one["slip"]["value"] <= one["slip"]["high"]
        assert one["position"]["answered"] == pytest.approx(0.9)


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Let t-SNE have one thread: several wait for each other where the machine has other work."""
    importlib.import_module("sklearn.manifold")  # its threads can be limited once they are there
    with threadpool_limits(1):
        yield


@pytest.mark.usefixtures("one_thread")
def test_tsne_draws_every_window_and_keeps_neighbours_together(learnable: Path) -> None:
    figure = Tsne(dataset=learnable, features=("log_mel",), windows=100, perplexity=10.0)
    panels, scores = figure.draw().axes[:4], figure.numbers()
    for axes in panels:
        assert sum(len(np.asarray(dots.get_offsets())) for dots in axes.collections) == 100
    known = np.asarray(panels[2].collections[1].get_array())
    assert 40.0 < known.min() < known.max() < 160.0
    assert scores["simulated"] is True
    contact = scores["log_mel"]["contact"]
    assert contact["alike"] > contact["by_chance"] + 0.2
    assert scores["log_mel"]["position"]["r"] > 0.5


@pytest.mark.usefixtures("one_thread")
def test_tsne_separates_groups_whatever_the_units_of_their_columns() -> None:
    stream, group = np.random.default_rng(0), np.repeat(np.arange(4), 20)
    rows = 3.0 * stream.normal(size=(4, 20))[group] + stream.normal(size=(80, 20))
    places = embedded(np.column_stack([1024.0 * rows, np.full(80, 7.0)]), 10.0)
    distances = ((places[:, None] - places) ** 2).sum(axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = distances.argsort(axis=1)[:, :10]
    assert (group[nearest] == group[:, None]).mean() > 0.99
    with pytest.raises(InputError):
        embedded(np.ones((30, 3)), 5.0)


@pytest.mark.parametrize(
    ("figure", "options", "field"),
    [
        (Scatter, {"condition": "hum 5 dB"}, "condition 'hum 5 dB'"),
        (Scatter, {"points": 0}, "points' = 0"),
        (Scatter, {"results": Path("none.npz")}, "none.npz"),
        (Confusion, {"condition": "noise"}, "condition 'noise'"),
        (ErrorMapFigure, {"least": 0}, "least' = 0"),
        (SnrCurves, {"draws": -1}, "draws' = -1"),
        (SnrCurves, {"noises": False}, "noise"),
        (Tsne, {"features": ()}, "features"),
        (Tsne, {"features": ("log_mell",)}, "log_mell"),
        (Tsne, {"windows": 10}, "windows' = 10"),
        (Tsne, {"perplexity": 400.0}, "perplexity 400"),
        (Tsne, {"dataset": Path("none")}, "none"),
    ],
)
def test_what_cannot_be_drawn_is_refused(
    write: Write, learnable: Path, figure: Any, options: dict[str, Any], field: str
) -> None:
    usual: dict[str, Any] = {"dataset": learnable}
    if figure is not Tsne:
        usual = {"results": write(noises=options.get("noises", True))}
        options = {name: value for name, value in options.items() if name != "noises"}
    with pytest.raises(InputError, match=re.escape(field)):
        figure(**{**usual, **options}).draw()
