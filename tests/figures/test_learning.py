"""The learning figure shows a run's history, the selected epochs and the errors of the mean label."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.config import dump_toml
from monochord.core.errors import InputError
from monochord.figures.learning import BEST, MEAN, Learning
from monochord.perception.training.run_folder import write_history, write_metrics

Run = Callable[..., Path]
FORCE = [0.8, 0.1, 0.3, 0.1]


@pytest.fixture
def write(tmp_path: Path) -> Run:
    """Write a run of four epochs with a probability and two quantities; the best of force is epoch 2."""

    def run(*, done: bool = True, simulated: bool = True, **feature: Any) -> Path:
        tree = {"title": "made up", "feature": {"name": "fft_harmonic", **feature}, "heads": {"slip": {}}}
        (tmp_path / "config.toml").write_text(dump_toml(tree), encoding="utf-8")
        history = [
            {
                "epoch": number,
                "loss": 1.0 - 0.5 * number,
                "slip": 1.0 / number,
                "position": 1e-3,
                "force": off,
            }
            for number, off in enumerate(FORCE, start=1)
        ]
        write_history(tmp_path, history)
        if done:
            heads = {
                "slip": {"baseline_accuracy": 0.75},
                "position": {"baseline_mae": 0.024},
                "force": {"baseline_mae": 0.4},
            }
            write_metrics(tmp_path, {"simulated": simulated, "heads": heads})
        return tmp_path

    return run


def labelled(axes: Any, label: object) -> tuple[list[float], list[float]]:
    (line,) = (line for line in axes.lines if line.get_label() == label)
    return np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist()


def test_each_panel_shows_its_column_of_the_history_the_best_epoch_and_the_mean_label(write: Run) -> None:
    page = Learning(run=write()).draw()
    loss, slip, position, force = (axes for axes in page.axes if axes.get_visible())
    assert labelled(loss, loss.lines[0].get_label()) == ([1, 2, 3, 4], [0.5, 0.0, -0.5, -1.0])
    assert [axes.get_yscale() for axes in (loss, slip, position, force)] == ["linear", "log", "linear", "log"]
    assert labelled(force, BEST) == ([2], [0.1])
    assert labelled(force, MEAN)[1] == [0.4, 0.4]
    assert labelled(slip, BEST) == ([4], [0.25])
    assert labelled(position, MEAN)[1] == pytest.approx([24.0, 24.0])
    assert labelled(slip, MEAN)[1][0] == pytest.approx(-0.75 * math.log(0.75) - 0.25 * math.log(0.25))


def test_a_run_under_way_has_no_mean_label_yet(write: Run) -> None:
    figure = Learning(run=write(done=False, random=True))
    assert all(line.get_label() != MEAN for axes in figure.draw().axes for line in axes.lines)
    numbers = figure.numbers()
    assert (numbers["done"], numbers["simulated"]) == (False, None)


def test_its_numbers_are_json_even_without_an_error(write: Run) -> None:
    run = write()
    table = (run / "history.csv").read_text().replace("0.3\n", "nan\n")
    (run / "history.csv").write_text(table)
    numbers = json.loads(json.dumps(Learning(run=run).numbers(), allow_nan=False))
    assert numbers["epochs"] == [1, 2, 3, 4]
    assert numbers["heads"]["force"] == {
        "unit": "N", "miss": [0.8, 0.1, None, 0.1], "best_epoch": 2, "best": 0.1, "mean_label": 0.4,
    }  # fmt: skip
    assert Learning(run=run).draw().axes


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("config.toml", None),
        ("history.csv", None),
        ("history.csv", ""),
        ("history.csv", "epoch,loss\n"),
        ("history.csv", "epoch,loss\n1,high\n"),
        ("history.csv", "epoch,loss\nnan,0.1\n"),
        ("history.csv", "epoch,force\n1,0.1\n"),
        ("history.csv", f"epoch,loss\n1,{'9' * 200_000}\n"),
        ("metrics.json", "{"),
        ("metrics.json", "[1]"),
        ("metrics.json", "[" * 100_000),
        ("metrics.json", '{"simulated": {}}'),
        ("metrics.json", '{"heads": 1.5}'),
        ("metrics.json", '{"heads": {"force": 1.5}}'),
        ("metrics.json", '{"heads": {"contact": {"baseline_accuracy": "x"}}}'),
    ],
)
def test_a_damaged_run_is_refused(write: Run, name: str, text: str | None) -> None:
    run = write()
    if text is None:
        (run / name).unlink()
    else:
        (run / name).write_text(text)
    with pytest.raises(InputError, match="run" if text is None else name):
        Learning(run=run).draw()
