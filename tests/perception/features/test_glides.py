"""Lines that glide: the speed of a place and the change of the pitch, on sound whose glides are known."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.types import Audio, Floats
from monochord.physics.strings import load_string
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials

Row = Callable[..., dict[str, float]]
Sing = Callable[..., Audio]
Glides = Callable[[Audio], dict[str, float]]
RATE, SIZE = 44100, 4410
STRING = load_string("prototype").string
SCALES = {
    "segment 1": 5e-3,
    "segment 2": 5e-3,
    "spread 1": 1e-2,
    "spread 2": 1e-2,
    "place": 2e-4,
    "pitch": 3e-3,
}


@pytest.fixture
def glides(row: Row) -> Glides:
    """Return the function from a window to its glides in SI units."""

    def measured(window: Audio) -> dict[str, float]:
        columns = row("fft_harmonic", window, glides=True)
        return {name: float(np.sinh(columns[f"glide {name}"])) * scale for name, scale in SCALES.items()}

    return measured


def gliding(
    place: float, speed: float = 0.0, rise: float = 0.0, partials: int = 3, modes: tuple[int, int] = (1, 1)
) -> Floats:
    """Return the sound of a touch that moves at `speed` m/s while the pitch rises by `rise` a second."""
    time = np.arange(SIZE) / RATE
    middle = time - time.mean()
    near = place + speed * middle
    tones: list[Floats] = []
    for side, mode in ((near, modes[0]), (STRING.length - near, modes[1])):
        line = np.zeros(SIZE)
        for n in range(1, partials + 1):
            fundamental = open_frequency(STRING) * (1.0 + rise * middle) * STRING.length / side
            frequency = n * stiff_partials(fundamental, inharmonicity(STRING, place), float(mode))
            line += 0.2 / n * np.sin(2.0 * np.pi * np.cumsum(frequency) / RATE + n)
        tones.append(line)
    both = np.stack(tones)
    return both + 0.3 * both[::-1]


def hiss(level: float, seed: int = 0) -> Floats:
    return level * np.random.default_rng(seed).standard_normal((2, SIZE))


@pytest.mark.parametrize(("place", "speed"), [(0.083, -0.005), (0.113, 0.001), (0.13, 0.005)])
def test_a_touch_that_moves_along_the_string_has_its_speed(
    glides: Glides, place: float, speed: float
) -> None:
    found = glides((gliding(place, speed) + hiss(1e-4)).astype(np.float32))
    assert found["place"] == pytest.approx(abs(speed), rel=0.05, abs=5e-5)
    assert found["segment 1"] == pytest.approx(abs(speed) / place, rel=0.05, abs=2e-3)
    assert found["segment 2"] == pytest.approx(abs(speed) / (STRING.length - place), rel=0.05, abs=2e-3)
    # The pitch of the whole string stays.
    assert found["pitch"] < 0.05 * found["segment 1"] + 2e-3


@pytest.mark.parametrize("place", [0.06, 0.13])
def test_a_fast_one_smears_its_lines_and_is_told_too_slow_but_not_as_a_slow_one(
    glides: Glides, place: float
) -> None:
    found = [glides(gliding(place, speed).astype(np.float32))["place"] for speed in (0.003, 0.01, 0.03)]
    assert found[0] < found[1] < found[2]
    assert 0.015 < found[2] < 0.031


@pytest.mark.parametrize("rise", [-0.1, 0.02])
def test_a_pitch_that_rises_is_no_speed(glides: Glides, rise: float) -> None:
    found = glides((gliding(0.083, rise=rise) + hiss(1e-4)).astype(np.float32))
    assert found["pitch"] == pytest.approx(abs(rise), rel=0.05)
    assert found["place"] < 2e-4


def test_a_touch_at_rest_has_no_glide_in_noise_of_40_db(glides: Glides) -> None:
    still = gliding(0.083)
    for seed in range(5):
        found = glides((still + hiss(0.01 * still.std(), seed)).astype(np.float32))
        assert found["place"] < 5e-4
        assert found["pitch"] < 1e-2


def test_a_growing_tone_has_no_glide(glides: Glides, sing: Sing) -> None:
    found = glides(sing(0.083, partials=3, decay=10.0))
    assert found["place"] < 5e-4
    assert found["spread 1"] < 5e-2


def test_an_untouched_string_and_silence_have_none(glides: Glides, sing: Sing) -> None:
    for window in (sing(), np.zeros((2, SIZE), np.float32)):
        assert set(glides(window).values()) == {0.0}


def test_harmonics_that_glide_apart_are_seen_as_spread(glides: Glides) -> None:
    together = gliding(0.083, 0.01, partials=2)
    apart = (
        gliding(0.083, 0.01, partials=1)
        + gliding(0.083, -0.01, partials=2)
        - gliding(0.083, -0.01, partials=1)
    )
    assert (
        glides(apart.astype(np.float32))["spread 1"] > 5.0 * glides(together.astype(np.float32))["spread 1"]
    )
