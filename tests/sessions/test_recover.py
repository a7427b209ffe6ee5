from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from tests.sessions.made import as_killed, block, make

from monochord.core.errors import InputError
from monochord.sessions import check, read_session, recover

CUTS = 40


def count(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())


def test_a_file_cut_anywhere_keeps_all_that_is_whole(tmp_path: Path) -> None:
    path, cut = tmp_path / "a.mcap", tmp_path / "cut.mcap"
    make(path, seconds=1.0)
    whole, random = path.read_bytes(), np.random.default_rng(0)
    frames = read_session(path).audio.samples
    begin = whole.index(b"/clocks")  # in the first chunk, before which there is no session
    for length in (*random.integers(begin + 20000, len(whole), CUTS), len(whole) - 300):  # and in its summary
        cut.write_bytes(whole[:length])
        before = read_session(cut).audio.samples
        recovery = recover(cut)
        after = read_session(cut)
        assert recovery.repaired
        assert recovery.cut is None, "but for the last writing there is nothing to keep"
        assert after.recovered
        assert (after.audio.samples == before).all()
        assert (frames[:, : before.shape[1]] == before).all()
        assert count(cut) == recovery.messages
        assert check(cut).sound
        assert not recover(cut).repaired, "the second time there is nothing to do"


def test_a_whole_file_is_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=0.5)
    before = path.read_bytes()
    recovery = recover(path)
    assert (recovery.repaired, recovery.lost_bytes) == (False, 0)
    assert path.read_bytes() == before


@pytest.mark.parametrize("close", [False, True])
def test_damage_costs_its_chunk_and_nothing_behind_it(tmp_path: Path, *, close: bool) -> None:
    path = tmp_path / "a.mcap"
    writer = make(path, seconds=2.0, close=close)
    if not close:
        as_killed(writer)
    whole = read_session(path).audio.samples
    content = bytearray(path.read_bytes())
    content[len(content) // 4] ^= 0xFF
    path.write_bytes(content)
    assert "1 damaged chunk" in check(path).faults
    recovery = recover(path)
    assert recovery.repaired
    assert 0 < recovery.lost_bytes < len(content) // 4
    assert recovery.cut
    assert recovery.cut.read_bytes()[:100_000] in content, "the damaged chunk is kept"
    there = read_session(path)
    assert there.audio.samples.shape == whole.shape
    assert (there.audio.samples == whole).mean() > 0.8
    assert len(there.audio.gaps) == 2, "one was recorded, one is the damage"
    assert check(path).sound
    assert count(path) == recovery.messages


def test_saved_remains_replace_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=1.0)
    whole = path.read_bytes()
    remains: list[Path] = []
    for part in (2, 3, 4):
        content = bytearray(whole)
        content[len(content) // part] ^= 1
        path.write_bytes(content)
        cut = recover(path).cut
        assert cut
        remains.append(cut)
    assert [cut.name for cut in remains] == ["a.mcap.cut", "a.mcap.cut2", "a.mcap.cut3"]
    assert len({cut.read_bytes() for cut in remains}) == 3


def test_a_session_that_is_being_recorded_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = make(path, seconds=1.0, close=False)
    before = path.read_bytes()
    with pytest.raises(InputError, match="being recorded"):
        recover(path)
    assert path.read_bytes() == before
    writer.audio(block(0, np.ones((2, 441), np.float32), start=44200))
    writer.close()
    assert check(path).sound
    assert read_session(path).audio.samples.shape[1] == 44641
    assert not recover(path).repaired


def test_zeros_that_a_power_cut_leaves_are_no_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    as_killed(make(path, seconds=1.0, close=False))
    frames = read_session(path).audio.samples
    with path.open("ab") as file:
        file.write(bytes(5000))
    recovery = recover(path)
    assert (recovery.lost_bytes, recovery.cut) == (5000, None)
    assert np.array_equal(read_session(path).audio.samples, frames)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        recover(tmp_path / "a.mcap")


def test_what_was_cut_before_it_says_what_it_is_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=0.5)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(InputError, match="no session"):
        recover(path)
    assert path.stat().st_size == 60


def test_its_length_is_what_check_tells(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=1.0)
    path.write_bytes(path.read_bytes()[:-3000])
    assert recover(path).seconds == check(path).seconds
