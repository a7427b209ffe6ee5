"""`monochord figure` writes a figure in the format of the suffix, and refuses in one line."""

from pathlib import Path

import numpy as np
import pytest
from tests.cli.running import Capture, record

from monochord.cli import run
from monochord.core.types import Block
from monochord.figures import base
from monochord.sessions import Description, SessionWriter


@pytest.fixture
def words(tmp_path: Path) -> list[str]:
    """The figure of a session of half a second."""
    path = tmp_path / "take.mcap"
    with SessionWriter(path, Description(name="take", sample_rate=16000)) as writer:
        samples = np.full((2, 8000), 0.1, np.float32)
        writer.audio(Block(samples=samples, start=0, adc_time=writer.clock.origin))
    return ["session", "--set", f"path={path}"]


@pytest.mark.parametrize(("suffix", "magic"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_the_suffix_determines_the_format(
    words: list[str], tmp_path: Path, capsys: Capture, suffix: str, magic: bytes
) -> None:
    path = tmp_path / f"out.{suffix}"
    assert run(["figure", *words, "--out", str(path)]) == 0
    assert capsys.readouterr().out.strip() == str(path)
    assert path.read_bytes().startswith(magic)


def test_default_name_and_json(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    drawn = record(capsys, "figure", *words)
    assert drawn["figure"] == "session"
    assert drawn["options"]["step"] == 0.02
    assert Path(drawn["path"]).is_file()


def test_without_matplotlib_the_error_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setattr(base, "find_spec", lambda _: None)
    assert run(["figure", "session"]) == 2
    assert capsys.readouterr().err.rstrip().endswith("pip install 'matplotlib>=3.9'")


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_a_full_disk_is_an_error_of_one_line(
    words: list[str], tmp_path: Path, capsys: Capture, suffix: str
) -> None:
    (link := tmp_path / f"full{suffix}").symlink_to("/dev/full")
    assert run(["figure", *words, "--out", str(link)]) == 2
    line = capsys.readouterr().err
    assert "No space left on device" in line
    assert line.count("\n") == 1
