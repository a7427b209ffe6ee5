import time
from typing import Any

import numpy as np
import pytest

from monochord.capture.sources.jack import Jack
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Block
from monochord.lab.player import Player

pytestmark = pytest.mark.jack
RATE = 44100
INPUTS = ("recorder:in_1", "recorder:in_2")


@pytest.fixture
def noise() -> np.ndarray:
    return np.random.default_rng(0).standard_normal((2, 30_001), np.float32)


def assert_played_at(begin: float, blocks: list[Block], frame: int) -> None:
    times = [block.adc_time - block.start / RATE for block in blocks if block.adc_time is not None]
    # A server that is starved loses time that it does not count.
    assert float(np.median(times)) + frame / RATE == pytest.approx(begin, abs=2e-4 + float(np.ptp(times)))


def test_it_plays_once_a_listener_is_there_and_then_silence(jack_server: Any, noise: np.ndarray) -> None:
    with Player(noise, RATE, server=jack_server.name) as player:
        assert player.ports == ["player:out_1", "player:out_2"]
        assert not player.wait(0.1)
        assert player.position == 0
        with Jack(ports="player:", server=jack_server.name).open() as stream:
            captured: list[np.ndarray] = []
            for block in stream:
                captured.append(block.samples)
                if block.start >= 32_000:
                    break
        assert player.wait(20.0)
        assert player.ended
    got = np.concatenate(captured, axis=1)
    assert np.array_equal(got[:, : noise.shape[1]], noise)
    assert not got[:, noise.shape[1] :].any()


def test_it_connects_to_inputs_that_it_is_given(jack_server: Any, noise: np.ndarray) -> None:
    with Jack(ports="none", client_name="recorder", server=jack_server.name).open() as stream:
        with Player(noise, RATE, server=jack_server.name, connect=INPUTS) as player:
            assert player.wait(10.0)
        first = next(iter(stream))
    assert first.start == 0
    assert np.array_equal(first.samples, noise[:, :512])


@pytest.mark.parametrize("late", [-0.5, 0.1])
def test_it_begins_at_its_time(jack_server: Any, noise: np.ndarray, late: float) -> None:
    with Jack(ports="none", client_name="recorder", server=jack_server.name).open() as stream:
        begin = time.monotonic() - late
        with Player(noise, RATE, server=jack_server.name, connect=INPUTS, begin=begin) as player:
            assert player.wait(10.0)
        blocks: list[Block] = []
        for block in stream:
            blocks.append(block)
            if not stream.pending:
                break
    captured = np.concatenate([block.samples for block in blocks], axis=1)
    assert blocks[0].start == 0
    first = int(np.flatnonzero(captured.any(axis=0))[0])
    left_out = noise.shape[1] - int(np.count_nonzero(captured.any(axis=0)))
    if late < 0.0:
        assert left_out == 0
    else:
        assert late * RATE <= left_out < (late + 3.0) * RATE
        assert left_out < noise.shape[1]
    assert np.array_equal(captured[:, first : first + noise.shape[1] - left_out], noise[:, left_out:])
    assert_played_at(begin, blocks, first - left_out)


def test_it_notes_that_the_server_went(jack_server: Any, noise: np.ndarray) -> None:
    with Player(noise, RATE, server=jack_server.name) as player:
        jack_server.kill()
        assert not player.wait(10.0)
        assert player.gone
        assert not player.ended


@pytest.mark.parametrize(
    ("shape", "rate", "given"), [((2, 0), RATE, r"\(2, 0\)"), ((10,), RATE, "10"), ((2, 9), 48000, "48000")]
)
def test_what_cannot_be_played_is_refused(
    jack_server: Any, shape: tuple[int, ...], rate: int, given: str
) -> None:
    with pytest.raises(InputError, match=given):
        Player(np.zeros(shape, np.float32), rate, server=jack_server.name)


def test_an_input_that_is_not_there_is_refused(jack_server: Any, noise: np.ndarray) -> None:
    with pytest.raises(DeviceError, match="recorder:in_1"):
        Player(noise, RATE, server=jack_server.name, connect=("recorder:in_1",))
