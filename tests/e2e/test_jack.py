"""Capture through a real JACK server: every frame, in order, bit for bit, whatever happens."""

import ctypes
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.waiting import wait_for

from monochord.capture.sources.jack import Jack
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Block

pytestmark = pytest.mark.jack
RATE = 44100


class Capture:
    """Captures in a thread of its own, so that the test's main thread may be as busy as it likes."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.blocks: list[Block] = []
        self.arrivals: list[float] = []
        self.error: Exception | None = None
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        try:
            for block in self.stream:
                self.arrivals.append(time.monotonic())
                self.blocks.append(block)
        except DeviceError as error:
            self.error = error

    @property
    def frames(self) -> int:
        return sum(block.samples.shape[1] for block in list(self.blocks))

    def wait_for(self, condition: Callable[[], bool], seconds: float = 30.0) -> None:
        wait_for(condition, seconds)

    def stop(self) -> None:
        self.stream.close()
        self.thread.join(10)
        assert not self.thread.is_alive()

    def audio(self, first: int = 0, last: int | None = None) -> np.ndarray:
        return np.concatenate([block.samples for block in self.blocks[first:last]], axis=1)


@contextmanager
def capturing(server: Any, ports: str = "player:", **options: Any) -> Generator[Capture]:
    with Jack(server=server.name, ports=ports, **options).open() as stream:
        capture = Capture(stream)
        try:
            yield capture
        finally:
            capture.stop()


def samples_of(file: Path) -> np.ndarray:
    return soundfile.read(file, dtype="float32", always_2d=True)[0].T


def busy(until: Callable[[], bool], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not until():
        assert time.monotonic() < deadline
        sum(i * i for i in range(20_000))


def hold_the_interpreter(seconds: float) -> None:
    """Sleep without giving up the interpreter's lock: no other Python code runs meanwhile."""
    ctypes.PyDLL(None).usleep(round(seconds * 1e6))


def in_order(blocks: list[Block]) -> bool:
    return blocks[0].start == 0 and all(
        b.start == a.start + a.samples.shape[1] + b.dropped for a, b in pairwise(blocks)
    )


# With periods of 1.5 ms the server itself loses some where the machine stands still for longer.
@pytest.mark.parametrize("jack_server", [pytest.param(64, marks=pytest.mark.slow), 512], indirect=True)
def test_every_frame_is_captured_while_the_main_thread_is_busy(
    jack_server: Any, play: Any, recording: Path
) -> None:
    sound = samples_of(recording)
    play(recording)
    with capturing(jack_server) as capture:
        busy(lambda: capture.frames >= sound.shape[1])
    assert in_order(capture.blocks)
    assert np.array_equal(capture.audio()[:, : sound.shape[1]], sound)
    health = capture.stream.health
    assert (health.dropped, health.gaps, health.reconnects) == (0, 0, 0)
    assert health.frames == capture.frames


def test_blocks_carry_the_converters_time(jack_server: Any, play: Any, recording: Path) -> None:
    play(recording)
    with capturing(jack_server) as capture:
        capture.wait_for(lambda: capture.frames > RATE)
        offsets = capture.stream.health.clock_offsets
    times = np.array([block.adc_time for block in capture.blocks])
    lag = np.array(capture.arrivals) - times
    assert np.median(np.diff(times)) == pytest.approx(512 / RATE, rel=0.05)
    assert 0.0 < np.median(lag) < 0.1
    assert offsets["jack"] == pytest.approx(offsets["monotonic_raw"], abs=1e-3)


def test_nothing_is_lost_while_no_python_runs_at_all(jack_server: Any, play: Any, recording: Path) -> None:
    sound = samples_of(recording)
    play(recording)
    with capturing(jack_server) as capture:
        capture.wait_for(lambda: capture.frames > 4096)
        hold_the_interpreter(0.7)
        capture.wait_for(lambda: capture.frames >= sound.shape[1])
    assert np.diff(capture.arrivals).max() > 0.6
    assert capture.stream.health.dropped == 0
    assert np.array_equal(capture.audio()[:, : sound.shape[1]], sound)


def test_a_full_ring_loses_frames_and_says_exactly_which(
    jack_server: Any, play: Any, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("monochord.capture.sources._jack_stream.RING_SECONDS", 0.1)
    sound = samples_of(recording)
    play(recording)
    with capturing(jack_server) as capture:
        capture.wait_for(lambda: capture.frames > 4096)
        hold_the_interpreter(0.6)
        capture.wait_for(lambda: capture.blocks[-1].start >= sound.shape[1])
    assert in_order(capture.blocks)
    assert 0.2 * RATE < capture.stream.health.dropped < 0.7 * RATE
    assert capture.stream.health.gaps == sum(block.dropped > 0 for block in capture.blocks)
    for block in capture.blocks:
        stop = min(block.start + block.samples.shape[1], sound.shape[1])
        assert np.array_equal(block.samples[:, : max(stop - block.start, 0)], sound[:, block.start : stop])


def test_capture_outlives_a_killed_server(jack_server: Any, play: Any, recording: Path) -> None:
    sound = samples_of(recording)
    play(recording)
    with capturing(jack_server) as capture:
        capture.wait_for(lambda: capture.frames > RATE // 2)
        jack_server.kill()
        time.sleep(0.5)
        before = len(capture.blocks)
        jack_server.restart()
        play(recording)
        capture.wait_for(lambda: capture.frames > RATE)
    back = capture.blocks[before]
    assert in_order(capture.blocks)
    assert [block.dropped > 0 for block in capture.blocks].count(True) == 1
    silence = capture.arrivals[before] - capture.arrivals[before - 1] - 512 / RATE
    assert back.dropped / RATE == pytest.approx(silence, abs=0.06)
    health = capture.stream.health
    assert (health.reconnects, health.gaps, health.dropped) == (1, 1, back.dropped)
    for part in (capture.audio(0, before), capture.audio(before)):
        known = min(part.shape[1], sound.shape[1])
        assert np.array_equal(part[:, :known], sound[:, :known])


def test_two_captures_of_one_program_outlive_their_server(jack_server: Any) -> None:
    with capturing(jack_server, ports="") as first, capturing(jack_server, ports="") as second:
        for round_, end in enumerate((jack_server.kill, jack_server.stop), 1):
            end()
            jack_server.start()
            for capture in (first, second):
                capture.wait_for(lambda capture=capture, n=round_: capture.stream.health.gaps == n)
    for capture in (first, second):
        assert in_order(capture.blocks)
        assert capture.stream.health.reconnects == 2


def test_capture_takes_up_a_port_that_comes_back(jack_server: Any, play: Any, recording: Path) -> None:
    sound = samples_of(recording)
    player = play(recording)
    with capturing(jack_server) as capture:
        capture.wait_for(lambda: capture.frames > RATE // 2)
        player.terminate()
        player.wait(20)
        time.sleep(0.3)
        before = len(capture.blocks)
        play(recording)
        capture.wait_for(lambda: len(capture.blocks) > before + 20)
    assert in_order(capture.blocks)
    health = capture.stream.health
    assert (health.reconnects, health.gaps) == (1, 1)
    assert health.dropped == capture.blocks[before].dropped
    assert health.dropped % 512 == 0
    assert health.dropped / RATE > 0.3
    again = capture.audio(before)
    assert np.array_equal(again[:, : sound.shape[1]], sound[:, : again.shape[1]])


@pytest.mark.parametrize("gone", ["port", "server"])
def test_without_reconnecting_the_stream_fails_with_its_port_or_server(
    jack_server: Any, play: Any, recording: Path, gone: str
) -> None:
    player = play(recording)
    with capturing(jack_server, reconnect=False) as capture:
        capture.wait_for(lambda: capture.frames > 4096)
        player.terminate() if gone == "port" else jack_server.kill()
        capture.thread.join(10)
        assert not capture.thread.is_alive()
    assert isinstance(capture.error, DeviceError)
    assert gone in str(capture.error)


def test_a_server_at_another_rate_ends_the_stream(jack_server: Any) -> None:
    with capturing(jack_server, ports="") as capture:
        capture.wait_for(lambda: capture.frames > 4096)
        jack_server.restart(rate=48000)
        capture.thread.join(20)
    assert isinstance(capture.error, DeviceError)
    assert "48000 Hz" in str(capture.error)


def test_close_ends_the_wait_for_a_server(jack_server: Any) -> None:
    with capturing(jack_server, ports="") as capture:
        capture.wait_for(lambda: capture.frames > 4096)
        jack_server.kill()
        time.sleep(0.3)
        capture.stop()


def test_one_channel_of_two(jack_server: Any, play: Any, recording: Path) -> None:
    sound = samples_of(recording)[1:]
    play(recording)
    # The player begins when all of its ports are connected: a second listener takes the other one.
    with (
        capturing(jack_server, ports="player:out_2", channels=1) as second,
        capturing(jack_server, ports="player:out_1", channels=1, client_name="other"),
    ):
        second.wait_for(lambda: second.frames >= 2 * RATE)
    got = second.audio()
    begin = int(np.flatnonzero(got[0])[0]) - int(np.flatnonzero(sound[0])[0])
    assert begin % 512 == 0
    known = min(got.shape[1] - begin, sound.shape[1])
    assert np.array_equal(got[:, begin : begin + known], sound[:, :known])


@pytest.mark.parametrize(
    ("ports", "remedy"), [("guitar:", "'guitar:'"), ("system:capture_1", "channels=1"), ("(", r"\(")]
)
def test_ports_that_are_not_there_are_one_line(jack_server: Any, ports: str, remedy: str) -> None:
    source = Jack(server=jack_server.name, ports=ports)
    with pytest.raises((DeviceError, InputError), match=remedy) as caught, source.open():
        pass
    assert "\n" not in str(caught.value)


def test_a_server_too_slow_is_refused(jack_server: Any) -> None:
    jack_server.restart(rate=8000)
    with pytest.raises(InputError, match="8000"), Jack(server=jack_server.name).open():
        pass
