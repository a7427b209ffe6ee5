"""Noise is added at the ratio that is asked for, the same for everyone."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation.noise import Disturbance, disturbances

RATE = 44100
SOUND = 0.1 * np.random.default_rng(0).normal(size=(2, 2 * RATE)).astype(np.float32)
RECORDINGS = {"song": np.sin(np.arange(3000.0)).astype(np.float32)}


def added(kind: str, ratio: float, session: str = "take", seed: int = 0) -> np.ndarray:
    noisy = Disturbance(kind=kind, ratio=ratio, seed=seed, recordings=RECORDINGS)
    return noisy.added(SOUND, 0.01, RATE, session).astype(np.float64) - SOUND


@pytest.mark.parametrize("kind", disturbances(RECORDINGS))
def test_every_kind_has_the_level_that_the_ratio_says(kind: str) -> None:
    power = np.mean(added(kind, 10.0) ** 2)
    assert 10.0 * np.log10(0.01 / power) == pytest.approx(10.0, abs=0.01)


@pytest.mark.parametrize("kind", disturbances(RECORDINGS))
def test_the_same_noise_at_every_ratio_and_another_in_every_session(kind: str) -> None:
    loud, soft = added(kind, 0.0), added(kind, 20.0)
    np.testing.assert_allclose(loud, 10.0 * soft, atol=1e-5)
    np.testing.assert_array_equal(loud, added(kind, 0.0))
    assert not np.allclose(loud, added(kind, 0.0, session="other"))
    assert not np.allclose(loud, added(kind, 0.0, seed=1))


def test_what_arises_in_a_preamplifier_differs_between_microphones() -> None:
    for kind in disturbances(RECORDINGS):
        first, second = added(kind, 10.0)
        assert np.allclose(first, second, atol=1e-6) == (kind not in ("white", "pink", "band"))


def test_a_recording_takes_the_place_of_made_up_speech() -> None:
    recordings = {"speech": np.ones(10, np.float32)}
    heard = Disturbance(kind="speech", ratio=0.0, recordings=recordings).added(SOUND, 0.01, RATE, "take")
    np.testing.assert_allclose(heard - SOUND, 0.1, atol=1e-6)


def test_what_cannot_be_is_refused_in_a_line() -> None:
    with pytest.raises(InputError, match=r"noise 'pinc'.*did you mean 'pink'"):
        Disturbance(kind="pinc", ratio=10.0)
    with pytest.raises(InputError, match="noise at nan dB"):
        Disturbance(kind="pink", ratio=float("nan"))
    with pytest.raises(InputError, match=r"recording of song \(silent"):
        Disturbance(kind="song", ratio=10.0, recordings={"song": np.zeros(9, np.float32)})
