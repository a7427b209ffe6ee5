"""The command `simulate`."""

from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, record, refusal

from monochord import cli


def test_the_appendix_case_by_default(capsys: Capture) -> None:
    result = record(capsys, "simulate", "appendix", "--model", "split_string")
    assert result["peaks"] == pytest.approx([695.0, 374.2], rel=1e-3)
    assert result["theory"] == pytest.approx([695.0, 374.2], abs=0.1)
    assert (result["route"], result["sample_rate"], result["seconds"]) == ("fdtd", 44100, 0.4)
    assert (result["position"], result["force"]) == (0.2275, 0.0)


@pytest.mark.parametrize(
    "case", [["prototype"], ["appendix", "--at", "0.05"], ["appendix", "--at", "0.6", "--force", "2"]]
)
def test_a_touch_near_an_end_or_a_fast_string_needs_no_option(case: list[str], capsys: Capture) -> None:
    result = record(capsys, "simulate", *case)
    assert result["peaks"] == pytest.approx(result["theory"], rel=1e-3)


def test_a_line_for_a_person(capsys: Capture) -> None:
    assert cli.run(["simulate", "appendix", "--route", "modal"]) == 0
    assert "touched at 227.5 mm with 0 N" in (text := capsys.readouterr().out)
    assert "theory 695.01 Hz" in text


@pytest.mark.parametrize("suffix", [".wav", ".flac", ".FLAC"])
def test_both_microphones_are_written(tmp_path: Path, capsys: Capture, suffix: str) -> None:
    out = tmp_path / f"touch{suffix}"
    options = ["--at", "0.3", "--force", "1", "--seconds", "0.2", "--route", "modal"]
    result = record(capsys, "simulate", "appendix", *options, "--out", out)
    frames, rate = soundfile.read(out)
    assert (frames.shape, rate, result["gain"]) == ((8820, 2), 44100, 1.0)
    assert "already exists" in refusal(capsys, "simulate", "appendix", "--out", out)
    assert np.array_equal(soundfile.read(out)[0], frames)
    assert np.abs(frames).max(axis=0) == pytest.approx([0.24, 0.24], abs=0.12)


def test_a_sound_too_loud_for_the_file_is_turned_down(tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "loud.flac"
    loud = ["--set", "drive.amplitude=0.1", "--route", "modal", "--out", out]
    gain = record(capsys, "simulate", "appendix", *loud)["gain"]
    assert gain < 0.1
    assert np.abs(soundfile.read(out)[0]).max() == pytest.approx(0.99, abs=1e-3)


def test_an_untouched_string(capsys: Capture) -> None:
    untouched = ["--untouched", "--route", "modal", "--set", "pluck.place=0.5"]
    result = record(capsys, "simulate", "appendix", *untouched)
    assert result["position"] is None
    assert result["peaks"] == pytest.approx([243.25, 243.25], rel=1e-3)


def test_the_twin_tells_what_was_true_as_well(capsys: Capture) -> None:
    arguments = ["simulate", "prototype", "--model", "twin", "--at", "0.08", "--force", "0.5"]
    assert cli.run([*arguments, "--set", "across=0.02", "--set", "material=wood"]) == 0
    text = capsys.readouterr().out
    assert "prototype, touched at 80.0 mm with 0.5 N (twin, 0.4 s, simulated)" in text
    assert "in contact 100% of the time, sliding 100%" in text
    assert cli.run(["simulate", "prototype", "--model", "twin", "--untouched"]) == 0
    assert capsys.readouterr().out.rstrip().endswith("settled")
