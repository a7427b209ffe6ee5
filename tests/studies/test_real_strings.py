"""The accuracy that is claimed on real strings, held by a test."""

import numpy as np
import pytest
from studies._takes import Protocol, autocorrelation_errors, recorded_strings
from studies.real_strings import Realstrings

from monochord.evaluation import folder

real = pytest.mark.skipif(folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")


@pytest.fixture(scope="module", params=[0.4, pytest.param(0.1, marks=pytest.mark.slow)])
def figures(request: pytest.FixtureRequest) -> dict[str, float]:
    """The rows of every fourth window, or of all."""
    return {row.name: row.value for row in Realstrings(hop=request.param).run()}


@pytest.mark.slow
@real
def test_position_with_the_open_note_only(figures: dict[str, float]) -> None:
    assert figures["all: mean absolute error"] <= 1.6
    assert figures["all: within 5 mm"] == 100.0
    assert figures["all: answered"] >= 97.0


@real
def test_no_octave_errors(figures: dict[str, float]) -> None:
    assert figures["all: largest error"] < 10.0


@real
def test_one_further_take_helps(figures: dict[str, float]) -> None:
    assert figures["all, one further take: mean absolute error"] <= 1.1


@real
def test_the_baseline_is_a_fair_one() -> None:
    strings = recorded_strings()
    take = strings.fretted["green_plucked B3"][0]
    errors = autocorrelation_errors(take, strings.open_notes["green_plucked B3"].frequency, Protocol())
    assert np.median(np.abs(errors)) < 3e-3
