import errno
import os
import resource
import subprocess
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from tests.sessions.made import RATE, block, description, make, plain_readings

from monochord.core.errors import InputError
from monochord.core.types import Block, Feed
from monochord.sessions import Description, SessionClock, SessionWriter, check, read_session


def test_the_same_content_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        make(tmp_path / f"{name}.mcap", seconds=0.5)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    make(tmp_path / "c.mcap", seconds=0.5, seed=1)
    assert check(tmp_path / "a.mcap").content_checksum == check(tmp_path / "b.mcap").content_checksum
    assert check(tmp_path / "a.mcap").content_checksum != check(tmp_path / "c.mcap").content_checksum


def test_an_existing_file_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("mine")
    with pytest.raises(InputError, match=r"exists.*a new file"):
        make(path)
    assert path.read_text() == "mine"


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        make(tmp_path / "nowhere" / "a.mcap")
    with SessionWriter(tmp_path / "a.mcap", description()) as writer:
        with pytest.raises(InputError, match=r"block of 1 channels.*2"):
            writer.audio(Block(samples=np.zeros((1, 10), np.float32), start=0))
        with pytest.raises(InputError, match=r"shape \(1, 3\).*\(1, 2\)"):
            writer.readings(plain_readings("oven", np.zeros(1), np.zeros((1, 3))))
    with pytest.raises(InputError, match="closed"):
        writer.event(0.0, "late")


@pytest.mark.parametrize("flushed", [True, False])
def test_what_was_flushed_is_readable_without_closing(tmp_path: Path, *, flushed: bool) -> None:
    path = tmp_path / "a.mcap"
    writer = make(path, seconds=1.0, close=False)
    writer.audio(block(0, np.ones((2, 441), np.float32), start=44200))
    if flushed:
        writer.flush()
    session = read_session(path)
    assert not session.complete
    assert session.audio.samples.shape[1] == 44200 + 441 * flushed
    writer.close()
    assert read_session(path).complete
    assert read_session(path).audio.samples.shape[1] == 44641


def test_a_message_holds_blocks_that_follow_each_other(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with SessionWriter(path, description(), SessionClock(epoch_ns=0)) as writer:
        for k in range(100):
            writer.audio(block(k, np.full((2, 64), k, np.float32), start=64 * k + (k >= 50), dropped=k == 50))
    session = read_session(path)
    assert session.audio.gaps == ((3200, 3201),)
    assert len(list(session.messages("/audio"))) == 2
    assert np.array_equal(session.audio.samples[0, 3201::64], np.arange(50, 100))


def test_memory_stays_small_where_nobody_flushes(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with SessionWriter(path, description(feeds=())) as writer:
        for k in range(30):
            writer.audio(block(k, np.zeros((2, RATE), np.float32), start=RATE * k))
            assert writer.size > (k - 4) * 8 * RATE


@pytest.fixture
def small_disk(tmp_path: Path) -> "object":
    folder = tmp_path / "small"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting a small disk is not allowed here")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def test_a_full_disk_ends_the_file_well(small_disk: Path) -> None:
    path = small_disk / "a.mcap"
    with pytest.raises(OSError, match="No space left") as failure:
        make(path, seconds=60)
    assert failure.value.errno == errno.ENOSPC
    report, session = check(path), read_session(path)
    assert report.sound, report
    assert session.complete, "space that was set aside was enough for a good ending"
    assert report.seconds > 2.0


@contextmanager
def files_up_to(limit: int) -> Generator[None]:
    """Let the system refuse to make a file longer than some bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    ("limit", "seconds"), [*((limit, 1.0) for limit in range(3_000_000, 3_400_000, 50_001)), (6 << 20, 1.5)]
)
def test_a_limit_on_the_size_of_files_ends_the_file_well(tmp_path: Path, limit: int, seconds: float) -> None:
    path = tmp_path / "a.mcap"
    with files_up_to(limit), pytest.raises(OSError, match="File too large") as failure:
        make(path, seconds=60)
    assert failure.value.errno == errno.EFBIG
    report = check(path)
    assert report.sound, report
    assert read_session(path).complete
    assert path.stat().st_size <= limit
    assert report.seconds > seconds


@pytest.mark.slow
def test_an_hour_has_space_for_its_ending(tmp_path: Path) -> None:
    """The summary grows with the number of chunks: what is set aside below a limit must grow with it."""
    path, limit = tmp_path / "a.mcap", 12_000_000
    with files_up_to(limit), pytest.raises(OSError, match="File too large"):  # noqa: PT012
        writer = SessionWriter(path, description(feeds=()), SessionClock(epoch_ns=0))
        for k in range(36_000):
            writer.event(0.1 * k, "note")
            writer.clocks(0.1 * k, {"realtime": 0.0})
            writer.flush()
    assert read_session(path).complete
    assert check(path).sound
    assert path.stat().st_size <= limit


def test_a_disk_that_fills_from_elsewhere_ends_the_file_well(small_disk: Path) -> None:
    path = small_disk / "a.mcap"
    writer = make(path, seconds=0.5, close=False)

    def fill() -> None:
        with (small_disk / "other").open("wb", buffering=0) as other:
            while True:
                other.write(bytes(65536))

    def go_on() -> None:
        for k in range(10000):
            writer.audio(block(k, np.zeros((2, 441), np.float32), start=22150 + 441 * k))

    with suppress(OSError):
        fill()
    with pytest.raises(OSError, match="No space"):
        go_on()
    assert check(path).sound
    assert read_session(path).audio.samples.shape[1] > 22150


def test_feeds_must_have_names_of_their_own() -> None:
    feed = Feed(stream="pose", columns=("x",), units=("m",))
    with pytest.raises(InputError, match="two streams called 'pose'"):
        Description(name="a", sample_rate=RATE, feeds=(feed, feed))


def test_a_stream_called_labels_is_labels(tmp_path: Path) -> None:
    feed = Feed(stream="labels", columns=("contact", "force"), units=("", "N"))
    with SessionWriter(tmp_path / "a.mcap", description(feeds=(feed,)), SessionClock(epoch_ns=0)) as writer:
        values = np.array([[0.0, np.nan], [1.0, 0.5], [1.0, 0.7]])
        writer.readings(plain_readings("labels", np.array([0.0, 0.1, 0.2]), values))
    session = read_session(tmp_path / "a.mcap")
    assert session.streams == ()
    assert session.labels.time.tolist() == [0.0, 0.1, 0.2]
    assert session.labels.columns["contact"].tolist() == [0.0, 1.0, 1.0]


@pytest.mark.parametrize("stream", ["", "Wrench", "a b", "1a", "audio", "events"])
def test_a_stream_needs_a_name_that_a_topic_can_have(tmp_path: Path, stream: str) -> None:
    feed = Feed(stream=stream, columns=("x",), units=("m",))
    with pytest.raises(InputError, match=r"stream '.*': allowed is"):
        description(feeds=(feed,))
