"""The set of real recordings is built again from its originals, bit for bit."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
from studies.recordings import listed, sources

from monochord.evaluation.recordings import folder

ROOT = Path(__file__).parents[2]


def build(originals: Path, out: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "studies.recordings", str(originals), str(out)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_every_row_has_its_source_licence_and_checksum() -> None:
    rows = listed()
    assert len({row["file"] for row in rows}) == len(rows) == 146
    page = (ROOT / "docs" / "reference" / "recordings.md").read_text(encoding="utf-8")
    table = re.findall(r"^\| (\d+) \| (.*?) \| (?:.*) \| (.*?) \|$", page, re.MULTILINE)
    for row in rows:
        assert row["licence"].startswith("CC"), row["file"]
        assert len(row["sha256"]) == 16
    for source in {row["source"] for row in rows}:
        origin, version = source.removeprefix("github ").rsplit(maxsplit=1)
        name = f"`{origin.removeprefix('Debian ')}` {version.removeprefix('@')}"
        counts = [int(count) for count, where, _ in table if name in where]
        assert sum(counts) == sum(row["source"] == source for row in rows), name


def test_stand_ins_of_the_originals_give_the_set_again(tmp_path: Path) -> None:
    home = folder()
    if home is None:
        pytest.skip("the recordings are not here: MONOCHORD_REALSTRINGS")
    originals = tmp_path / "originals"
    for (
        row
    ) in listed():  # each longer at both ends, in 24 bits, in a file for each microphone where it had two
        sound, rate = soundfile.read(home / row["file"], dtype="float64", always_2d=True)
        before = np.full((round(float(row["trim_start_s"]) * rate), sound.shape[1]), 0.01)
        whole = np.concatenate([before, sound, np.full((1000, sound.shape[1]), 0.02)])
        files = sources(originals, row)
        for path, track in zip(files, np.split(whole, len(files), axis=1), strict=True):
            path.parent.mkdir(parents=True, exist_ok=True)
            soundfile.write(path, track, rate, format="WAV", subtype="PCM_24")
    run = build(originals, tmp_path / "set")
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("146 files in ")
    assert "146 with the checksum" in run.stdout
    for row in listed():
        assert (tmp_path / "set" / row["file"]).read_bytes() == (home / row["file"]).read_bytes()
    with (tmp_path / "set" / "manifest.csv").open(newline="", encoding="utf-8") as lines:
        assert len(list(csv.DictReader(lines))) == 146
    again = build(originals, tmp_path / "set")
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)


def test_missing_originals_are_told_in_a_line(tmp_path: Path) -> None:
    run = build(tmp_path, tmp_path / "set")
    assert run.returncode == 2
    assert "without karoryfer.black-and-green-guitars/" in run.stderr
    assert run.stderr.count("\n") == 1
    assert not (tmp_path / "set").exists()
