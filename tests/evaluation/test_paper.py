"""The paper's figures stand only beside what they can be compared with."""

import pytest

from monochord.evaluation.paper import PAPER, reported


def test_the_tables_are_whole_and_in_si_units() -> None:
    for quantity, most in (("position", 0.01), ("force", 0.2)):
        assert set(PAPER[quantity]) == {"plastic", "wood", "metal_tube", "allen_key"}
        for told in PAPER[quantity].values():
            assert set(told) == {"clean", "noise"}
            assert all(
                0.0 < each.mae < most and 0.5 < each.within < 0.9 < 1.2 * each.r for each in told.values()
            )


@pytest.mark.parametrize(
    ("condition", "error"), [("clean", 2.7e-3), ("music", 3.1e-3), ("music 10 dB", 3.1e-3)]
)
def test_music_stands_beside_music(condition: str, error: float) -> None:
    told = reported("position", "plastic", condition)
    assert told is not None
    assert told.mae == error


@pytest.mark.parametrize(
    ("body", "condition"), [("plastic", "white 5 dB"), ("all objects", "clean"), ("", "clean")]
)
def test_nothing_stands_beside_what_the_paper_has_not(body: str, condition: str) -> None:
    assert reported("force", body, condition) is None
