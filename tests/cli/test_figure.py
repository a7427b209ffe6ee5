"""`monochord figure` writes what it says, and refuses in one line."""

import json
from pathlib import Path

import pytest

from monochord.cli import run

FAST = ["--set", "steps=3"]


@pytest.mark.parametrize(("suffix", "magic"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_file_is_of_the_kind_its_name_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str, magic: bytes
) -> None:
    path = tmp_path / f"out.{suffix}"
    assert run(["figure", "trends", "--out", str(path), *FAST]) == 0
    assert capsys.readouterr().out.strip() == str(path)
    assert path.read_bytes().startswith(magic)


def test_default_name_and_json(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["figure", "convergence", "--model", "split_string", "--set", "route=modal", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["figure"] == "convergence"
    assert said["options"]["route"] == "modal"
    assert Path(said["path"]).is_file()


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_a_full_disk_is_told_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str
) -> None:
    (link := tmp_path / f"full{suffix}").symlink_to("/dev/full")
    assert run(["figure", "convergence", "--set", "route=modal", "--out", str(link)]) == 2
    line = capsys.readouterr().err
    assert "No space left on device" in line
    assert line.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["trend"], "did you mean 'trends'"),
        (["trends", "--set", "stps=3"], "did you mean 'steps'"),
        (["trends", "--set", "steps=few"], "steps"),
        (["trends", "--out", "a.bmp"], ".png, .pdf, .svg"),
        (["trends", "--out", "absent/a.png"], "a folder that exists"),
        (["trends", "--set", "string=apendix"], "did you mean 'appendix'"),
        (["trends", "--model", "splitstring"], "did you mean 'split_string'"),
        (["convergence", "--model", "splitstring"], "did you mean 'split_string'"),
        ([], "Missing argument"),
    ],
)
def test_refusals_are_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["figure", *arguments]) == 2
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1
