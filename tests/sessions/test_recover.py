from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from tests.sessions.made import make

from monochord.errors import InputError
from monochord.sessions import check, read_session, recover

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


def test_what_follows_damage_is_cut_off(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=2.0, close=False)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    found = recover(path)
    assert found.repaired
    assert 0.3 < found.seconds < 1.3
    assert check(path).sound


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        recover(tmp_path / "a.mcap")
