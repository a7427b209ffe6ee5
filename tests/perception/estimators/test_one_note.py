"""One note at two channels: a stereo recording of one string is located as its mono recording is."""

from collections.abc import Callable

import numpy as np
import pytest
from tests.perception.windows import RATE, SIZE, cut

from monochord.core.types import Audio, Floats, Signal
from monochord.perception.estimators.closed_form import ClosedForm
from monochord.physics.sensors import load_sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor

LENGTH, OPEN = 0.65, 246.94
STEREO, MONO = (Signal(sample_rate=RATE, channels=n) for n in (2, 1))


def note(position: float, shares: list[float], seed: int = 0) -> Audio:
    """Return half a second of a string stopped at a position; partial n has the share `shares[n]` of its
    power at channel 1."""
    time = np.arange(RATE // 2) / RATE
    n = np.arange(1.0, len(shares) + 1.0)[:, np.newaxis]
    frequency = OPEN * LENGTH / (LENGTH - position) * n * np.sqrt(1.0 + 2e-5 * n * n)
    partials = np.exp(-n * time) / n * np.sin(2.0 * np.pi * frequency * time + n)
    at_first = np.array(shares)
    sound = np.stack([np.sqrt(at_first) @ partials, np.sqrt(1.0 - at_first) @ partials])
    sound += 1e-5 * np.random.default_rng(seed).standard_normal(sound.shape)
    return (0.3 * sound / np.abs(sound).max()).astype(np.float32)


def positions(sound: Audio, signal: Signal, **options: object) -> Floats:
    """Return the position of every window, NaN for an abstention."""
    estimator = ClosedForm(length=LENGTH, open_frequency=OPEN, **options)  # pyright: ignore[reportArgumentType]
    estimate = estimator.prepare(signal, SIZE)
    windows = cut(sound[: signal.channels], SIZE // 2)
    return np.array([estimate(window)["position"].value for window in windows])


SIDES: dict[str, Callable[[int], list[float]]] = {
    "two microphones in the air": lambda _: [0.90, 0.33, 0.64, 0.62, 0.44, 0.99, 0.34, 0.75],
    "any sides": lambda seed: np.random.default_rng(seed).uniform(0.02, 0.98, 9).tolist(),
    "a note to the left": lambda seed: np.random.default_rng(seed).uniform(0.75, 0.95, 9).tolist(),
    "a pickup at a node": lambda seed: [0.3 + 0.07 * seed, 0.02, 0.6, 0.4, 0.7, 0.3, 0.5],
}


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("position", [0.0726, 0.2275, 0.41])
def test_stereo_is_as_good_as_mono(sides: str, position: float) -> None:
    for seed in range(2):
        sound = note(position, SIDES[sides](seed), seed)
        mono, stereo = positions(sound, MONO), positions(sound, STEREO)
        assert np.nanmax(np.abs(mono - position)) < 1e-3
        wrong = np.isfinite(stereo) & (np.abs(stereo - position) > 1e-3)
        assert not wrong.any()
        assert np.isfinite(stereo).mean() >= np.isfinite(mono).mean() - 0.05


def test_one_window_of_two_sides_does_not_decide_the_rest() -> None:
    sound = note(0.0726, SIDES["two microphones in the air"](0))
    swap = slice(SIZE, 2 * SIZE)  # a stretch in which each channel carries another note
    sound[0, swap], sound[1, swap] = note(0.13, [0.98] * 8)[0, swap], note(0.52, [0.02] * 8)[1, swap]
    last = positions(sound, STEREO)[-3:]
    assert last == pytest.approx([0.0726] * 3, abs=1e-3)


@pytest.mark.parametrize("position", [0.0467, 0.1, 0.15])
def test_two_pickups_go_on_using_both_segments(position: float) -> None:
    twin = VirtualSensor(load_sensor("prototype"), seed=7)
    untouched = twin.advance(0.7)[0][:, round(0.4 * RATE) :]
    twin.press(position, 0.8)
    twin.advance(0.35)
    touched = twin.advance(0.3)[0]
    estimate = ClosedForm(length=0.2, open_frequency=1010.6).prepare(STEREO, SIZE)
    for window in cut(np.concatenate((untouched, touched), axis=1), SIZE // 2):
        estimates = estimate(window)
        if window.start >= untouched.shape[1]:
            assert estimates["position"].value == pytest.approx(position, abs=1e-3)
