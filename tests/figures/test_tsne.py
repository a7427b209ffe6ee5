"""Planes of a real dataset: every window is drawn, and what can be heard keeps together."""

from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.datasets.build import build_dataset
from monochord.figures.tsne import Tsne
from monochord.lab.offline import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("tsne")
    sessions = [make(one, home).path for one in assignments(load_plan("small"))]
    return build_dataset(sessions, home / "dataset").path


def test_a_row_for_each_feature_a_column_for_each_task(dataset: Path) -> None:
    page = Tsne(dataset=dataset, features=("log_mel",), windows=120, perplexity=10.0).draw()
    panels = page.axes[:4]
    assert [axes.get_title() for axes in panels] == ["contact", "slip", "position", "force"]
    assert panels[0].get_ylabel() == "log mel"
    for axes in panels:
        drawn = [len(np.asarray(dots.get_offsets())) for dots in axes.collections]
        assert sum(drawn) == 120
    assert page.get_suptitle() == "simulated: 120 windows of dataset"
    assert [bar.get_xlabel() for bar in page.axes[4:]] == ["x (mm)", "F (N)"]
    known = np.asarray(panels[2].collections[1].get_array())
    assert 40.0 < known.min() < known.max() < 160.0


def test_neighbours_tell_contact_and_position_better_than_chance(dataset: Path) -> None:
    figure = Tsne(dataset=dataset, windows=200, perplexity=10.0)
    told = figure.numbers()
    assert told["simulated"] is True
    contact = told["log_mel"]["contact"]
    assert contact["alike"] > contact["by_chance"] + 0.2
    assert told["log_mel"]["position"]["r"] > 0.5
    assert figure.numbers() == told


def test_what_cannot_be_drawn_is_refused(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no features: allowed is one or more"):
        Tsne(dataset=dataset, features=())
    with pytest.raises(InputError, match="windows 10: allowed is 100 to 5000"):
        Tsne(dataset=dataset, windows=10)
    with pytest.raises(InputError, match=r"feature 'log_mell'.*did you mean 'log_mel'"):
        Tsne(dataset=dataset, features=("log_mell",)).draw()
    with pytest.raises(InputError, match="a folder that monochord build made"):
        Tsne(dataset=tmp_path).draw()
