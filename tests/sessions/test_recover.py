import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from tests.sessions.made import make

from monochord.errors import InputError
from monochord.sessions import check, read_session, recover, walk

CUTS = 40


def count(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())


def test_a_file_cut_anywhere_keeps_all_that_is_whole(tmp_path: Path) -> None:
    path, cut = tmp_path / "a.mcap", tmp_path / "cut.mcap"
    make(path, seconds=2.0)
    whole, random = path.read_bytes(), np.random.default_rng(0)
    frames = read_session(path).audio.samples
    begin = whole.index(b"/clocks")  # in the first chunk, before which there is no session
    for _ in range(CUTS):
        length = int(random.integers(begin + 20000, len(whole)))
        cut.write_bytes(whole[:length])
        before = read_session(cut).audio.samples
        found = recover(cut)
        after = read_session(cut)
        assert found.repaired
        assert after.recovered
        assert (after.audio.samples == before).all()
        assert (frames[:, : before.shape[1]] == before).all()
        assert count(cut) == found.messages
        assert check(cut).sound
        assert not recover(cut).repaired, "the second time there is nothing to do"


def test_a_whole_file_is_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=0.5)
    before = path.read_bytes()
    found = recover(path)
    assert (found.repaired, found.lost_bytes) == (False, 0)
    assert path.read_bytes() == before


@pytest.mark.parametrize("close", [False, True])
def test_damage_costs_its_chunk_and_nothing_behind_it(tmp_path: Path, *, close: bool) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=2.0, close=close)
    whole = read_session(path).audio.samples
    content = bytearray(path.read_bytes())
    content[len(content) // 4] ^= 0xFF
    path.write_bytes(content)
    found = recover(path)
    assert found.repaired == (not close)
    assert 0 < found.lost_bytes < len(content) // 4
    there = read_session(path)
    assert there.audio.samples.shape == whole.shape
    assert (there.audio.samples == whole).mean() > 0.8
    assert len(there.audio.gaps) == 2, "one was recorded, one is the damage"
    assert "1 damaged chunk" in check(path).faults
    if not close:
        assert count(path) == found.messages


def test_what_is_more_than_a_torn_writing_is_kept_beside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=1.0)
    whole = path.read_bytes()
    second = [r for r in walk.records(walk.mapped(path)) if r.opcode == walk.CHUNK][1]
    content = bytearray(whole)
    content[second.offset + 8] ^= 0xFF  # of its length
    path.write_bytes(content)
    monkeypatch.setattr(sys.modules[recover.__module__], "TORN", 1000)
    assert recover(path).lost_bytes == len(whole) - second.offset
    assert Path(f"{path}.cut").read_bytes() == content[second.offset :]
    assert check(path).sound


def test_damage_anywhere_is_told_in_one_line_or_passed_over(tmp_path: Path) -> None:
    path, random = tmp_path / "a.mcap", np.random.default_rng(3)
    make(path, seconds=0.5)
    whole = path.read_bytes()
    edges = [0, len(whole) - 6000]  # of what no checksum guards
    for at in [
        *random.integers(8, len(whole), 60),
        *(random.integers(8, 6000, 60) + edges[0]),
        *(random.integers(0, 6000, 60) + edges[1]),
    ]:
        content = bytearray(whole)
        content[at] ^= 1 << int(random.integers(8))
        path.write_bytes(content)
        for look in (check, lambda file: read_session(file).audio, recover):
            with suppress(InputError):
                look(path)


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
