"""What is measured of the far form on real strings, and what is claimed of it under interference."""

import numpy as np
import pytest
from studies._takes import Interferer, Protocol
from studies.far_form import Outcome

from monochord.core.types import Floats
from monochord.evaluation import folder, interference_recordings
from studies import far_form

real = pytest.mark.skipif(folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")


def outcome(error: list[float], plain: list[float]) -> Outcome:
    std: Floats = np.full(len(error), 2e-3)
    return Outcome(
        error=np.array(error),
        std=std,
        noise=0.1 * std,
        plain=np.array(plain),
        take=np.floor(np.arange(len(error), dtype=np.float64) / 2.0),
    )


def test_figures_of_known_errors() -> None:
    result = outcome([0.001, 0.004, np.nan, 0.2], [0.0, 0.3, 0.001, 0.002])
    assert far_form.answered(result) == 0.75
    assert far_form.right(result) == 0.5
    assert far_form.plain_right(result) == 0.75
    assert far_form.gross(result) == pytest.approx(1 / 3)
    assert far_form.beyond(result, 5.0) == pytest.approx(1 / 3)
    assert far_form.beyond(result, 1.0) == pytest.approx(2 / 3)
    low, high = far_form.right_interval(result)
    assert 0.0 <= low <= 0.5 <= high <= 1.0


def test_without_an_answer_there_is_no_share_of_answers() -> None:
    result = outcome([np.nan, np.nan], [0.0, 0.3])
    assert far_form.plain_right(result) == 0.5
    assert np.isnan(far_form.gross(result))


@real
@pytest.mark.parametrize("name", ["198_209_0000", "Kevin_MacLeod_Vibe_Ace"])
def test_gross_errors_are_rare_under_interference(name: str) -> None:
    interferer = Interferer(sound=far_form.loud_half(interference_recordings()[name]), ratio=0.0)
    cases = [case for case in far_form.assumed_cases(19) if case.take.instrument == "growly_static"]
    result = far_form.outcome(cases, Protocol(hop=0.2), interferer, seed=1)
    assert far_form.beyond(result, 5.0) <= 0.15
    assert far_form.right(result) >= far_form.plain_right(result)


@real
def test_music_as_loud_as_a_bowed_bass_hardly_moves_it_by_an_octave() -> None:
    music = far_form.loud_half(interference_recordings()["Kevin_MacLeod_Vibe_Ace"])
    result = far_form.outcome(far_form.bowed_cases(), Protocol(), Interferer(sound=music, ratio=0.0), seed=0)
    assert far_form.gross(result) <= 0.01
    assert far_form.right(result) >= far_form.plain_right(result)
