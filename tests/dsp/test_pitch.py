"""Pitch of short windows: synthetic strings of every kind the estimator must hear."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from monochord.core.types import Floats
from monochord.core.units import cents
from monochord.dsp.pitch import PitchFinder

RATE, SIZE = 44100, 4410
FINDER = PitchFinder(sample_rate=RATE, size=SIZE, lowest=80.0, highest=400.0)


def string(
    f0: float,
    inharmonicity: float = 1e-4,
    partials: range = range(1, 16),
    decay: float = 3.0,
    noise: float = 1e-3,
    seed: int = 0,
) -> Floats:
    rng = np.random.default_rng(seed)
    time = np.arange(SIZE) / RATE
    sound = noise * rng.standard_normal(SIZE)
    for n in partials:
        f = f0 * n * np.sqrt(1.0 + inharmonicity * n * n)
        if f < 0.45 * RATE:
            sound += np.exp(-decay * n * time) / n * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.28))
    return sound[np.newaxis]


@settings(max_examples=40)
@given(
    f0=st.floats(82.0, 395.0),
    inharmonicity=st.floats(0.0, 4e-4),
    decay=st.floats(0.0, 10.0),
    seed=st.integers(0, 1000),
)
def test_clean_strings_are_found_within_three_cents(
    f0: float, inharmonicity: float, decay: float, seed: int
) -> None:
    assume(all(abs(f0 / hum - 1.0) > 2e-3 for hum in (100.0, 120.0)))  # whose lines are those of hum
    best = FINDER.find(string(f0, inharmonicity, decay=decay, seed=seed))[0]
    assert abs(cents(f0, best.frequency)) < 3.0


@pytest.mark.xfail(raises=IndexError, reason="its lines are those of hum; see docs/ROADMAP.md")
@pytest.mark.parametrize("f0", [100.0, 120.0])
def test_a_flexible_string_on_a_multiple_of_the_mains_is_found(f0: float) -> None:
    assert abs(cents(f0, FINDER.find(string(f0, 0.0))[0].frequency)) < 3.0


@pytest.mark.parametrize("f0", [82.4, 220.0, 330.0])
@pytest.mark.parametrize("partials", [range(2, 16), range(3, 16), range(1, 4), range(1, 16, 2)])
def test_partials_may_be_missing(f0: float, partials: range) -> None:
    best = FINDER.find(string(f0, partials=partials))[0]
    assert abs(cents(f0, best.frequency)) < 5.0


def test_a_pure_tone_is_its_own_fundamental() -> None:
    candidates = FINDER.find(string(330.0, partials=range(1, 2)))
    assert candidates[0].frequency == pytest.approx(330.0, abs=0.2)
    assert all(candidates[0].evidence - other.evidence > 6.0 for other in candidates[1:])


def test_noise_has_little_evidence() -> None:
    rng = np.random.default_rng(5)
    seen = [FINDER.find(rng.standard_normal((1, SIZE))) for _ in range(50)]
    assert max(candidates[0].evidence for candidates in seen if candidates) < 27.0


def test_white_noise_at_0_db_is_survived() -> None:
    right = 0
    for seed in range(40):
        sound = string(180.0, seed=seed, decay=1.0)
        noisy = sound + sound.std() * np.random.default_rng(seed + 100).standard_normal((1, SIZE))
        right += abs(cents(180.0, FINDER.find(noisy)[0].frequency)) < 10.0
    assert right >= 39


def test_level_and_sign_do_not_matter() -> None:
    sound = string(123.0)
    one, other = FINDER.find(sound)[0], FINDER.find(-1e-4 * sound)[0]
    assert other.frequency == pytest.approx(one.frequency, abs=1e-6)


@pytest.mark.parametrize("rate", [16000, 96000])
def test_other_sample_rates(rate: int) -> None:
    size = rate // 10
    time = np.arange(size) / rate
    sound = sum(np.sin(2.0 * np.pi * 130.0 * n * time + n) / n for n in range(1, 12))
    best = PitchFinder(sample_rate=rate, size=size, lowest=80.0, highest=400.0).find(np.atleast_2d(sound))[0]
    assert abs(cents(130.0, best.frequency)) < 2.0
