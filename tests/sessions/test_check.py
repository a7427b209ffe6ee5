from pathlib import Path

import numpy as np
import pytest
from tests.sessions.made import EPOCH, RATE, as_killed, block, description, make

from monochord.sessions import SessionClock, SessionWriter, check, read_session


def test_a_whole_session_has_no_faults_and_tells_what_is_missing(tmp_path: Path) -> None:
    make(tmp_path / "a.mcap")
    report = check(tmp_path / "a.mcap")
    assert report.sound
    assert report.remarks == (
        "100 frames lost in 1 gap",
        "wrench: 21 readings with a fault",
        "oven: 3 readings with a fault",
    )
    assert report.messages["/labels"] == 200


@pytest.mark.parametrize("seconds", [0.4, 3.5])
def test_a_microphone_that_picked_up_nothing_is_a_remark_of_what_to_look_at(
    tmp_path: Path, seconds: float
) -> None:
    path, frames = tmp_path / "a.mcap", round(seconds * RATE)
    sound = 0.1 * np.random.default_rng(0).standard_normal((2, frames)).astype(np.float32)
    sound[1] *= 1e-4
    with SessionWriter(path, description(feeds=()), SessionClock(epoch_ns=EPOCH, origin=100.0)) as writer:
        writer.audio(block(0, sound, start=0))
        if seconds > 1.0:  # lost frames are read as zeros, and are no silence
            writer.audio(block(1, 1e4 * sound, start=2 * frames, dropped=frames))
    *_, silence = check(path).remarks
    assert f"microphone 2 for {min(3.0, seconds):.1f} s" in silence
    assert all(word in silence for word in ("microphone 2", "driver", "gain", "input"))
    assert "microphone 1" not in silence


def test_a_flipped_bit_is_detected(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    report = check(path)
    assert not report.sound
    assert "1 damaged chunk" in report.faults
    assert any("checksum" in fault for fault in report.faults)


def test_a_session_that_was_not_closed_says_what_to_do(tmp_path: Path) -> None:
    as_killed(make(tmp_path / "a.mcap", close=False))
    report = check(tmp_path / "a.mcap")
    assert any("sessions recover" in fault for fault in report.faults)
    assert any("cut off" in fault for fault in report.faults)


def test_a_session_that_is_being_recorded_is_reported_so(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with make(path, seconds=0.5, close=False):
        report = check(path)
        assert len(report.faults) == 1
        assert "being recorded" in report.faults[0]
        assert report.seconds == read_session(path).audio.samples.shape[1] / RATE > 0.0, "reading is allowed"
    assert check(path).sound


def test_a_description_that_was_changed_is_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    make(path, seconds=0.2)
    content = path.read_bytes()
    at = content.index(b'"sample_rate": 44100')
    path.write_bytes(content[:at] + b'"sample_rate": 48000' + content[at + 20 :])
    faults = check(path).faults
    assert faults[:-1] == ("its description is not what was written",)
    assert "sessions recover" in faults[-1]
    assert read_session(path).description.sample_rate == RATE, "the message says so, under a checksum"
