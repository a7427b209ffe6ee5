"""What every source promises: indices that never go back, samples whatever the block size, a prompt end."""

import dataclasses
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from itertools import islice, pairwise
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.capture.sources import SOURCES
from monochord.capture.sources._array import ArraySource
from monochord.capture.sources._virtual_sensor import VirtualSensorSource
from monochord.capture.sources.base import Source, Stream
from monochord.core.errors import DeviceError
from monochord.core.types import Block
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.sessions import Description, SessionWriter

RATE = 44100
DEVICES = {"jack", "soundcard"}  # their sound is never the same twice
MAY_BE_ABSENT = {"soundcard"}  # a JACK server is started; a card cannot be
Open = Callable[..., Any]


def of_array(**options: Any) -> Source:
    noise = 0.1 * np.random.default_rng(0).standard_normal((2, RATE)).astype(np.float32)
    return ArraySource(samples=noise, sample_rate=RATE, **options)


def of_virtual_sensor(**options: Any) -> Source:
    return VirtualSensorSource(sensor=VirtualSensor("prototype", seed=1), **options)


FOR_PROGRAMS = {"an array": of_array, "a virtual sensor": of_virtual_sensor}
"""Sources that `mc.listen` builds of its argument; they have no name on the command line."""


def fields(name: str) -> set[str]:
    return {field.name for field in dataclasses.fields(SOURCES.load(name))}  # pyright: ignore[reportArgumentType]


@pytest.fixture
def what_to_open(request: pytest.FixtureRequest, tmp_path: Any) -> Callable[[str], dict[str, Any]]:
    """The options of a source that needs something to be there; that something is made here."""

    def take() -> dict[str, Any]:
        noise = 0.1 * np.random.default_rng(0).standard_normal((RATE, 2))
        soundfile.write(tmp_path / "take.wav", noise, RATE)
        return {"path": str(tmp_path / "take.wav")}

    def server() -> dict[str, Any]:
        return {"server": request.getfixturevalue("jack_server").name}

    def session() -> dict[str, Any]:
        path = tmp_path / "take.mcap"
        if not path.exists():
            noise = np.random.default_rng(0).standard_normal((2, RATE)).astype(np.float32)
            with SessionWriter(path, Description(name="take", sample_rate=RATE)) as writer:
                writer.audio(Block(samples=noise[:, :1000], start=0))
                writer.audio(Block(samples=noise[:, 1000:], start=1300, dropped=300))
        return {"path": str(path)}

    special = {"wav": take, "jack": server, "session": session}
    return lambda name: special.get(name, dict)()


@pytest.fixture
def opened(what_to_open: Callable[[str], dict[str, Any]]) -> Open:
    """Return what opens a source by name, as fast as it can and with whatever else is given."""

    @contextmanager
    def start(name: str, **options: Any) -> Generator[Stream]:
        if name in FOR_PROGRAMS:
            source = FOR_PROGRAMS[name](**options)
        else:
            fast = {"speed": 0.0} if "speed" in fields(name) else {}
            source = SOURCES.build(name, {**fast, **what_to_open(name), **options})
        context = source.open()
        try:
            stream = context.__enter__()
        except DeviceError as error:
            if name not in MAY_BE_ABSENT:
                raise
            pytest.skip(str(error))
        try:
            yield stream
        finally:
            context.__exit__(None, None, None)

    return start


each_source = pytest.mark.parametrize("name", [*SOURCES.names(), *FOR_PROGRAMS])


@each_source
def test_blocks_follow_each_other(name: str, opened: Open) -> None:
    with opened(name) as stream:
        blocks: list[Block] = list(islice(stream, 30))
        signal, health = stream.signal, stream.health
        assert stream.pending >= 0
        assert all(isinstance(value, float | int) for value in stream.truth(0, 10).values())
    assert len(blocks) == 30
    assert 16_000 <= signal.sample_rate <= 192_000
    for block in blocks:
        assert block.samples.dtype == np.float32
        assert block.samples.shape[0] == signal.channels
        assert block.samples.shape[1] > 0
        assert block.dropped >= 0
    assert blocks[0].start == blocks[0].dropped
    assert all(b.start == a.start + a.samples.shape[1] + b.dropped for a, b in pairwise(blocks))
    assert health.frames in {0, sum(block.samples.shape[1] for block in blocks)}


@each_source
def test_a_block_keeps_its_samples_when_the_next_one_comes(name: str, opened: Open) -> None:
    with opened(name) as stream:
        reader = iter(stream)
        first = next(reader)
        copy = first.samples.copy()
        list(islice(reader, 30))
        assert np.array_equal(first.samples, copy)


@pytest.mark.parametrize("name", sorted({*SOURCES.names(), *FOR_PROGRAMS} - DEVICES))
def test_the_size_of_blocks_does_not_change_the_samples(name: str, opened: Open) -> None:
    def beginning(block: int) -> np.ndarray:
        with opened(name, block=block) as stream:
            parts = [part.samples for part in islice(stream, -(-2000 // block))]
        return np.concatenate(parts, axis=1)[:, :2000]

    assert np.array_equal(beginning(64), beginning(501))


@each_source
def test_close_ends_the_iteration_from_another_thread(name: str, opened: Open) -> None:
    with opened(name) as stream:
        blocks = iter(stream)
        next(blocks)
        closed: list[float] = []

        def close() -> None:
            stream.close()
            closed.append(time.monotonic())

        threading.Timer(0.05, close).start()
        for _ in blocks:
            time.sleep(0.001)
        ended = time.monotonic()
        while not closed:  # a file may end before
            time.sleep(0.01)
        assert ended - closed[0] < 0.5


@each_source
def test_closing_again_or_after_the_end_does_no_harm(name: str, opened: Open) -> None:
    with opened(name) as stream:
        stream.close()
        stream.close()
        assert len(list(islice(stream, 1000))) < 1000
    stream.close()
    assert stream.pending >= 0
    assert stream.health.frames >= 0


@each_source
def test_leaving_the_context_ends_the_iteration_in_another_thread(name: str, opened: Open) -> None:
    started = threading.Event()

    def read(stream: Stream) -> None:
        for _ in stream:
            started.set()
            time.sleep(0.001)

    with opened(name) as stream:
        reader = threading.Thread(target=read, args=(stream,))
        reader.start()
        assert started.wait(10.0)
    reader.join(2.0)
    assert not reader.is_alive()
