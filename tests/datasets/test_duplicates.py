"""A copy differs from another take of the same string, which is as periodic."""

from functools import cache

import numpy as np

from monochord.core.types import Audio
from monochord.datasets.duplicates import find_duplicates
from monochord.dsp.noise import mixed, pink
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Key, Pluck, Scene, Touch, advance, begin

RATE, SECONDS = 44100, 12


@cache
def take(touches: int, seed: int, *, lifted: bool = False) -> Audio:
    """A driven string, touched here and there as `touches` says; another seed is another hiss and surface.

    With `lifted` nothing touches.
    """
    rng = np.random.default_rng(touches)
    keys: list[Key] = []
    for start in np.arange(1.0, SECONDS - 2.0, 2.0).tolist():
        place, force = rng.uniform(0.05, 0.13), rng.uniform(0.3, 2.0)
        keys += [
            Key(time=start, position=place, clearance=1e-3),
            Key(time=start + 0.05, position=place, force=force),
        ]
        keys += [Key(time=start + 1.5, position=place, force=force)]
        keys += [Key(time=start + 1.6, position=place, clearance=1e-3)]
    touch = Touch(material=load_material("plastic"), motion=tuple(keys))
    pluck = Pluck(position=0.03 + 0.01 * (touches % 5), height=1e-4)
    twin = begin(load_sensor("prototype"), Scene(touches=() if lifted else (touch,), pluck=pluck), seed=seed)
    return advance(twin, SECONDS * RATE)[0].microphones


def duplicates(*takes: Audio) -> list[tuple[int, int, int]]:
    parts = [1 << number for number in range(len(takes))]
    return [(each.first, each.second, each.lag) for each in find_duplicates(takes.__getitem__, parts)]


def test_takes_of_one_string_are_no_copies_of_each_other() -> None:
    assert not duplicates(*(take(touches, touches) for touches in range(3)))


def test_a_string_that_sounds_on_untouched_is_like_every_other_take_of_it_and_no_copy() -> None:
    one, two = (take(0, seed, lifted=True) for seed in (1, 2))
    assert np.corrcoef(one.ravel(), two.ravel())[0, 1] > 0.99
    assert not duplicates(one, two, take(1, 3, lifted=True))
    assert duplicates(one, two, one[:, 5000:]) == [(0, 2, -5000)]


def test_a_copy_is_detected_wherever_it_begins_and_whatever_its_channels() -> None:
    copy = take(1, 1)[:, 12345:]
    for each in (copy, copy[::-1]):
        assert duplicates(take(0, 0), take(1, 1), each) == [(1, 2, -12345)]


def test_a_copy_among_many_sessions_is_detected() -> None:
    rng = np.random.default_rng(1)
    takes = [rng.normal(size=(2, RATE)).astype(np.float32) for _ in range(60)]
    takes.append(takes[7][:, 100:])
    assert duplicates(*takes) == [(7, 60, -100)]


def test_a_third_of_a_take_is_detected() -> None:
    assert duplicates(take(2, 2), take(2, 2)[:, 4 * RATE : 8 * RATE]) == [(0, 1, -4 * RATE)]


def test_the_same_music_beside_two_takes_is_no_copy() -> None:
    music = np.tile(pink(np.random.default_rng(5), (2 * RATE,), RATE), SECONDS // 2)
    noisy = [mixed(each.astype(float), np.stack([music] * 2), 10.0) for each in (take(0, 0), take(2, 2))]
    assert not duplicates(*(each.astype(np.float32) for each in noisy))


def test_silence_and_what_is_too_short_are_no_copies() -> None:
    silent = np.zeros((2, RATE), np.float32)
    short = np.random.default_rng(0).normal(size=(2, 2000)).astype(np.float32)
    assert not duplicates(silent, silent, short, -short)


def test_samples_that_are_no_numbers_count_as_silence() -> None:
    holed = take(0, 0).copy()
    holed[:, 5 * RATE : 5 * RATE + 100] = np.nan
    holed[0, 7 * RATE] = np.inf
    assert duplicates(take(0, 0), holed) == [(0, 1, 0)]
