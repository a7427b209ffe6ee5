"""The live verb with a file for a source: the same numbers as offline, settings in order, a clean end."""

import json
import os
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from monochord.cli import run
from monochord.evaluation import realstrings

Take = Callable[..., Path]
STRING = ["--length", "0.65", "--open-frequency", "110"]
KEYS = ["time", "frequency", "position", "position_std", "valid", "why_not"]
MONOCHORD = str(Path(sys.executable).with_name("monochord"))


def lines(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[dict[str, Any]]:
    capsys.readouterr()
    assert run(list(arguments)) == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def core(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: record[key] for key in KEYS} for record in records]


@pytest.mark.parametrize("block", [1, 77, 441, 5000, 100_000])
def test_streaming_equals_offline(take: Take, capsys: pytest.CaptureFixture[str], block: int) -> None:
    path = str(take(0.2))
    offline = lines(capsys, "locate", path, *STRING, "--json")
    settings = ["--set", f"source.block={block}"]
    live = lines(capsys, "live", path, "--source", "wav", *STRING, "--json", *settings)
    assert core(live) == offline
    assert len(offline) == 51


def test_streaming_equals_offline_on_real_recordings(capsys: pytest.CaptureFixture[str]) -> None:
    folder = realstrings.folder()
    if folder is None:
        pytest.skip("no real recordings (MONOCHORD_REALSTRINGS)")
    for path in sorted(folder.glob("*plucked*/*.flac"))[::40]:
        offline = lines(capsys, "locate", str(path), *STRING, "--json")
        for block in (64, 1000):
            settings = ["--set", f"source.block={block}"]
            live = lines(capsys, "live", str(path), "--source", "wav", *STRING, "--json", *settings)
            assert core(live) == offline


def test_settings_come_from_the_file_then_the_options_then_set(
    take: Take, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config, saved = tmp_path / "run.toml", tmp_path / "saved.toml"
    config.write_text(
        f"""
        seconds = 0.5
        [source]
        name = "wav"
        path = "{take(0.2)}"
        block = 100
        [estimator]
        name = "closed-form"
        length = 0.7
        open_frequency = 110.0
        [window]
        length = 0.2
        hop = 0.05
        [sinks.jsonl]
        path = "{tmp_path / "out.jsonl"}"
        """,
        encoding="utf-8",
    )
    options = ["--config", str(config), "--length", "0.6", "--hop", "0.02", "--save-config", str(saved)]
    assert run(["live", *options, "--set", "window.hop=0.1", "--set", "source.block=7"]) == 0
    written = (tmp_path / "out.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["time"] for line in written] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    resolved = tomllib.loads(saved.read_text(encoding="utf-8"))
    assert resolved["window"] == {"length": 0.2, "hop": 0.1}
    assert resolved["source"]["block"] == 7
    assert resolved["estimator"]["length"] == 0.6
    assert resolved["estimator"]["open_frequency"] == 110.0
    before = (tmp_path / "out.jsonl").read_bytes()
    assert run(["live", "--config", str(saved)]) == 0
    after = (tmp_path / "out.jsonl").read_bytes()
    stable = [core([json.loads(line) for line in text.splitlines()]) for text in (before, after)]
    assert stable[0] == stable[1]


def test_another_source_leaves_the_options_of_the_files_behind(
    take: Take, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "run.toml"
    config.write_text('[source]\nname = "jack"\nclient_name = "other"\n', encoding="utf-8")
    arguments = ["live", str(take(0.2)), "--config", str(config), "--source", "wav", *STRING, "--json"]
    assert len(lines(capsys, *arguments)) == 51


def test_several_sinks_at_once(take: Take, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.jsonl"
    sinks = ["--sink", "terminal", "--sink", f"jsonl={out}"]
    assert run(["live", str(take(0.2)), "--source", "wav", *STRING, *sinks]) == 0
    text = capsys.readouterr().out
    assert "position 200." in text or "position 199." in text
    assert "windows 51  with a position 51  skipped 0" in text
    assert "latency" in text
    assert len(out.read_text(encoding="utf-8").splitlines()) == 51


def test_json_keeps_the_summary_off_standard_output(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["live", str(take(0.2)), "--source", "wav", *STRING, "--json", "--seconds", "0.3"]) == 0
    captured = capsys.readouterr()
    assert len(captured.out.splitlines()) == 21
    assert all(line.startswith("{") for line in captured.out.splitlines())
    assert "windows 21" in captured.err


def test_beside_json_the_view_goes_to_standard_error(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["live", str(take(0.2)), "--source", "wav", *STRING, "--json", "--sink", "terminal"]
    assert run(arguments) == 0
    captured = capsys.readouterr()
    assert len([json.loads(line) for line in captured.out.splitlines()]) == 51
    assert "0.50 s  position" in captured.err


def test_calibration_reaches_the_estimator(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    sharpened, other, note = take(0.2, sharp=1.01), take(0.3, sharp=1.01), take(0.0)
    known = ["--calibrate", f"{other}:0.3", "--calibrate", f"{note}:0"]
    offline = lines(capsys, "locate", str(sharpened), *STRING, *known, "--json")
    live = lines(capsys, "live", str(sharpened), "--source", "wav", *STRING, *known, "--json")
    assert core(live) == offline
    assert abs(offline[0]["position"] - 0.2) < 2e-3


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_control_c_ends_with_the_summary(take: Take, sent: signal.Signals) -> None:
    endless = ["--set", "source.repeat=0", "--set", "source.speed=1"]
    process = subprocess.Popen(
        [MONOCHORD, "live", str(take(0.2)), "--source", "wav", *STRING, *endless, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    first = [process.stdout.readline() for _ in range(20)]
    process.send_signal(sent)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 0, err
    assert json.loads(first[0])["valid"]
    assert len([json.loads(line) for line in first]) == 20
    assert all(json.loads(line) for line in out.splitlines())
    assert "skipped" in err
    assert "Traceback" not in err


def test_a_reader_that_leaves_ends_it_quietly(take: Take) -> None:
    endless = ["--set", "source.repeat=0"]
    process = subprocess.Popen(
        [MONOCHORD, "live", str(take(0.2)), "--source", "wav", *STRING, *endless, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ},
    )
    assert process.stdout is not None
    assert process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    err = process.stderr.read()
    assert process.wait(20) == 1
    process.stderr.close()
    assert b"Traceback" not in err


def test_what_was_learned_hears_the_twin_beside_the_truth(capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--source", "twin", "--set", "source.speed=0", "--set", "source.build=1", "--seconds", "3"]
    assert run(["live", "demo", *options, "--hop", "0.05", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    both = [line for line in lines if line["valid"] and line.get("true_contact")]
    assert len(both) > 10
    for line in both:
        assert abs(line["position"] - line["true_position"]) < 5e-3
        assert line["force_std"] > 0.0
        assert 0.0 <= line["slip"] <= 1.0


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        (
            ["demmo", "prototype"],
            "model demmo (not there): allowed is a folder that monochord train made",
        ),
        (["demmo", "prototype"], "did you mean 'demo'"),
        (["demo", "demo"], "inputs demo, demo: allowed is one RUN at most"),
        (["demo", "long"], "a string of 0.65 m for a model: allowed is 0.2 m"),
        (["demo", "--window", "0.2"], "windows of 8820 frames for a model"),
    ],
)
def test_what_was_not_learned_is_one_line(
    inputs: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["live", *inputs, "--source", "twin"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert words in captured.err
