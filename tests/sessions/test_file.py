from pathlib import Path

from monochord.sessions.file import RESERVE, SessionFile


def test_what_is_written_is_there_at_once(tmp_path: Path) -> None:
    file = SessionFile(tmp_path / "a")
    file.write(b"abc")
    file.write(memoryview(b"defg"))
    assert (tmp_path / "a").read_bytes() == b"abcdefg"
    assert file.tell() == 7
    file.close()


def test_space_is_set_aside_and_given_back(tmp_path: Path) -> None:
    path = tmp_path / "a"
    file = SessionFile(path)
    file.write(b"x")
    assert path.stat().st_size == 1, "the size does not tell of it"
    allocated = path.stat().st_blocks * 512
    file.close()
    file.close()
    assert path.stat().st_blocks * 512 <= 8192
    assert allocated == 0 or allocated >= RESERVE, "a file system sets aside all or cannot"
    assert path.read_bytes() == b"x"
