"""The features of the closed form and of the untouched string, on sound whose physics is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES
from monochord.physics.theory import geometric_tension

Sing = Callable[..., Audio]
Row = Callable[..., dict[str, float]]
SIZE = 4410
FLAGS = ("no reading", "two candidates", "untouched", "silence", "samples that are not numbers", "clipped")


def flags(row: dict[str, float]) -> set[str]:
    return {flag for flag in FLAGS if row[flag] == 1.0}


@pytest.mark.parametrize(
    ("position", "force", "modes"), [(0.06, 1.5, (1, 1)), (0.083, 0.8, (1, 3)), (0.14, 2.0, (2, 1))]
)
def test_position_tension_and_force_of_a_touch(
    row: Row, signal: Signal, sing: Sing, position: float, force: float, modes: tuple[int, int]
) -> None:
    assert signal.string is not None
    tension = geometric_tension(signal.string, position, force)
    columns = row("closed_form", sing(position, modes, tension=tension))
    assert columns["position"] == pytest.approx(position, abs=5e-5)
    assert columns["tension"] == pytest.approx(tension, abs=5e-3)
    assert columns["force"] == pytest.approx(force, abs=0.05)
    assert (columns["mode 1"], columns["mode 2"]) == modes
    assert columns["line 1"] == pytest.approx(modes[0] * columns["fundamental 1"], rel=0.02)
    assert columns["share 1"] > 0.8
    assert columns["share 2"] < 0.2
    assert columns["left over"] == 0.0
    assert flags(columns) <= {"two candidates"}


def test_an_untouched_string_is_flagged(row: Row, sing: Sing) -> None:
    columns = row("closed_form", sing(None, (1, 3), tension=64.8))
    assert "untouched" in flags(columns)
    assert columns["contact"] < 0.0
    assert columns["rest"] == pytest.approx(1000.0 * (np.sqrt(64.8 / 65.0) - 1.0), abs=0.05)


def test_two_similar_scores_are_two_candidates(row: Row, sing: Sing) -> None:
    columns = row("closed_form", sing(0.0664, (1, 2)))
    assert flags(columns) == {"two candidates"}
    assert 0.0 < columns["lead"] < 1.75  # nepers of odds
    places = sorted((columns["position"], columns["rival position"]))  # one is the other from the other end
    assert places == [pytest.approx(0.0664, abs=5e-5), pytest.approx(0.133, abs=1e-3)]
    assert not flags(row("closed_form", sing(0.0664, (1, 2)), margin=0.1))


@pytest.mark.parametrize(
    ("window", "reasons"),
    [
        (np.zeros((2, SIZE)), {"no reading", "silence"}),
        (np.full((2, SIZE), np.nan), {"no reading", "samples that are not numbers"}),
        (np.sign(np.sin(np.arange(2.0 * SIZE))).reshape(2, SIZE), {"clipped"}),
    ],
)
def test_an_unusable_window_is_flagged(row: Row, window: Audio, reasons: set[str]) -> None:
    columns = row("closed_form", window.astype(np.float32))
    assert reasons <= flags(columns)
    assert all(np.isfinite(value) for value in columns.values())


def test_noise_is_mostly_unexplained(row: Row) -> None:
    columns = row("closed_form", 0.1 * np.random.default_rng(1).standard_normal((2, SIZE)).astype(np.float32))
    assert columns["score"] < 0.3
    assert columns["left over"] > 0.3


def test_a_flexible_string_has_no_force(signal: Signal, sing: Sing) -> None:
    assert signal.string is not None
    flexible = replace(signal, string=replace(signal.string, core_diameter=0.0))
    extract = FEATURES.build("closed_form").prepare(flexible, SIZE)
    assert extract(sing(0.083, tension=65.5)[np.newaxis])[0, extract.columns.index("force")] == 0.0


@pytest.mark.parametrize("options", [{"margin": -0.1}, {"margin": np.inf}, {"most_force": 0.0}])
def test_bad_options_are_refused(signal: Signal, options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        FEATURES.build("closed_form", options).prepare(signal, SIZE)


class TestUntouched:
    @pytest.mark.parametrize(
        ("tension", "modes"), [(64.5, (1, 1)), (65.6, (1, 2)), (65.0, (2, 3)), (64.5, (3, 3))]
    )
    def test_tension_whichever_modes_the_drivers_sustain(
        self, row: Row, sing: Sing, tension: float, modes: tuple[int, int]
    ) -> None:
        columns = row("untouched", sing(None, modes, tension=tension))
        assert columns["tension"] == pytest.approx(tension, abs=0.03)
        assert columns["open"] == pytest.approx(1000.0 * (np.sqrt(tension / 65.0) - 1.0), abs=0.2)
        assert columns["spread"] < 0.3
        assert columns["held 1"] in modes

    def test_an_inaudible_partial_repeats_the_open_frequency(self, row: Row, sing: Sing) -> None:
        columns = row("untouched", sing(None, (2, 2), tension=65.4))
        offsets = [columns[f"partial {n} offset"] for n in range(1, 7)]
        assert offsets == pytest.approx([columns["open"]] * 6)
        assert columns["partial 2 level"] == 0.0
        assert columns["partial 5 level"] == -3.0

    def test_a_partial_out_of_tune_has_an_offset(self, row: Row, sing: Sing) -> None:
        pulled = np.sin(2.0 * np.pi * 3.0 * 1010.565 * 0.998 * np.arange(SIZE) / 44100.0)
        columns = row("untouched", sing(None, (1, 1)) + (0.1 * pulled).astype(np.float32))
        assert columns["open"] == pytest.approx(0.0, abs=0.05)
        assert columns["partial 3 offset"] == pytest.approx(-2.7, abs=0.3)
        assert columns["spread"] == pytest.approx(columns["open"] - columns["partial 3 offset"], abs=1e-3)
        assert columns["level 1"] == pytest.approx(np.log10(0.02 + 0.005), abs=0.01)

    def test_a_touched_string_scores_low(self, row: Row, sing: Sing) -> None:
        assert row("untouched", sing(None, (1, 2)))["score"] > 0.5
        assert row("untouched", sing(0.083, (1, 2)))["score"] < 0.0
