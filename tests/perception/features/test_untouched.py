"""The untouched string's numbers, of sound that is known."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES

Sing = Callable[..., Audio]
SIZE = 4410


def told(signal: Signal, window: Audio) -> dict[str, float]:
    extract = FEATURES.build("untouched").prepare(signal, window.shape[1])
    return dict(zip(extract.columns, extract(window[np.newaxis])[0].tolist(), strict=True))


@pytest.mark.parametrize("tension", [64.5, 65.0, 65.6])
@pytest.mark.parametrize("modes", [(1, 1), (1, 2), (2, 3), (3, 3)])
def test_tension_is_told_whichever_modes_the_drivers_hold(
    signal: Signal, sing: Sing, tension: float, modes: tuple[int, int]
) -> None:
    row = told(signal, sing(None, modes, tension=tension))
    assert row["tension"] == pytest.approx(tension, abs=0.03)
    assert row["open"] == pytest.approx(1000.0 * (np.sqrt(tension / 65.0) - 1.0), abs=0.2)
    assert row["spread"] < 0.3
    assert row["held 1"] in modes


def test_a_partial_that_is_not_heard_says_what_the_others_say(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(None, (2, 2), tension=65.4))
    assert [row[f"partial {n} offset"] for n in range(1, 7)] == pytest.approx([row["open"]] * 6)
    assert row["partial 2 level"] == 0.0
    assert row["partial 5 level"] == -3.0


def test_a_partial_out_of_tune_is_told(signal: Signal, sing: Sing) -> None:
    pulled = np.sin(2.0 * np.pi * 3.0 * 1010.565 * 0.998 * np.arange(SIZE) / 44100.0)
    row = told(signal, sing(None, (1, 1)) + (0.1 * pulled).astype(np.float32))
    assert row["open"] == pytest.approx(0.0, abs=0.05)
    assert row["partial 3 offset"] == pytest.approx(-2.7, abs=0.3)
    assert row["spread"] == pytest.approx(-row["partial 3 offset"] + row["open"], abs=1e-3)


def test_level_is_the_mean_square(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(None, (1, 1), loud=0.2))
    assert row["level 1"] == pytest.approx(np.log10(0.02), abs=0.01)


def test_a_touched_string_scores_low(signal: Signal, sing: Sing) -> None:
    assert told(signal, sing(None, (1, 2)))["score"] > 0.5
    assert told(signal, sing(0.083, (1, 2)))["score"] < 0.0
