import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from monochord.cli import run

Take = Callable[..., Path]
STRING = ["--length", "0.65", "--open-frequency", "110"]
KEYS = ["time", "frequency", "position", "position_std", "valid", "why_not"]


def located(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[dict[str, Any]]:
    capsys.readouterr()
    assert run(["locate", *arguments, "--json"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    return [json.loads(line) for line in captured.out.splitlines()]


@pytest.mark.parametrize("rate", [44100, 48000, 16000])
@pytest.mark.parametrize("position", [0.05, 0.2, 0.36])
def test_every_window_has_its_position(
    take: Take, capsys: pytest.CaptureFixture[str], position: float, rate: int
) -> None:
    lines = located(capsys, str(take(position, rate=rate)), *STRING)
    assert len(lines) == 51
    for k, line in enumerate(lines):
        assert list(line) == KEYS
        assert line["time"] == pytest.approx(k * 0.01, abs=1e-9)
        assert line["valid"] is True
        assert line["position"] == pytest.approx(position, abs=1e-3)
        assert line["frequency"] == pytest.approx(110 * 0.65 / (0.65 - position), rel=2e-3)
        assert 0.0 < line["position_std"] < 0.01


def test_the_window_and_the_hop(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    lines = located(capsys, str(take(0.2)), *STRING, "--window", "0.2", "--hop", "0.05")
    assert [line["time"] for line in lines] == pytest.approx([0.05 * k for k in range(9)])


def test_calibration_takes_out_what_pressing_sharpens(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    sharpened = str(take(0.2, sharp=1.01))
    (before, *_) = located(capsys, sharpened, *STRING)
    other = str(take(0.3, sharp=1.01))
    open_note = str(take(0.0))
    (after, *_) = located(
        capsys, sharpened, *STRING, "--calibrate", f"{other}:0.3", "--calibrate", f"{open_note}:0"
    )
    assert abs(before["position"] - 0.2) > 3e-3
    assert abs(after["position"] - 0.2) < abs(before["position"] - 0.2) / 2


def test_a_sensor_of_a_known_string_is_heard_on_both_sides(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "touch.wav"
    touch = ["--at", "0.2275", "--force", "0.8", "--seconds", "0.6", "--out", str(path)]
    assert run(["simulate", "appendix", "--model", "split_string", *touch, "--json"]) == 0
    lines = located(capsys, str(path), "--string", "appendix")
    assert len(lines) == 51
    settled = [line["position"] for line in lines[10:]]
    assert settled == pytest.approx([0.2275] * 41, abs=1e-3)


def test_a_summary_to_read(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    path = take(0.2)
    assert run(["locate", str(path), *STRING]) == 0
    out = capsys.readouterr().out
    assert out.splitlines()[0] == str(path)
    assert "51 of 51 (100.0 %)" in out
    assert " mm from the nut (median)" in out
    assert " Hz (median)" in out


def test_silence_is_told_apart(tmp_path: Path, take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    import numpy as np
    import soundfile

    path = tmp_path / "silence.wav"
    soundfile.write(path, np.zeros(44100), 44100)
    lines = located(capsys, str(path), *STRING)
    assert len(lines) == 91
    for line in lines:
        assert line["valid"] is False
        assert line["why_not"]
        assert line["position"] is line["position_std"] is line["frequency"] is None
    assert run(["locate", str(path), *STRING]) == 0
    assert "0 of 91 (0.0 %)" in capsys.readouterr().out


def test_a_take_shorter_than_a_window_is_refused(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    for form in ([], ["--json"]):
        assert run(["locate", str(take(0.2, seconds=0.05)), *STRING, *form]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert "shorter than a window" in captured.err
        assert captured.err.count("\n") == 1


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_ends_with_whole_lines_and_status_130(take: Take, sent: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", "from monochord.cli import main; main()", "locate", str(take(0.2, seconds=90)),
         *STRING, "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout
        assert process.stderr
        first = process.stdout.readline()
        process.send_signal(sent)
        lines = [json.loads(line) for line in [first, *process.stdout]]
        assert process.stderr.read() == ""
    assert process.returncode == 130
    assert 1 <= len(lines) < 8991


def test_interrupted_it_sums_up_what_it_has(take: Take, capsys: pytest.CaptureFixture[str]) -> None:
    usual = signal.getsignal(signal.SIGINT)

    def interrupt() -> None:
        while signal.getsignal(signal.SIGINT) is usual:
            time.sleep(0.01)
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    path = str(take(0.2, seconds=90))
    thread = threading.Thread(target=interrupt)
    thread.start()
    assert run(["locate", path, *STRING]) == 130
    thread.join()
    assert " of 8991 " not in capsys.readouterr().out
    assert signal.getsignal(signal.SIGINT) is usual


def test_what_is_there_of_a_cut_file_is_read_as_the_refusal_says(
    take: Take, capsys: pytest.CaptureFixture[str]
) -> None:
    path = take(0.2)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert run(["locate", str(path), *STRING]) == 2
    told = capsys.readouterr().err
    assert "locate --allow-truncated, live --set source.allow_truncated=true" in told
    there = located(capsys, str(path), *STRING, "--allow-truncated")
    assert 15 < len(there) < 25
    assert there[0]["position"] == pytest.approx(0.2, abs=1e-3)
    options = ["--source", "wav", "--set", "source.allow_truncated=true", *STRING]
    assert run(["live", str(path), *options]) == 0
