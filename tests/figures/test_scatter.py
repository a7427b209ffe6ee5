"""The scatter shows what the results hold, and its errors are those of the results."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.figures.scatter import Scatter

Write = Callable[..., Path]


def test_points_are_the_answered_windows_of_each_object(write: Write) -> None:
    page = Scatter(results=write()).draw()
    position, force = page.axes[:2]
    assert (position.get_xlabel(), force.get_ylabel()) == ("true x (mm)", "told F (N)")
    assert "MAE 1 mm" in position.texts[0].get_text()
    assert "MAE 0.05 N" in force.texts[0].get_text()
    assert position.get_legend_handles_labels()[1] == ["plastic", "wood"]
    assert len(position.collections) == 2
    for points in position.collections:
        true, told = np.asarray(points.get_offsets()).T
        assert len(true) == 160 - 16
        inside = (told > true.min()) & (told < true.max())
        np.testing.assert_allclose(np.abs(told - true)[inside], 1.0, atol=1e-9)
    assert page.get_suptitle() == "simulated: made up, clean"


def test_many_windows_are_thinned_and_still_counted(write: Write) -> None:
    axes = Scatter(results=write(), points=10).draw().axes[0]
    assert all(0 < len(np.asarray(points.get_offsets())) <= 10 for points in axes.collections)
    assert "90.0 % of 320 within 5 mm" in axes.texts[0].get_text()


def test_numbers_are_by_object_and_condition(write: Write) -> None:
    file = write(simulated=False)
    clean, noisy = (Scatter(results=file, condition=name).numbers() for name in ("clean", "hum 0 dB"))
    assert clean["simulated"] is False
    assert clean["position"]["wood"]["mae"]["value"] == pytest.approx(1e-3)
    assert clean["position"]["all"]["answered"] == pytest.approx(0.9)
    assert noisy["force"]["all"]["mae"]["value"] == pytest.approx(0.55)
    assert Scatter(results=file).draw().get_suptitle() == "made up, clean"


def test_what_cannot_be_drawn_is_refused(write: Write, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"condition 'hum 5 dB': allowed is clean, hum 0 dB.*did you mean 'hum"
    ):
        Scatter(results=write(), condition="hum 5 dB").draw()
    with pytest.raises(InputError, match="points 0: allowed is 1 or more"):
        Scatter(results=write(), points=0)
    with pytest.raises(InputError, match=r"none\.npz"):
        Scatter(results=tmp_path / "none.npz").draw()
