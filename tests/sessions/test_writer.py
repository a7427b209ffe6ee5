"""A session as it is written: whole after every flush and on every full disk, and on the disk at its end."""

import errno
import gc
import os
import resource
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from tests.sessions.disks import small_disk
from tests.sessions.made import RATE, block, description, make, plain_readings

from monochord.core.errors import InputError
from monochord.core.types import Block, Feed
from monochord.sessions import SessionClock, SessionWriter, check, read_session, recover


def test_the_same_content_gives_the_same_bytes(tmp_path: Path) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        make(tmp_path / f"{name}.mcap", seconds=0.3, seed=seed)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    one, same, other = (check(tmp_path / f"{name}.mcap").content_checksum for name in "abc")
    assert one == same != other


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.mcap").write_text("mine")
    with pytest.raises(InputError, match=r"mine\.mcap"):
        make(tmp_path / "mine.mcap")
    assert (tmp_path / "mine.mcap").read_text() == "mine"
    with pytest.raises(InputError, match="nowhere"):
        make(tmp_path / "nowhere" / "a.mcap")
    with SessionWriter(tmp_path / "a.mcap", description()) as writer:
        with pytest.raises(InputError, match=r"1 channels.*2"):
            writer.audio(Block(samples=np.zeros((1, 10), np.float32), start=0))
        with pytest.raises(InputError, match=r"\(1, 3\).*\(1, 2\)"):
            writer.readings(plain_readings("oven", np.zeros(1), np.zeros((1, 3))))
    with pytest.raises(InputError, match=r"a\.mcap"):
        writer.event(0.0, "late")
    feed = Feed(stream="pose", columns=("x",), units=("m",))
    with pytest.raises(InputError, match="'pose'"):
        description(feeds=(feed, feed))
    for stream in ("", "Wrench", "a b", "1a", "audio"):
        with pytest.raises(InputError, match=f"'{stream}'"):
            description(feeds=(Feed(stream=stream, columns=("x",), units=("m",)),))


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


def test_a_buffer_that_is_filled_again_records_what_it_held(tmp_path: Path) -> None:
    sound = np.random.default_rng(0).normal(size=(2, 4410)).astype(np.float32)
    buffer = np.empty((2, 441), np.float32)
    with SessionWriter(tmp_path / "a.mcap", description()) as writer:
        for start in range(0, 4410, 441):
            buffer[:] = sound[:, start : start + 441]
            writer.audio(Block(samples=buffer, start=start))
        for start in (4409, 0):
            with pytest.raises(InputError, match=f"{start}.* 4410 or later"):
                writer.audio(Block(samples=buffer, start=start))
    assert np.array_equal(read_session(tmp_path / "a.mcap").audio.samples, sound)


def test_a_writer_that_is_dropped_lets_its_file_go(tmp_path: Path) -> None:
    writer = make(tmp_path / "a.mcap", seconds=1.0, close=False)
    with pytest.raises(InputError, match="writ"):
        recover(tmp_path / "a.mcap")
    del writer
    gc.collect()
    recover(tmp_path / "a.mcap")
    assert read_session(tmp_path / "a.mcap").audio.samples.shape[1] == RATE + 100  # a gap


def test_its_end_is_on_the_disk_when_it_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, on_disk = tmp_path / "a.mcap", [0]
    for name in ("fsync", "fdatasync"):
        wait = getattr(os, name)

        def waited(handle: int, wait: object = wait) -> None:
            assert callable(wait)
            wait(handle)
            if os.fstat(handle).st_ino == path.stat().st_ino:
                on_disk.append(path.stat().st_size)

        monkeypatch.setattr(os, name, waited)
    make(path, seconds=0.3)
    assert on_disk[-1] == path.stat().st_size > 0


def test_space_is_set_aside_while_it_is_open_and_given_back(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = make(path, seconds=0.1, close=False)
    used, allocated = path.stat().st_size, path.stat().st_blocks * 512
    writer.close()
    assert allocated > used + (2 << 20) or allocated <= used + 8192, "a file system sets aside much or cannot"
    assert path.stat().st_blocks * 512 <= path.stat().st_size + 8192


def test_memory_stays_small_where_nobody_flushes(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with SessionWriter(path, description(feeds=())) as writer:
        for k in range(12):
            writer.audio(block(k, np.zeros((2, RATE), np.float32), start=RATE * k))
            assert writer.size > (k - 4) * 8 * RATE


@pytest.fixture
def disk(tmp_path: Path) -> Generator[Path]:
    with small_disk(tmp_path / "small", 8 << 20) as folder:
        yield folder


def test_a_full_disk_ends_the_file_well(disk: Path) -> None:
    path = disk / "a.mcap"
    with pytest.raises(OSError, match=r"a\.mcap") as failure:
        make(path, seconds=60)
    assert failure.value.errno == errno.ENOSPC
    report = check(path)
    assert report.sound, report
    assert read_session(path).complete, "space that was set aside was enough for a good ending"
    assert report.seconds > 2.0


def test_a_disk_that_fills_from_elsewhere_ends_the_file_well(disk: Path) -> None:
    path = disk / "a.mcap"
    writer = make(path, seconds=0.5, close=False)
    with suppress(OSError), (disk / "other").open("wb", buffering=0) as other:
        while True:
            other.write(bytes(65536))
    with pytest.raises(OSError, match=r"a\.mcap"):  # noqa: PT012
        for k in range(10000):
            writer.audio(block(k, np.zeros((2, 441), np.float32), start=22150 + 441 * k))
    assert check(path).sound
    assert read_session(path).audio.samples.shape[1] > 22150


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
    ("limit", "seconds"), [(3_000_000, 1.0), (3_150_003, 1.0), (3_350_007, 1.0), (6 << 20, 1.5)]
)
def test_a_limit_on_the_size_of_files_ends_the_file_well(tmp_path: Path, limit: int, seconds: float) -> None:
    path = tmp_path / "a.mcap"
    with files_up_to(limit), pytest.raises(OSError, match=r"a\.mcap") as failure:
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
    with files_up_to(limit), pytest.raises(OSError, match=r"a\.mcap"):  # noqa: PT012
        writer = SessionWriter(path, description(feeds=()), SessionClock(epoch_ns=0))
        for k in range(36_000):
            writer.event(0.1 * k, "note")
            writer.clocks(0.1 * k, {"realtime": 0.0})
            writer.flush()
    assert read_session(path).complete
    assert check(path).sound
    assert path.stat().st_size <= limit


def test_a_stream_called_labels_is_labels(tmp_path: Path) -> None:
    feed = Feed(stream="labels", columns=("contact", "force"), units=("", "N"))
    with SessionWriter(tmp_path / "a.mcap", description(feeds=(feed,)), SessionClock(epoch_ns=0)) as writer:
        values = np.array([[0.0, np.nan], [1.0, 0.5], [1.0, 0.7]])
        writer.readings(plain_readings("labels", np.array([0.0, 0.1, 0.2]), values))
    session = read_session(tmp_path / "a.mcap")
    assert session.streams == ()
    assert session.labels.time.tolist() == [0.0, 0.1, 0.2]
    assert session.labels.columns["contact"].tolist() == [0.0, 1.0, 1.0]


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOSYS, errno.EOPNOTSUPP])
def test_a_file_system_that_cannot_sync_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refused(handle: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fdatasync", refused)
    monkeypatch.setattr(os, "fsync", refused)
    path = tmp_path / "a.mcap"
    writer = make(path, seconds=0.3, close=False)
    writer.flush(sync=True)
    writer.sync()
    writer.close()
    assert check(path).sound
    path.write_bytes(path.read_bytes()[:-300])
    assert recover(path).repaired
    assert check(path).sound


def test_a_disk_that_fails_is_told_with_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = make(tmp_path / "a.mcap", seconds=0.3, close=False)

    def failed(handle: int, data: object = None) -> int:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fdatasync", failed)
    with pytest.raises(OSError, match=r"a\.mcap") as failure:
        writer.sync()
    assert failure.value.errno == errno.EIO
    monkeypatch.setattr(os, "write", failed)
    writer.event(100.0, "mark")
    with pytest.raises((OSError, InputError), match=r"a\.mcap"):
        writer.flush()
