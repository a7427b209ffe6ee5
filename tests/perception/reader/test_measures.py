"""The measures of a window: the pair of lines nearest to the density's peak, and the untouched pitch."""

import numpy as np
import pytest

from monochord.core.types import Audio, Floats
from monochord.perception.reader.measures import COLUMNS, measure, touch_near
from monochord.perception.reader.network import POSITIONS
from monochord.perception.spectrum import SpectrumAnalyser
from monochord.physics.strings import load_string
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials

RATE, SIZE = 44100, 4410
STRING = load_string("prototype").string
TIME = np.arange(SIZE) / RATE


def sound(first: Floats, second: Floats, crosstalk: float = 0.15) -> Audio:
    """Return a window with tones at microphone 1 and tones at microphone 2, in Hz."""
    ends = np.stack([np.sin(2.0 * np.pi * np.outer(lines, TIME)).sum(axis=0) for lines in (first, second)])
    hiss = 1e-5 * np.random.default_rng(2).standard_normal(ends.shape)
    return (0.1 * (ends + crosstalk * ends[::-1]) + hiss).astype(np.float32)


def measured(window: Audio, place: float) -> dict[str, float]:
    """Return the measures of a window for which the network says `place`."""
    analyser = SpectrumAnalyser(string=STRING, sample_rate=RATE, size=SIZE)
    logits = np.concatenate(([-8.0], -0.5 * ((POSITIONS - place) / 0.006) ** 2))
    pitch = analyser.bin_spacing, analyser.nominal, analyser.bending
    return dict(zip(COLUMNS, measure(logits, POSITIONS, *analyser.analyse(window), pitch), strict=True))


@pytest.mark.parametrize("position", [0.11, 0.31, 0.5, 0.74])
@pytest.mark.parametrize("modes", [(1, 1), (1, 3), (2, 4)])
@pytest.mark.parametrize("rise", [0.0, 0.01])
def test_the_pair_of_lines_gives_position_modes_and_pitch(
    position: float, modes: tuple[int, int], rise: float
) -> None:
    lines = [
        stiff_partials(
            (1.0 + rise) * open_frequency(STRING) / side, inharmonicity(STRING, side * STRING.length), mode
        )
        for side, mode in zip((position, 1.0 - position), modes, strict=True)
    ]
    if max(lines) > 18000.0:
        pytest.skip("above the highest line")
    own = measured(sound(np.array(lines[:1]), np.array(lines[1:])), position + 0.004)
    assert own["paired"] == 1.0
    assert own["position"] == pytest.approx(position, abs=1e-4)
    assert (own["mode 1"], own["mode 2"]) == modes
    assert own["open"] == pytest.approx(1000.0 * rise, abs=0.4)


def test_without_a_pair_the_position_is_the_densest() -> None:
    window = sound(np.array([2000.0]), np.array([2100.0]))
    window[1] = 0.0
    own = measured(window, 0.3)
    assert own["paired"] == 0.0
    assert own["position"] == own["place"] == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize("off", [-0.01, 0.0, 0.02])
def test_partials_of_the_untouched_string_give_its_pitch(off: float) -> None:
    partials = stiff_partials(
        (1.0 + off) * open_frequency(STRING), inharmonicity(STRING), np.array([2.0, 3.0, 5.0])
    )
    own = measured(sound(partials, partials, 1.0), 0.5)
    assert own["rest"] == pytest.approx(1000.0 * off, abs=0.1)
    assert own["lowest"] == pytest.approx(1000.0 * off, abs=0.1)
    assert own["lowest number"] == 2.0
    assert own["agreement"] == pytest.approx(1.0)


def test_a_gliding_line_is_told_from_a_steady_one() -> None:
    lines = [open_frequency(STRING) / side for side in (0.4, 0.6)]
    steady = measured(sound(np.array(lines[:1]), np.array(lines[1:])), 0.4)
    glide = 0.05  # of a frequency, in 1/s
    ends = np.stack(
        [
            np.sin(2.0 * np.pi * f * (TIME + sign * glide * TIME**2 / 2.0))
            for f, sign in zip(lines, (-1.0, 1.0), strict=True)
        ]
    )
    moving = measured((0.1 * ends).astype(np.float32), 0.4)
    assert steady["glide 1"] < 0.2
    assert np.sinh(moving["glide 1"]) * 5e-3 == pytest.approx(glide, rel=0.1)
    assert np.sinh(moving["glide position"]) * 5e-3 == pytest.approx(2.0 * glide * 0.24, rel=0.1)


def test_certainty_is_the_probability_of_a_touch_within_reach_of_the_place() -> None:
    logits = np.full(1 + len(POSITIONS), -20.0)
    logits[0], logits[1 + 100], logits[1 + 104], logits[1 + 140] = np.log((0.1, 0.4, 0.3, 0.2))
    for place, near in ((0.5, 0.7), (0.7, 0.2), (0.1, 0.0)):
        touched, certainty = touch_near(logits, POSITIONS, place, 0.025)
        assert touched == pytest.approx(np.log(0.901 / 0.101), abs=1e-5)
        assert certainty == pytest.approx(near, abs=1e-6)
