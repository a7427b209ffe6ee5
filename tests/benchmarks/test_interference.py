"""What is claimed under music and speech, held by a test."""

import numpy as np
import pytest

from monochord import realstrings
from monochord.benchmarks._known_touches import Protocol
from monochord.benchmarks.interference import Interference

real = pytest.mark.skipif(realstrings.folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")

BOUNDS = {20.0: (95.0, 99.5), 10.0: (90.0, 98.0), 5.0: (80.0, 92.0), 0.0: (60.0, 80.0)}
"""Per ratio in dB: least share answered, and least share of the answers within 5 mm, in %."""


@real
@pytest.mark.parametrize("ratio", BOUNDS)
def test_answers_enough_and_rightly(ratio: float) -> None:
    answered, near = BOUNDS[ratio]
    for row in Interference(ratios=(ratio,)).run():
        least = near if row.name.endswith("within 5 mm") else answered
        assert row.value >= least, row


@pytest.mark.parametrize("per", ["window", "take"])
def test_the_ratio_is_what_was_asked_for(per: str) -> None:
    rng = np.random.default_rng(0)
    decay = np.exp(-3.0 * np.arange(66150) / 44100)
    take = (decay * rng.standard_normal(66150)).astype(np.float32)[np.newaxis]
    sound = rng.standard_normal(88200).astype(np.float32)
    benchmark = Interference(per="window" if per == "window" else "take")
    added = benchmark._mixer(sound, 10.0, rng, Protocol())(take) - take
    for start in (6615, 30870, 55125) if per == "window" else (0,):
        stop = start + 4410 if per == "window" else 66150
        ratio = np.mean(take[:, start:stop] ** 2) / np.mean(added[:, start:stop] ** 2)
        assert 10.0 * np.log10(ratio) == pytest.approx(10.0, abs=0.7)
