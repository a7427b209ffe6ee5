"""The closed form as a feature: position, tension, force and flags of sound that is known."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES
from monochord.physics.theory import geometric_tension

Sing = Callable[..., Audio]
SIZE = 4410
FLAGS = ("no reading", "two candidates", "untouched", "silence", "samples that are not numbers", "clipped")


def told(signal: Signal, window: Audio, **options: float) -> dict[str, float]:
    extract = FEATURES.build("closed_form", options).prepare(signal, window.shape[1])
    return dict(zip(extract.columns, extract(window[np.newaxis])[0].tolist(), strict=True))


def flags(row: dict[str, float]) -> list[str]:
    return [flag for flag in FLAGS if row[flag] == 1.0]


@pytest.mark.parametrize(("position", "force"), [(0.06, 1.5), (0.083, 0.8), (0.14, 2.0)])
@pytest.mark.parametrize("modes", [(1, 1), (1, 3), (2, 1)])
def test_position_tension_and_force_are_those_of_the_touch(
    signal: Signal, sing: Sing, position: float, force: float, modes: tuple[int, int]
) -> None:
    assert signal.string is not None
    tension = geometric_tension(signal.string, position, force)
    row = told(signal, sing(position, modes, tension=tension))
    assert row["position"] == pytest.approx(position, abs=5e-5)
    assert row["tension"] == pytest.approx(tension, abs=5e-3)
    assert row["force"] == pytest.approx(force, abs=0.05)
    assert (row["mode 1"], row["mode 2"]) == modes
    assert row["line 1"] == pytest.approx(modes[0] * row["fundamental 1"], rel=0.02)
    assert row["share 1"] > 0.8
    assert row["share 2"] < 0.2
    assert row["left over"] == 0.0
    assert not {*flags(row)} - {"two candidates"}


def test_an_untouched_string_is_flagged(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(None, (1, 3), tension=64.8))
    assert "untouched" in flags(row)
    assert row["contact"] < 0.0
    assert row["rest"] == pytest.approx(1000.0 * (np.sqrt(64.8 / 65.0) - 1.0), abs=0.05)


def test_two_readings_alike_are_two_candidates(signal: Signal, sing: Sing) -> None:
    row = told(signal, sing(0.0664, (1, 2)))
    assert flags(row) == ["two candidates"]
    assert 0.0 < row["lead"] < 0.25
    assert row["position"] == pytest.approx(0.0664, abs=5e-5)
    assert row["rival position"] == pytest.approx(0.133, abs=1e-3)
    assert flags(told(signal, sing(0.0664, (1, 2)), margin=0.1)) == []


@pytest.mark.parametrize(
    ("window", "reasons"),
    [
        (np.zeros((2, SIZE)), ["no reading", "silence"]),
        (np.full((2, SIZE), np.nan), ["no reading", "samples that are not numbers"]),
        (np.sign(np.sin(np.arange(2.0 * SIZE))).reshape(2, SIZE), ["clipped"]),
    ],
)
def test_why_a_window_cannot_be_used_is_flagged(signal: Signal, window: Audio, reasons: list[str]) -> None:
    row = told(signal, window.astype(np.float32))
    assert set(reasons) <= set(flags(row))
    assert all(np.isfinite(value) for value in row.values())


def test_noise_leaves_much_over(signal: Signal) -> None:
    noise = 0.1 * np.random.default_rng(1).standard_normal((2, SIZE)).astype(np.float32)
    row = told(signal, noise)
    assert row["score"] < 0.3
    assert row["left over"] > 0.3


def test_a_flexible_string_tells_no_force(signal: Signal, sing: Sing) -> None:
    assert signal.string is not None
    flexible = replace(signal, string=replace(signal.string, core_diameter=0.0))
    assert told(flexible, sing(0.083, tension=65.5))["force"] == 0.0


@pytest.mark.parametrize("options", [{"margin": -0.1}, {"margin": np.inf}, {"most_force": 0.0}])
def test_bad_options_are_refused(signal: Signal, options: dict[str, float]) -> None:
    with pytest.raises(InputError, match="allowed is a margin from 0 on and a force above 0 N"):
        FEATURES.build("closed_form", options).prepare(signal, SIZE)
