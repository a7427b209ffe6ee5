"""The stream: the same samples however they are cut, drivers that follow, touches that come and go."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats
from monochord.physics.split_string import (
    Drive,
    PluckShape,
    Ringing,
    SplitString,
    advance,
    begin,
    feedback,
    simulate,
    touch,
)
from monochord.physics.split_string.feedback import lines, retune, sense
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies

APPENDIX = load_string("appendix")
SETUP = SplitString(string=APPENDIX.string, contact=APPENDIX.contact)
OTHER = Contact(position=0.4, force=1.0)


def play(ringing: Ringing, samples: int, block: int) -> tuple[Floats, Ringing]:
    parts: list[Floats] = []
    while samples:
        velocity, ringing = advance(ringing, min(block, samples))
        parts.append(velocity)
        samples -= velocity.shape[1]
    return np.concatenate(parts, axis=1), ringing


@pytest.mark.parametrize("block", [1, 1000])
def test_blocks_do_not_matter_bit_for_bit(block: int) -> None:
    def run(block: int) -> Floats:
        before, ringing = play(begin(SETUP), 3000, block)
        during, ringing = play(touch(ringing, OTHER), 1111, block)
        after, _ = play(touch(ringing, None), 1500, block)
        return np.concatenate((before, during, after), axis=1)

    assert run(block).tobytes() == run(10**6).tobytes()


def test_a_state_is_not_changed_by_what_follows_it() -> None:
    _, ringing = advance(begin(SETUP), 3000)
    first, _ = advance(ringing, 2000)
    touch(ringing, OTHER)
    again, _ = advance(ringing, 2000)
    assert first.tobytes() == again.tobytes()


def test_the_stream_is_the_modal_route() -> None:
    streamed, _ = play(begin(SETUP), 8820, 512)
    assert streamed.tobytes() == simulate(SETUP, 0.2, route="modal").segments.tobytes()


@pytest.mark.parametrize("preset", ["appendix", "prototype"])
def test_after_a_touch_the_drivers_find_the_new_resonances(preset: str) -> None:
    """Within a fifth of a second, each on a harmonic of its segment; which one, history says."""
    string = load_string(preset).string
    _, ringing = advance(begin(SplitString(string=string)), 22050)
    for place, force in ((0.35, 1.0), (0.62, 0.2), (0.62, 2.0), (0.4, 1.3)):
        contact = Contact(position=place * string.length, force=force)
        _, ringing = advance(touch(ringing, contact), 8820)
        sound, ringing = advance(ringing, 22050)
        ratios = lines(sound, 44100)[0] / segment_frequencies(string, contact)
        assert (np.round(ratios) >= 1.0).all()
        assert ratios / np.round(ratios) == pytest.approx([1.0, 1.0], abs=1e-3)
        assert (np.abs(sound[:, -2205:]).max(axis=1) > 0.02).all()


def test_an_undriven_string_stays_silent_once_it_has_died_away() -> None:
    silent = SplitString(string=APPENDIX.string, drive=Drive(amplitude=0.0))
    sound, _ = advance(begin(silent), 44100)
    assert np.abs(sound[:, -441:]).max() < 1e-6 * np.abs(sound).max()


def test_a_sample_rate_out_of_range_is_refused() -> None:
    with pytest.raises(InputError, match="1000"):
        begin(SETUP, 1000)


def test_a_segment_too_short_to_be_heard_is_silent_and_the_other_sounds() -> None:
    _, ringing = advance(begin(SplitString(string=APPENDIX.string)), 8820)
    sound, ringing = advance(touch(ringing, Contact(position=0.005, force=0.0)), 22050)
    measured = np.abs(sound[:, -4410:]).max(axis=1)
    assert measured[0] < 1e-3
    assert measured[1] > 0.05
    sound, _ = advance(touch(ringing, None), 22050)
    assert (np.abs(sound[:, -4410:]).max(axis=1) > 0.05).all()


def test_a_touch_that_plucks_adds_the_pluck_to_both_segments() -> None:
    _, ringing = advance(begin(SETUP), 4410)
    strike = PluckShape(height=5e-4)
    stroked, struck = touch(ringing, OTHER), touch(ringing, OTHER, pluck=strike)
    first = struck.q - stroked.q
    assert first[: stroked.string.counts[0]].max() == pytest.approx(0.8e-3 / 2.0, rel=0.1)
    assert struck.v.tolist() == stroked.v.tolist()


PLUCKED = replace(SETUP, contact=Contact(position=0.2, force=0.0))
OPEN = replace(SETUP, contact=None)


def shape(ringing: Ringing, places: Floats) -> Floats:
    """The displacement in m of the string, counted from its first support."""
    result, first = np.zeros(places.size), 0
    for segment, count in zip(ringing.string.segments, ringing.string.counts, strict=True):
        local = (places - segment.origin) * segment.direction
        inside = (local > 0.0) & (local < segment.length)
        waves = np.sin(np.outer(local, np.arange(1, count + 1)) * np.pi / segment.length)
        result += np.where(inside, waves @ ringing.q[first : first + count], 0.0)
        first += count
    return result


def test_a_touch_at_the_same_place_changes_nothing() -> None:
    _, ringing = advance(begin(PLUCKED), 100)
    same = touch(ringing, PLUCKED.contact)
    assert same.q == pytest.approx(ringing.q, abs=1e-12 * np.abs(ringing.q).max())
    assert same.v == pytest.approx(ringing.v, abs=1e-12 * np.abs(ringing.v).max())


def test_a_release_keeps_the_shape() -> None:
    touched, places = begin(PLUCKED), np.linspace(0.01, 0.64, 60)
    released = shape(touch(touched, None), places)
    # The kink at the old touch is rounded by the end of the audio band, and no more than that.
    assert released == pytest.approx(shape(touched, places), abs=0.05e-4)
    assert np.abs(released).max() > 0.9e-4


def test_a_new_touch_takes_the_string_to_rest_there_along_the_static_triangle() -> None:
    free, places = begin(OPEN), np.linspace(0.005, 0.645, 120)
    depth = shape(free, np.array([0.2]))[0]
    ramp = np.interp(places, [0.0, 0.2, 0.65], [0.0, 1.0, 0.0])
    assert depth > 0.5e-4
    assert shape(touch(free, PLUCKED.contact), places) == pytest.approx(
        shape(free, places) - depth * ramp, abs=0.01e-4
    )


RATE = 44100


def setup(**drive: object) -> SplitString:
    return SplitString(
        string=APPENDIX.string,
        contact=Contact(position=0.2275, force=0.0),
        drive=Drive(**drive),  # pyright: ignore[reportArgumentType]
    )


def tone(frequency: float, seconds: float = 0.05, phase: float = 0.0, level: float = 1.0) -> Floats:
    times = np.arange(round(seconds * RATE)) / RATE
    return level * np.sin(2.0 * np.pi * frequency * times + phase)


@pytest.mark.parametrize("frequency", [120.0, 695.006, 8000.1])
@pytest.mark.parametrize("size", [2048, 2205])
def test_a_line_is_read_between_bins(frequency: float, size: int) -> None:
    signal = tone(frequency, phase=0.7)[:size]
    measured, phase = lines(np.stack((signal, 1e-4 * signal)), RATE)
    assert measured == pytest.approx([frequency] * 2, rel=2e-4)
    now = 2.0 * np.pi * frequency * signal.size / RATE + 0.7
    assert np.cos(phase - now) == pytest.approx([1.0, 1.0], abs=0.02)


def test_a_driver_is_silent_until_it_has_heard_a_window_then_joins_in_phase() -> None:
    case = setup()
    sound = np.stack((tone(700.0, phase=1.0), tone(370.0, phase=2.0)))
    drivers = feedback.begin(case.drive, RATE)
    assert np.isnan(drivers.tone).all()
    drivers = retune(sense(drivers, sound[:, :1000]), case, RATE, 0.02)
    assert np.isnan(drivers.tone).all()
    assert not drivers.phasor(10, 1e-4).any()
    drivers = retune(sense(drivers, sound[:, 1000:]), case, RATE, 0.05)
    assert drivers.frequency == pytest.approx([700.0, 370.0], rel=1e-3)
    goes_on = 2.0 * np.pi * np.array([700.0, 370.0]) * 0.05 + [1.0, 2.0]
    assert np.cos(drivers.phase - goes_on) == pytest.approx([1.0, 1.0], abs=0.02)


def test_the_phase_runs_on_when_the_frequency_changes_unless_printed() -> None:
    sound = np.stack((tone(700.0), tone(370.0)))
    accumulated = setup(start_frequencies=(650.0, 350.0))
    drivers = feedback.advance(sense(feedback.begin(accumulated.drive, RATE), sound), 0.05)
    after = retune(drivers, accumulated, RATE, 0.05)
    assert after.frequency != pytest.approx(drivers.frequency)
    assert after.phase.tolist() == drivers.phase.tolist()
    printed = replace(accumulated, drive=replace(accumulated.drive, phase="printed"))
    jumped = retune(drivers, printed, RATE, 0.05)
    assert jumped.phase == pytest.approx(2.0 * np.pi * jumped.frequency * 0.05)
