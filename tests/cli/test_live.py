"""`live` and `locate`: the same numbers from a recording, settings in order, a clean end."""

import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, refusal
from tests.cli.running import records as lines

from monochord.cli import run
from monochord.front import locate as locating
from monochord.live.update import Update

Take = Callable[..., Path]
STRING = ["--length", "0.65", "--open-frequency", "110"]
KEYS = ["time", "frequency", "position", "position_std", "valid", "why_not"]
MONOCHORD = str(Path(sys.executable).with_name("monochord"))


def common(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: record[key] for key in KEYS} for record in records]


def test_several_strings_are_told_apart_by_their_names(tmp_path: Path, capsys: Capture) -> None:
    noise = 0.1 * np.random.default_rng(0).standard_normal((6615, 4))
    soundfile.write(tmp_path / "both.wav", noise, 44100, subtype="FLOAT")
    sensors = ["--sensor", "left=prototype", "--sensor", "right=prototype"]
    table = tmp_path / "both.csv"
    seen = lines(capsys, "live", str(tmp_path / "both.wav"), *sensors, "--sink", f"csv={table}")
    assert [line["string"] for line in seen] == ["left", "right"] * 6
    assert [line["time"] for line in seen[::2]] == [line["time"] for line in seen[1::2]]
    rows = [row.split(",") for row in table.read_text(encoding="utf-8").splitlines()]
    column = rows[0].index("string")
    assert [row[column] for row in rows[1:]] == ["left", "right"] * 6


@pytest.mark.parametrize(("position", "rate"), [(0.05, 44100), (0.2, 48000), (0.36, 16000)])
def test_every_window_has_its_position(take: Take, capsys: Capture, position: float, rate: int) -> None:
    located = lines(capsys, "locate", str(take(position, rate=rate)), *STRING)
    assert len(located) == 51
    for k, line in enumerate(located):
        assert list(line) == KEYS
        assert line["time"] == pytest.approx(k * 0.01, abs=1e-9)
        assert line["valid"] is True
        assert line["position"] == pytest.approx(position, abs=1e-3)
        assert line["frequency"] == pytest.approx(110 * 0.65 / (0.65 - position), rel=2e-3)
        assert 0.0 < line["position_std"] < 0.01


def test_streaming_equals_offline(take: Take, capsys: Capture) -> None:
    path = str(take(0.2))
    offline = lines(capsys, "locate", path, *STRING)
    assert len(offline) == 51
    for block in (77, 100_000):
        assert common(lines(capsys, "live", path, *STRING, "--set", f"source.block={block}")) == offline


def test_the_window_and_the_hop(take: Take, capsys: Capture) -> None:
    located = lines(capsys, "locate", str(take(0.2)), *STRING, "--window", "0.2", "--hop", "0.05")
    assert [line["time"] for line in located] == pytest.approx([0.05 * k for k in range(9)])


@pytest.mark.slow
def test_calibration_takes_out_what_pressing_sharpens(take: Take, capsys: Capture) -> None:
    sharpened, other, note = take(0.2, sharp=1.01), take(0.3, sharp=1.01), take(0.0)
    known = ["--calibrate", f"{other}:0.3", "--calibrate", f"{note}:0"]
    before = lines(capsys, "locate", str(sharpened), *STRING)
    after = lines(capsys, "locate", str(sharpened), *STRING, *known)
    assert abs(before[0]["position"] - 0.2) > 3e-3
    assert abs(after[0]["position"] - 0.2) < abs(before[0]["position"] - 0.2) / 2
    assert common(lines(capsys, "live", str(sharpened), *STRING, *known)) == after


def test_a_sensor_of_a_known_string_is_located_from_both_sides(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "touch.wav"
    touch = ["--at", "0.2275", "--force", "0.8", "--seconds", "0.6", "--out", str(path)]
    assert run(["simulate", "appendix", "--model", "split_string", *touch, "--json"]) == 0
    located = lines(capsys, "locate", str(path), "--string", "appendix")
    assert [line["position"] for line in located[10:]] == pytest.approx([0.2275] * 41, abs=1e-3)


def test_a_summary_to_read(take: Take, tmp_path: Path, capsys: Capture) -> None:
    path, silence = take(0.2), tmp_path / "silence.wav"
    soundfile.write(silence, np.zeros(22050), 44100)
    for file, found in ((path, "51 of 51"), (silence, "0 of 41")):
        assert run(["locate", str(file), *STRING]) == 0
        out = capsys.readouterr().out
        assert out.splitlines()[0] == str(file)
        assert found in out


def test_locate_takes_settings_as_live_does(take: Take, capsys: Capture) -> None:
    path, narrow = str(take(0.2)), ("--set", "estimator.reach=0.2")
    assert all(line["valid"] for line in lines(capsys, "locate", path, *STRING))
    located = lines(capsys, "locate", path, *STRING, *narrow)
    assert not any(line["valid"] for line in located)
    assert common(lines(capsys, "live", path, *STRING, *narrow)) == located


def test_a_stereo_take_says_what_both_channels_carry(take: Take, capsys: Capture) -> None:
    assert run(["locate", str(take(0.2, channels=2)), *STRING, "--window", "0.15"]) == 0
    assert re.search(r"\b46\b.*\b0 of 46\b", capsys.readouterr().out)


def test_a_cut_file_is_read_as_the_refusal_says(take: Take, capsys: Capture) -> None:
    path = take(0.2)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    line = refusal(capsys, "locate", str(path), *STRING)
    assert "--allow-truncated (locate," in line
    assert "--set source.allow_truncated=true (live," in line
    rest = lines(capsys, "locate", str(path), *STRING, "--allow-truncated")
    assert 15 < len(rest) < 25
    assert rest[0]["position"] == pytest.approx(0.2, abs=1e-3)
    assert common(lines(capsys, "live", str(path), "--set", "source.allow_truncated=true", *STRING)) == rest


def test_settings_come_from_the_file_then_the_options_then_set(
    take: Take, tmp_path: Path, capsys: Capture
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
    assert resolved["estimator"] == {**resolved["estimator"], "length": 0.6, "open_frequency": 110.0}
    before = common([json.loads(line) for line in written])
    assert "already exists" in refusal(capsys, "live", "--config", saved)
    (tmp_path / "out.jsonl").unlink()
    assert run(["live", "--config", str(saved)]) == 0
    again = (tmp_path / "out.jsonl").read_text(encoding="utf-8").splitlines()
    assert common([json.loads(line) for line in again]) == before


def test_other_names_of_the_page_are_a_setting_of_it(take: Take, tmp_path: Path, capsys: Capture) -> None:
    saved = tmp_path / "saved.toml"
    page = ["--sink", "web=0", "--allow-host", "lab", "--allow-host", "proxy:8443"]
    assert run(["live", str(take(0.2)), *STRING, *page, "--save-config", str(saved)]) == 0
    assert "?token=" in capsys.readouterr().out
    resolved = tomllib.loads(saved.read_text(encoding="utf-8"))
    assert resolved["sinks"]["web"]["allow_host"] == ["lab", "proxy:8443"]
    assert run(["live", "--config", str(saved), "--allow-host", "other", "--save-config", str(saved)]) == 0
    resolved = tomllib.loads(saved.read_text(encoding="utf-8"))
    assert resolved["sinks"]["web"]["allow_host"] == ["other"]


def test_a_recording_replaces_the_source_of_the_configuration(
    take: Take, tmp_path: Path, capsys: Capture
) -> None:
    config = tmp_path / "run.toml"
    config.write_text('[source]\nname = "jack"\nclient_name = "other"\n', encoding="utf-8")
    assert len(lines(capsys, "live", str(take(0.2)), "--config", str(config), *STRING)) == 51


def test_several_sinks_at_once(take: Take, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out.jsonl"
    assert run(["live", str(take(0.2)), *STRING, "--sink", "terminal", "--sink", f"jsonl={out}"]) == 0
    text = capsys.readouterr().out
    assert "position 200." in text or "position 199." in text
    assert len(out.read_text(encoding="utf-8").splitlines()) == 51


def test_beside_json_view_and_summary_go_to_standard_error(take: Take, capsys: Capture) -> None:
    options = ["--json", "--sink", "terminal", "--seconds", "0.3"]
    assert run(["live", str(take(0.2)), *STRING, *options]) == 0
    captured = capsys.readouterr()
    assert len([json.loads(line) for line in captured.out.splitlines()]) == 21
    assert "position" in captured.err
    assert "windows 21" in captured.err


def test_a_trained_model_estimates_the_twin(capsys: Capture) -> None:
    options = ["--source", "twin", "--set", "source.speed=0", "--set", "source.build=1", "--seconds", "3"]
    records = lines(capsys, "live", "demo", *options, "--hop", "0.05")
    both = [line for line in records if line["valid"] and line.get("true_contact")]
    assert len(both) > 10
    for line in both:
        assert abs(line["position"] - line["true_position"]) < 5e-3
        assert line["force_std"] > 0.0
        assert 0.0 <= line["slip"] <= 1.0


def test_a_sensor_that_the_model_cannot_know_is_refused_before_anything_is_compiled(tmp_path: Path) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "monochord", "demo", "long"]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1
    assert not [*tmp_path.rglob("*.nb[ic]")]


@pytest.mark.real_time
def test_control_c_ends_live_with_its_summary(take: Take) -> None:
    endless = ["--set", "source.repeat=0", "--set", "source.speed=1"]
    process = subprocess.Popen(
        [MONOCHORD, "live", str(take(0.2)), *STRING, *endless, "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    first = [process.stdout.readline() for _ in range(20)]
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 0, err
    assert all(json.loads(line)["valid"] for line in first)
    assert all(json.loads(line) for line in out.splitlines())
    assert "skipped" in err
    assert "Traceback" not in err


def test_a_reader_that_leaves_ends_it_quietly(take: Take) -> None:
    process = subprocess.Popen(
        [MONOCHORD, "live", str(take(0.2)), *STRING, "--set", "source.repeat=0", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    err = process.stderr.read()
    assert process.wait(20) == 1
    process.stderr.close()
    assert b"Traceback" not in err


def test_an_interrupted_locate_ends_after_the_window_in_progress(
    take: Take, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    usual, write, count = signal.getsignal(signal.SIGINT), locating._Places.write, itertools.count(1)

    def interrupt(places: locating._Places, update: Update) -> None:
        write(places, update)
        if next(count) == 20:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(locating._Places, "write", interrupt)
    assert run(["locate", str(take(0.2)), *STRING, "--json"]) == 130
    records = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(records) == 20
    assert signal.getsignal(signal.SIGINT) is usual


def test_a_sink_that_fails_is_closed_and_the_others_go_on(
    take: Take, tmp_path: Path, capsys: Capture
) -> None:
    sinks = ["--sink", "jsonl=/dev/full", "--sink", f"csv={tmp_path / 'out.csv'}"]
    assert run(["live", str(take(0.2)), *STRING, *sinks]) == 1
    text = capsys.readouterr().out
    assert len((tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()) == 52
    assert "No space left on device" in text


def test_a_reader_that_stalls_holds_up_neither_the_loop_nor_its_end(take: Take, tmp_path: Path) -> None:
    rows = tmp_path / "out.csv"
    endless = ["--set", "source.repeat=0", "--set", "source.speed=1", "--hop", "0.002"]
    process = subprocess.Popen(
        [MONOCHORD, "live", str(take(0.2)), *STRING, *endless, "--json", "--sink", f"csv={rows}"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline()  # and no more: the pipe is full after some 64 KiB
    deadline = time.monotonic() + 60.0
    while len(rows.read_bytes().splitlines()) < 600:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    err = process.stderr.read().decode()
    assert process.wait(20) == 1
    process.stdout.close()
    process.stderr.close()
    assert "Traceback" not in err
    assert re.search(r"jsonl .*closed", err)
    assert not re.search(r"csv .* left out", err)
