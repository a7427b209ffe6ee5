"""The far form over a stream: a note's windows add up, a new note takes over, mains hum is no note."""

import numpy as np
import pytest
from tests.perception.windows import RATE, SIZE, cut

from monochord.core.types import Estimate, Floats, Signal
from monochord.perception.closed_form.note_follower import NO_NOTES, NOTES, follow
from monochord.perception.estimators.closed_form import ClosedForm

SIGNAL = Signal(sample_rate=RATE, channels=1)
OPEN, LENGTH = 110.0, 0.65


def note(frequency: float, seconds: float, *, glide: float = 0.0, partials: int = 14) -> Floats:
    time = np.arange(round(seconds * RATE)) / RATE
    n = np.arange(1.0, partials + 1.0)[:, np.newaxis]
    phase = 2.0 * np.pi * frequency * (time + 0.5 * glide * time**2)
    stretch = n * np.sqrt(1.0 + 4e-5 * n * n)
    return (np.exp(-n * time) / n * np.sin(stretch * phase + n)).sum(axis=0)


def noise(size: int, level: float, seed: int = 0) -> Floats:
    return level * np.random.default_rng(seed).standard_normal(size)


def places(
    sound: Floats, *, open_frequency: float = OPEN, hop: float = 0.05, first: int = 0
) -> list[Estimate]:
    estimate = ClosedForm(length=LENGTH, open_frequency=open_frequency).prepare(SIGNAL, SIZE)
    windows = cut(0.1 * sound[np.newaxis], round(hop * RATE), first=first)
    return [estimate(window)["position"] for window in windows]


def right(estimates: list[Estimate], frequency: float, open_frequency: float = OPEN) -> float:
    place = LENGTH * (1.0 - open_frequency / frequency)
    return float(np.mean([abs(each.value - place) < 5e-3 for each in estimates]))


def test_windows_of_a_note_add_up() -> None:
    sound = note(164.8, 1.0)
    noisy = sound + noise(sound.size, 1.6 * float(sound.std()))
    alone = [places(noisy[start : start + SIZE])[0] for start in range(0, sound.size - SIZE + 1, SIZE)]
    together = places(noisy, hop=0.1)
    assert right(together[2:], 164.8) == 1.0
    assert right(alone[2:], 164.8) < right(together[2:], 164.8)
    assert all(not each.valid or abs(each.value - 0.2161) < 5e-3 for each in alone + together)


@pytest.mark.parametrize("hop", [0.01, 0.05, 0.1])
def test_a_new_note_takes_over_within_a_window(hop: float) -> None:
    sound = np.concatenate((note(164.8, 0.6), note(196.0, 0.6), note(123.5, 0.6)))
    estimates = places(sound + noise(sound.size, 1e-3), hop=hop)
    for k, frequency in enumerate((164.8, 196.0, 123.5)):
        begin, end = round((0.6 * k + 0.03) / hop), round((0.6 * (k + 1) - 0.1) / hop)
        assert right(estimates[begin:end], frequency) == 1.0


@pytest.mark.parametrize("glide", [-0.06, 0.06])
def test_a_bent_note_is_followed(glide: float) -> None:
    sound = note(150.5, 0.8, glide=glide)
    estimates = places(sound + noise(sound.size, 1e-3), hop=0.02)
    for k, each in enumerate(estimates):
        frequency = 150.5 * (1.0 + glide * (0.02 * k + 0.05))
        assert each.value == pytest.approx(LENGTH * (1.0 - OPEN / frequency), abs=6e-3)


def test_a_bend_of_two_semitones_has_a_place_before_and_after_it() -> None:
    time = np.arange(round(1.5 * RATE)) / RATE
    pitch = 150.5 * 2.0 ** (np.clip((time - 0.5) / 0.3, 0.0, 1.0) / 6.0)
    phase = 2.0 * np.pi * np.cumsum(pitch) / RATE
    sound = np.asarray(sum(np.sin(n * phase + n) / n for n in range(1, 11)))
    estimates = places(sound + noise(sound.size, 1e-3), hop=0.02)
    assert right(estimates[:20], 150.5) == 1.0
    assert right(estimates[45:], 150.5 * 2.0 ** (1.0 / 6.0)) == 1.0


def test_a_voice_gets_hardly_a_place() -> None:
    time = np.arange(2 * RATE) / RATE
    pitch = 160.0 * np.exp(0.35 * np.sin(2.0 * np.pi * 0.7 * time + 0.8))
    phase = 2.0 * np.pi * np.cumsum(pitch) / RATE
    voice = np.asarray(sum(np.sin(n * phase + n) / n for n in range(1, 11)))
    estimates = places(voice + noise(voice.size, 1e-3), hop=0.02)
    assert np.mean([each.valid for each in estimates]) < 0.35
    assert np.mean([each.valid for each in places(note(160.0, 2.0), hop=0.02)]) == 1.0


def test_white_noise_has_no_place() -> None:
    estimates = [each for seed in range(3) for each in places(noise(2 * RATE, 1.0, seed), hop=0.025)]
    assert np.mean([each.valid for each in estimates]) < 0.02


def test_silence_and_a_new_stream_leave_nothing() -> None:
    sound = note(164.8, 0.5)
    first, again = places(sound, first=10 * SIZE), places(sound)
    assert [each.value for each in first] == [each.value for each in again]
    estimate = ClosedForm(length=LENGTH, open_frequency=OPEN).prepare(SIGNAL, SIZE)
    (later,), (begun,) = (cut(0.1 * sound[np.newaxis, :SIZE], first=first) for first in (8820, 0))
    assert estimate(later)["position"] == estimate(begun)["position"]


def test_the_posterior_stays_small_and_whole() -> None:
    rng = np.random.default_rng(0)
    notes = NO_NOTES
    for k in range(50):
        frequency = rng.uniform(80.0, 400.0, 40)
        rows = np.stack(
            (frequency, 1e-3 * frequency, 1e-4 + 0 * frequency, 1e-5 + 0 * frequency, rng.uniform(0, 60, 40)),
            axis=1,
        )
        notes = follow(notes, rows[rows[:, 4].argsort()[::-1]], 0.01 if k else np.inf, 0.1)
        assert notes.weight.size <= NOTES
        assert np.exp(notes.weight).sum() + np.exp(notes.none) == pytest.approx(1.0)


HUMS = {"mains": [0, -25, -12, -30, -14, -30, -12], "rectified": [-30, 0, -30, -8, -40, -14], "sine": [0]}


def hum(base: float, kind: str, seconds: float) -> Floats:
    time = np.arange(round(seconds * RATE)) / RATE
    parts = [
        10.0 ** (level / 20.0) * np.sin(2.0 * np.pi * base * k * time + k)
        for k, level in enumerate(HUMS[kind], 1)
    ]
    return np.asarray(sum(parts))


@pytest.mark.parametrize("kind", HUMS)
@pytest.mark.parametrize(
    ("base", "open_frequency"), [(60.0, 61.5), (60.0, 110.0), (50.0, 41.2), (50.0, 98.0)]
)
def test_hum_alone_has_no_place(kind: str, base: float, open_frequency: float) -> None:
    sound = hum(base, kind, 1.5)
    estimates = places(sound + noise(sound.size, 1e-3), open_frequency=open_frequency)
    assert not any(each.valid for each in estimates)


@pytest.mark.parametrize(("kind", "level"), [*((kind, -20.0) for kind in HUMS), ("mains", -35.0)])
@pytest.mark.parametrize(
    ("base", "open_frequency", "frequency"),
    [(60.0, 61.5, 123.0), (60.0, 61.5, 61.5), (60.0, 110.0, 120.3), (50.0, 98.0, 98.0), (50.0, 82.4, 146.8)],
)
def test_a_note_beside_hum_is_located(
    kind: str, level: float, base: float, open_frequency: float, frequency: float
) -> None:
    sound = note(frequency, 1.0)
    sound += 10.0 ** (level / 20.0) * np.abs(sound).max() / 3.0 * hum(base, kind, 1.0)
    estimates = places(sound + noise(sound.size, 1e-4), open_frequency=open_frequency)
    assert right(estimates, frequency, open_frequency) >= 0.75
    wrong = [each for each in estimates if each.valid and not right([each], frequency, open_frequency)]
    assert not wrong
