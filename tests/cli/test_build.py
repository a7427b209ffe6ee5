"""`monochord build` makes a dataset, tells what is in it, and fails where it may not be used."""

import json
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from tests.cli.running import Capture, record, refusal

from monochord.cli import run
from monochord.core.ownership import LOCK, part_folder
from monochord.core.types import Block
from monochord.datasets.audit import Audit
from monochord.datasets.store import open_dataset
from monochord.front.build import build
from monochord.sessions import Description, SessionClock, SessionWriter, read_session
from monochord.sessions.resample import resample

RATE = 8000


@pytest.fixture(name="sessions")
def _sessions(tmp_path: Path) -> Path:
    """Four sessions of eight seconds: of wood and of steel, touched every other second."""
    folder = tmp_path / "sessions"
    folder.mkdir()
    time = np.arange(800) / 100
    touched = (time % 2.0 >= 1.0).astype(float)
    for number in range(4):
        body = "wood" if number == 3 else "steel"
        description = Description(name=f"take{number}", sample_rate=RATE, object=body, simulated=True)
        noise = 0.1 * np.random.default_rng(number).normal(size=(2, 8 * RATE)).astype(np.float32)
        path = folder / f"take{number}.mcap"
        with SessionWriter(path, description, SessionClock(epoch_ns=10**18)) as writer:
            writer.audio(Block(samples=noise, start=0, adc_time=0.0))
            writer.labels(time, {"contact": touched, "slip": np.zeros(800)})
    return folder


def test_a_table_by_part_and_object(sessions: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    options = ["--split", "object", "--held-out", "wood", "--seed", "2"]
    assert run(["build", str(sessions), "--out", str(out), *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{out}, simulated: 320 windows of 4 sessions")
    assert lines[-2].split() == ["test", "wood", "40", "0", "0", "40", "0", "0"]
    assert len(open_dataset(out)) == 320


def test_sessions_are_held_out_by_a_pattern(sessions: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    assert run(["build", str(sessions), "--out", str(out), "--held-out", "take[01]"]) == 0
    assert capsys.readouterr().out.splitlines()[-2].split()[:3] == ["test", "steel", "80"]
    split = json.loads((out / "split.json").read_text())
    assert (split["held_out"], split["groups"]["test"]) == (["take[01]"], ["take0", "take1"])


def test_json_is_one_object(sessions: Path, tmp_path: Path, capsys: Capture) -> None:
    pattern = str(sessions / "take[012].mcap")
    result = record(capsys, "build", pattern, "--out", tmp_path / "out", "--hop", "0.05")
    assert (result["sessions"], result["windows"], result["split"], result["simulated"]) == (
        3,
        3 * 159,
        "session",
        True,
    )
    assert result["labels"] == {f"take{number}": "recorded" for number in range(3)}
    assert (
        sum(counts["static"] for part in result["parts"].values() for counts in part.values())
        == result["counts"]["static"]
    )
    assert result["leaks"] == []


def test_a_single_session_is_split_by_time(sessions: Path, tmp_path: Path) -> None:
    assert run(["build", str(sessions / "take0.mcap"), "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "split.json").read_text())["by"] == "time"


def test_sessions_of_several_rates_are_resampled_to_the_lowest(
    sessions: Path, tmp_path: Path, capsys: Capture
) -> None:
    low = RATE // 2
    resample(read_session(sessions / "take0.mcap"), sessions / "slow.mcap", low)
    (sessions / "take0.mcap").unlink()
    assert run(["build", str(sessions), "--out", str(tmp_path / "data")]) == 0
    said = capsys.readouterr().err
    for name in ("take1", "take2", "take3"):
        assert f"resampled: session {name}, {RATE} to {low} Hz" in said
    assert "slow" not in said
    assert open_dataset(tmp_path / "data").manifest.sample_rate == low


def test_a_leak_fails(sessions: Path, tmp_path: Path, capsys: Capture) -> None:
    shutil.copy(sessions / "take1.mcap", sessions / "take9.mcap")
    assert run(["build", str(sessions), "--out", str(tmp_path / "out"), "--split", "time"]) == 2
    captured = capsys.readouterr()
    assert re.search(r"leak: .*take1 and take9", captured.out)
    assert captured.err.count("\n") == 1
    assert run(["audit", str(tmp_path / "out")]) == 2
    few = ["--set", "heads={contact={}}", "--set", "methods=['ridge']"]
    line = refusal(capsys, "train", "--dataset", tmp_path / "out", "--out", tmp_path / "run", *few)
    assert "split with a leak" in line
    assert not (tmp_path / "run").exists()


def test_an_interrupt_within_the_audit_leaves_nothing(
    sessions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> Audit:
        raise KeyboardInterrupt

    monkeypatch.setattr("monochord.front.build.audit", interrupted)
    with pytest.raises(KeyboardInterrupt):
        build(sessions, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["sessions"]


def test_a_session_that_cannot_be_used_is_told_in_one_line(
    sessions: Path, tmp_path: Path, capsys: Capture
) -> None:
    (sessions / "other.mcap").write_bytes(b"not a session")
    out = tmp_path / "out"
    assert "other.mcap" in refusal(capsys, "build", sessions, "--out", out)
    assert not out.exists()
    assert run(["build", str(sessions), "--out", str(out), "--skip"]) == 0
    captured = capsys.readouterr()
    assert "other.mcap" in captured.err
    assert "of 4 sessions" in captured.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("--held-out wod", "'wood'"),
        ("--held-out tame*", "'take*'"),
        ("--held-out take[1-3]", "3 sessions"),
        ("--labels measured", "wrench"),
        ("--hop -1", "hop"),
        ("--out sessions", "sessions"),
    ],
)
def test_what_cannot_be_is_refused_before_all_is_built(
    sessions: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
    arguments: str,
    words: str,
) -> None:
    monkeypatch.chdir(sessions.parent)
    assert words in refusal(capsys, "build", "sessions", "--out", "out", *arguments.split())
    assert not Path("out").exists()
    assert len([*sessions.iterdir()]) == 4


def test_a_second_build_of_a_folder_is_refused_at_once(
    sessions: Path, tmp_path: Path, capsys: Capture
) -> None:
    out = tmp_path / "out"
    with part_folder(out):
        line = refusal(capsys, "build", sessions, "--out", out)
        assert f"'{out}' (process {os.getpid()} is writing to it)" in line
    (tmp_path / f".out{LOCK}").write_text("1\n")  # as a kill leaves it
    assert run(["build", str(sessions), "--out", str(out)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "sessions"]
