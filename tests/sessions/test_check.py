from pathlib import Path

from tests.sessions.made import RATE, as_killed, make

from monochord.sessions import check, read_session


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
