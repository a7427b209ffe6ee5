"""What `check` tells of a session that was cut off, and what `recover` makes of it."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from tests.sessions.made import EPOCH, RATE, as_killed, block, description, make

from monochord.core.errors import InputError
from monochord.sessions import SessionClock, SessionWriter, check, read_session, recover

CUTS = 12


def count(path: Path) -> int:
    with path.open("rb") as file:
        return sum(1 for _ in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())


def test_a_whole_session_is_sound_and_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path)
    report, before = check(path), path.read_bytes()
    assert report.sound
    assert report.messages["/labels"] == 200
    for remark, words in zip(
        report.remarks, (("100", "1 gap"), ("wrench", "21"), ("oven", "3")), strict=True
    ):
        assert all(word in remark for word in words)
    recovery = recover(path)
    assert (recovery.repaired, recovery.lost_bytes) == (False, 0)
    assert path.read_bytes() == before


@pytest.mark.parametrize("seconds", [0.4, 3.5])
def test_a_microphone_that_picked_up_nothing_is_a_remark(tmp_path: Path, seconds: float) -> None:
    path, frames = tmp_path / "a.mcap", round(seconds * RATE)
    sound = 0.1 * np.random.default_rng(0).standard_normal((2, frames)).astype(np.float32)
    sound[1] *= 1e-4
    with SessionWriter(path, description(feeds=()), SessionClock(epoch_ns=EPOCH, origin=100.0)) as writer:
        writer.audio(block(0, sound, start=0))
        if seconds > 1.0:  # lost frames are read as zeros, and are no silence
            writer.audio(block(1, 1e4 * sound, start=2 * frames, dropped=frames))
    *_, silence = check(path).remarks
    assert f"microphone 2 for {min(3.0, seconds):.1f} s" in silence
    assert "microphone 1" not in silence


def test_a_file_cut_anywhere_keeps_all_that_is_whole(tmp_path: Path) -> None:
    path, cut = tmp_path / "a.mcap", tmp_path / "cut.mcap"
    make(path, seconds=1.0)
    whole, random = path.read_bytes(), np.random.default_rng(0)
    frames = read_session(path).audio.samples
    begin = whole.index(b"/clocks")  # in the first chunk, before which there is no session
    for length in (*random.integers(begin + 20000, len(whole), CUTS), len(whole) - 300):  # and in its summary
        cut.write_bytes(whole[:length])
        assert any("sessions recover" in fault for fault in check(cut).faults)
        before = read_session(cut).audio.samples
        recovery = recover(cut)
        after, report = read_session(cut), check(cut)
        assert recovery.repaired
        assert recovery.cut is None, "but for the last writing there is nothing to keep"
        assert after.recovered
        assert (after.audio.samples == before).all()
        assert (frames[:, : before.shape[1]] == before).all()
        assert count(cut) == recovery.messages
        assert report.sound
        assert report.seconds == recovery.seconds
        assert not recover(cut).repaired, "the second time there is nothing to do"


def test_saved_remains_replace_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=1.0)
    whole = path.read_bytes()
    for part in (2, 3, 4):
        content, at = bytearray(whole), len(whole) // part
        content[at] ^= 1
        path.write_bytes(content)
        cut = recover(path).cut
        assert cut
        assert content[at - 50 : at + 50] in cut.read_bytes(), "the damaged chunk is kept"
    remains = {each.name: each.read_bytes() for each in tmp_path.iterdir() if each != path}
    assert sorted(remains) == ["a.mcap.cut", "a.mcap.cut2", "a.mcap.cut3"]
    assert len(set(remains.values())) == 3


def test_a_session_that_is_being_recorded_is_left_alone_and_reported_so(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = make(path, seconds=1.0, close=False)
    before, report = path.read_bytes(), check(path)
    assert len(report.faults) == 1
    assert "being recorded" in report.faults[0]
    assert report.seconds == read_session(path).audio.samples.shape[1] / RATE > 0.0, "reading is allowed"
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


def test_a_description_that_was_changed_is_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=0.2)
    content = path.read_bytes()
    at = content.index(b'"sample_rate": 44100')
    path.write_bytes(content[:at] + b'"sample_rate": 48000' + content[at + 20 :])
    faults = check(path).faults
    assert any("description" in fault for fault in faults)
    assert "sessions recover" in faults[-1]
    assert read_session(path).description.sample_rate == RATE, "the message says so, under a checksum"


def test_what_is_no_session_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with pytest.raises(InputError, match=path.name):
        recover(path)
    make(path, seconds=0.5)
    path.write_bytes(path.read_bytes()[:60])  # cut off before it says what it is
    with pytest.raises(InputError, match=path.name):
        recover(path)
    assert path.stat().st_size == 60
