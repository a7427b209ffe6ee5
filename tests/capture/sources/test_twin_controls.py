"""A hand on the twin: touches, noise and tuning while it sounds, and nothing changed where none is."""

import itertools
import time
from collections.abc import Iterator

import numpy as np
import pytest

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Controls, Stream
from monochord.core.errors import InputError
from monochord.core.types import Block, Contact

FAST = {"speed": 1e6, "materials": ["plastic"], "world": "plausible", "build": 3, "day": 1, "seed": 2}
WINDOW = 4410


def opened(stream: Stream) -> tuple[Controls, Iterator[Block]]:
    controls = stream.controls
    assert controls is not None
    return controls, iter(stream)


def take(blocks: Iterator[Block], count: int) -> Block:
    return next(itertools.islice(blocks, count - 1, None))


def truth(stream: Stream, last: Block) -> dict[str, float]:
    end = last.start + last.samples.shape[1]
    return dict(stream.truth(end - WINDOW, end))


def test_a_press_is_felt_where_and_as_hard_as_it_is_made() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        take(blocks, 10)
        controls.touch(Contact(position=0.06, force=1.2))
        felt = truth(stream, take(blocks, 50))
        assert (felt["contact"], felt["slip"]) == (1.0, 0.0)
        assert felt["position"] == pytest.approx(0.06, abs=2e-4)
        assert felt["force"] == pytest.approx(1.2, rel=0.05)
        controls.release()
        assert truth(stream, take(blocks, 40))["contact"] == 0.0


def test_dragging_along_the_string_is_slip_and_holding_still_is_not() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        last = take(blocks, 1)
        for step in range(60):
            position = 0.06 + 3e-4 * max(step - 30, 0)
            controls.touch(Contact(position=position, force=1.0))
            last = take(blocks, 1)
        felt = truth(stream, last)
        assert felt["slip"] == 1.0
        assert felt["slip_along"] == pytest.approx(0.03, rel=0.3)
        felt = truth(stream, take(blocks, 40))
        assert felt["slip"] == 0.0
        assert felt["position"] == pytest.approx(0.06 + 3e-4 * 29, abs=3e-4)


def test_dragging_across_the_string_is_slip_where_it_is_pressed() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        controls.touch(Contact(position=0.06, force=1.0))
        take(blocks, 30)
        controls.touch(Contact(position=0.06, force=1.0, slip_velocity=0.02))
        felt = truth(stream, take(blocks, 30))
        assert felt["slip"] == 1.0
        assert felt["slip_across"] == pytest.approx(0.02, rel=0.1)
        assert felt["position"] == pytest.approx(0.06, abs=2e-4)
        controls.touch(Contact(position=0.06, force=1.0))
        assert truth(stream, take(blocks, 40))["slip"] == 0.0
        with pytest.raises(InputError):
            controls.touch(Contact(position=0.06, force=1.0, slip_velocity=np.nan))


def test_another_press_lifts_the_object_and_brings_it_down_elsewhere() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        controls.touch(Contact(position=0.06, force=1.0))
        take(blocks, 40)
        controls.release()
        controls.touch(Contact(position=0.13, force=0.5))
        slips: list[float] = []
        last = take(blocks, 1)
        for _ in range(50):
            last = take(blocks, 1)
            slips.append(truth(stream, last).get("slip", 0.0))
        felt = truth(stream, last)
        assert felt["position"] == pytest.approx(0.13, abs=2e-4)
        assert felt["force"] == pytest.approx(0.5, rel=0.05)
        assert max(slips) == 0.0  # it went through the air


def test_what_is_out_of_range_is_moved_into_it_and_what_is_no_number_refused() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        controls.touch(Contact(position=5.0, force=300.0))
        felt = truth(stream, take(blocks, 50))
        assert felt["position"] == pytest.approx(controls.positions[1], abs=1e-3)
        with pytest.raises(InputError):
            controls.touch(Contact(position=np.nan, force=1.0))
        for name, value in (("colour", "red"), ("noise", "loud")):
            with pytest.raises(InputError):
                controls.change(name, value)


def test_an_object_pressed_at_an_end_comes_as_near_as_it_can() -> None:
    with SOURCES.build("twin", {**FAST, "seed": 3, "materials": ["metal_tube", "plastic"]}).open() as stream:
        controls, blocks = opened(stream)
        take(blocks, 10)
        for material, nearest in (("metal_tube", 5.4e-3), ("plastic", 4.1e-3)):  # the tube is 2.6 mm wide
            controls.change("material", material)
            for position, place in ((1e-3, nearest), (0.2, 0.19793 - nearest)):
                controls.touch(Contact(position=position, force=1.2))
                take(blocks, 20)
                controls.change("tuning", "+3 %")
                assert truth(stream, take(blocks, 20))["position"] == pytest.approx(place, abs=3e-4)
                controls.change("tuning", "as built")
                controls.release()
                take(blocks, 20)


def test_settings_are_what_was_chosen() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        for setting in controls.settings:
            assert setting.value in setting.choices
            controls.change(setting.name, setting.choices[-1])
        assert all(setting.value == setting.choices[-1] for setting in controls.settings)
        take(blocks, 20)


def partial(samples: np.ndarray, near: float) -> float:
    """Frequency of the strongest partial near one, in Hz."""
    power = np.abs(np.fft.rfft(samples * np.hanning(samples.size), 1 << 17))
    hertz = np.fft.rfftfreq(1 << 17, 1 / 44100)
    return float(hertz[np.argmax(np.where(abs(hertz / near - 1) < 0.06, power, 0.0))])


def test_tuning_moves_the_pitch_and_noise_is_as_loud_as_it_says() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        controls.change("touches", "by hand")
        assert stream.signal.string is not None

        def sound() -> np.ndarray:
            take(blocks, 60)
            return np.concatenate([take(blocks, 1).samples[0] for _ in range(40)]).astype(np.float64)

        before = sound()
        spectrum = np.abs(np.fft.rfft(before))
        near = float(np.argmax(spectrum) * 44100 / before.size)
        controls.change("tuning", "+3 %")
        sharp = sound()
        # It may settle into another pattern, whose partials are the same.
        assert partial(sharp, 1.03 * near) / partial(before, near) == pytest.approx(1.03, abs=0.01)

        def top() -> float:
            """Level from 16 kHz up, where the string is quiet, as of white noise."""
            noisy = sound()
            part = np.abs(np.fft.rfft(noisy))[-noisy.size // 8 :]
            return float(np.sqrt(np.mean(part**2) * 2 / noisy.size))

        quiet, deadline = top(), time.monotonic() + 60.0
        controls.change("noise", "white, 10 dB")
        while top() < 10.0 * quiet:  # it is being made
            assert time.monotonic() < deadline
        level = top()
        assert 20 * np.log10(level / np.sqrt(np.mean(sharp**2) * 2)) == pytest.approx(-10.0, abs=3.0)


def test_without_a_clock_there_is_no_hand_and_an_idle_one_changes_nothing() -> None:
    options = {**FAST, "duration": 1.5}
    with SOURCES.build("twin", {**options, "speed": 0.0}).open() as stream:
        assert stream.controls is None
        plain = np.concatenate([block.samples for block in stream], axis=1)
    with SOURCES.build("twin", options).open() as stream:
        assert stream.controls is not None
        idle = np.concatenate([block.samples for block in stream], axis=1)
    np.testing.assert_array_equal(plain, idle)


def test_the_others_touches_go_on_after_a_hand() -> None:
    with SOURCES.build("twin", FAST).open() as stream:
        controls, blocks = opened(stream)
        controls.touch(Contact(position=0.06, force=1.0))
        take(blocks, 100)
        controls.change("touches", "automatic")
        felt = [truth(stream, take(blocks, 1)) for _ in range(600)]
        places = {round(each["position"], 4) for each in felt if each.get("contact") == 1.0}
        assert len(places) > 1
        assert any(each.get("contact") == 0.0 for each in felt)
