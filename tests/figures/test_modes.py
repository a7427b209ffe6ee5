"""The modes figure: patterns by a stated rule, counted honestly, and drawn with what they show."""

import re

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.figures import _patterns
from monochord.figures.modes import Modes, spectrogram
from monochord.physics.sensors import load_sensor

SENSOR = load_sensor("prototype")
FEW = Modes(histories=12, after=2.0)


def levels_of(*peaks: float) -> np.ndarray:
    """One sound a level: that of its first partial in both channels, the others absent."""
    levels = np.full((len(peaks), 2, _patterns.PARTIALS), _patterns.FLOOR)
    levels[:, :, 0] = np.array(peaks)[:, None]
    return levels


def test_sounds_alike_are_one_pattern_and_the_most_frequent_comes_first() -> None:
    found = _patterns.patterns(levels_of(-20.0, -3.0, -3.0, -1.0, -20.0, -3.0))
    assert found.tolist() == [1, 0, 0, 0, 1, 0]


def test_sounds_that_others_link_are_one_pattern() -> None:
    linked = levels_of(-3.0, -8.0, -13.0, -18.0)  # 5 dB apart each, 15 dB from end to end
    assert _patterns.patterns(linked).tolist() == [0, 0, 0, 0]
    assert sorted(_patterns.patterns(linked[[0, 3]]).tolist()) == [0, 1]


def test_patterns_do_not_depend_on_the_order() -> None:
    levels = np.random.default_rng(3).uniform(-30.0, 0.0, (30, 2, 8)).round(-1)
    order = np.random.default_rng(4).permutation(30)
    one, other = _patterns.patterns(levels)[order], _patterns.patterns(levels[order])
    assert ((one[:, None] == one) == (other[:, None] == other)).all()


def test_levels_tell_where_the_power_is() -> None:
    time = np.arange(22050) / _patterns.RATE
    f0 = 1010.565
    strong, weak = np.sin(2 * np.pi * 2 * f0 * time), 0.1 * np.sin(2 * np.pi * 3 * f0 * time)
    levels = _patterns.partial_levels(np.array([strong, weak], dtype=np.float32), SENSOR)
    # A hundredth of the power in the second channel: 10 log10(1 / 1.01) and 20 dB below.
    assert levels[0, 1] == pytest.approx(-0.043, abs=0.02)
    assert levels[1, 2] == pytest.approx(-20.04, abs=0.02)
    assert (np.delete(levels[0], 1) == _patterns.FLOOR).all()


def test_histories_stay_within_range_and_force_and_end_clear_of_the_string() -> None:
    kinds = set[bool]()
    for seed in range(60):
        past = _patterns.history(SENSOR, seed)
        kinds.add(past.scene.pluck is None)
        assert past == _patterns.history(SENSOR, seed)
        for touch in past.scene.touches:
            assert all(0.05 <= key.position <= 0.15 for key in touch.motion)
            assert all(0.1 <= key.force <= 2.0 for key in touch.motion[1:-1])
            assert touch.motion[-1].clearance > 0.0
            assert touch.motion[-1].time == past.released
    assert kinds == {True, False}


def test_numbers_count_every_history_once() -> None:
    told = FEW.numbers()
    assert told["histories"] == 12
    assert told["seeds"] == [0, 11]
    assert sum(told["counts"]) == told["steady"] <= 12
    assert (
        told["counts"] == sorted(told["counts"], reverse=True) == [one["count"] for one in told["patterns"]]
    )
    for one in told["patterns"]:
        heard, _ = _patterns.sound_of(SENSOR, one["seed"], 2.0)
        again = _patterns.partial_levels(heard[:, -22050:], SENSOR)
        np.testing.assert_allclose(again, one["levels_db"], atol=_patterns.ALIKE)


def test_figure_shows_a_column_of_each_pattern() -> None:
    page = FEW.draw()
    counts = FEW.numbers()["counts"]
    titles = {axes.get_title(loc="left"): axes.get_title() for axes in page.axes}
    for letter, count in zip("ABCDE", counts, strict=False):
        assert titles[letter].startswith(f"{count}/12 (")
    labels = {axes.get_xlabel() for axes in page.axes} | {axes.get_ylabel() for axes in page.axes}
    assert {"time since release (s)", "frequency (kHz)", "steady level (dB)", "level (dB)"} <= labels
    (title,) = [text.get_text() for text in page.texts if "atterns" in text.get_text()] or [
        page.get_suptitle()
    ]
    assert title.startswith("Simulated")


def test_spectrogram_is_in_decibels_of_full_scale_about_the_release() -> None:
    time = np.arange(3 * 44100) / 44100
    sine = (0.1 * np.sin(2 * np.pi * 1033.59 * time)).astype(np.float32)
    times, frequencies, levels = spectrogram(sine, 1.0)
    assert times[0] == pytest.approx(-0.2, abs=0.02)
    assert times[-1] == pytest.approx(0.8, abs=0.02)
    assert levels.shape == (frequencies.size, times.size)
    assert levels.max() == pytest.approx(-20.0, abs=0.2)
    assert frequencies[levels[:, 0].argmax()] == pytest.approx(1033.59, abs=22.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"histories": 0}, "histories 0"),
        ({"first": -1}, "first -1"),
        ({"after": 1.0}, "after 1 s"),
        ({"shown": 0}, "shown 0"),
        ({"sensor": "protoype"}, "did you mean 'prototype'"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float | int | str], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        Modes(**options).draw()  # pyright: ignore[reportArgumentType]
