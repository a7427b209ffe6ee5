"""A grid says what is compared, and what cannot be is refused in a line."""

from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.evaluation.grid import WHOLE, Grid, Variation


def test_the_whole_comes_first_unless_it_is_left_out() -> None:
    few = {"few": Variation(share=0.5)}
    assert list(Grid(variations=few).compared) == [WHOLE, "few"]
    assert list(Grid(variations=few, whole=False).compared) == ["few"]
    with pytest.raises(InputError, match="a grid that compares nothing"):
        Grid(whole=False)


def test_only_some_are_compared() -> None:
    grid = Grid(dataset=Path("d"), variations={"few": Variation(share=0.5), "tiny": Variation(share=0.1)})
    assert list(grid.only(["tiny"]).compared) == ["tiny"]
    assert list(grid.only(["tiny", WHOLE]).compared) == [WHOLE, "tiny"]
    with pytest.raises(InputError, match="did you mean 'few'"):
        grid.only(["fwe"])


@pytest.mark.parametrize("name", ["whole", "datasets", "../up", ""])
def test_a_name_that_would_be_another_folder_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"variation '{name}'"):
        Grid(variations={name: Variation()})


@pytest.mark.parametrize(
    ("differs", "line"),
    [
        ({"share": 0.0}, "share 0 of the training sessions"),
        ({"estimator": "closed_form", "config": "tones"}, "beside the estimator closed_form"),
        ({"estimator": "closed_form", "share": 0.5}, "beside the estimator closed_form"),
        ({"estimator": "closed_form", "set": ("context.on=false",)}, "beside the estimator closed_form"),
        ({"estimator_set": ("tension_law=geometric",)}, "estimator_set without an estimator"),
    ],
)
def test_a_variation_that_cannot_be_is_refused(differs: dict[str, object], line: str) -> None:
    with pytest.raises(InputError, match=line):
        Variation(**differs)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("differs", [{"window": 0.05}, {"hop": 0.5}])
def test_other_windows_need_sessions_that_they_are_cut_from(differs: dict[str, float]) -> None:
    variation = Variation(**differs)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="windows of its own"):
        Grid(variations={"other": variation})
    assert Grid(variations={"other": variation}, sessions=("sessions",)).compared["other"].is_built
    assert not Variation(share=0.5).is_built
    assert Variation(sessions=("one",)).is_built
