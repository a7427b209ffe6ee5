"""The stream: the same samples however they are cut, and touches that come and go."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats
from monochord.physics.split_string import Drive, Pluck, Ringing, SplitString, advance, begin, simulate, touch
from monochord.physics.split_string.feedback import lines
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


@pytest.mark.parametrize("block", [1, 64, 1000])
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


def test_no_samples_are_no_samples() -> None:
    velocity, ringing = advance(begin(SETUP), 0)
    assert velocity.shape == (2, 0)
    assert ringing.start == 0


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


def test_a_touch_while_nothing_is_heard_yet_keeps_the_drivers_silent() -> None:
    _, ringing = advance(begin(SETUP), 100)
    assert np.isnan(touch(ringing, OTHER).drivers.tone).all()


def test_an_undriven_string_stays_silent_once_it_has_died_away() -> None:
    silent = SplitString(string=APPENDIX.string, drive=Drive(amplitude=0.0))
    sound, _ = advance(begin(silent), 44100)
    assert np.abs(sound[:, -441:]).max() < 1e-6 * np.abs(sound).max()


def test_a_sample_rate_out_of_range_is_refused() -> None:
    with pytest.raises(InputError, match="sample rate 1000 Hz: allowed is 8000 to 384000 Hz"):
        begin(SETUP, 1000)


def test_a_segment_too_short_to_be_heard_is_silent_and_the_other_sounds() -> None:
    _, ringing = advance(begin(SplitString(string=APPENDIX.string)), 8820)
    sound, ringing = advance(touch(ringing, Contact(position=0.005, force=0.0)), 22050)
    heard = np.abs(sound[:, -4410:]).max(axis=1)
    assert heard[0] < 1e-3
    assert heard[1] > 0.05
    sound, _ = advance(touch(ringing, None), 22050)
    assert (np.abs(sound[:, -4410:]).max(axis=1) > 0.05).all()


def test_a_touch_that_plucks_adds_the_pluck_to_both_segments() -> None:
    _, ringing = advance(begin(SETUP), 4410)
    strike = Pluck(height=5e-4)
    stroked, struck = touch(ringing, OTHER), touch(ringing, OTHER, pluck=strike)
    first = struck.q - stroked.q
    assert first[: stroked.string.counts[0]].max() == pytest.approx(0.8e-3 / 2.0, rel=0.1)
    assert struck.v.tolist() == stroked.v.tolist()
