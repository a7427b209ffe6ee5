"""The command `simulate`."""

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord import cli


def test_the_appendix_case_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["simulate", "appendix", "--model", "split_string", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["peaks"] == pytest.approx([695.0, 374.2], rel=1e-3)
    assert result["theory"] == pytest.approx([695.0, 374.2], abs=0.1)
    assert (result["route"], result["sample_rate"], result["seconds"]) == ("fdtd", 44100, 0.4)
    assert (result["position"], result["force"]) == (0.2275, 0.0)


@pytest.mark.parametrize(
    "case", [["prototype"], ["appendix", "--at", "0.05"], ["appendix", "--at", "0.6", "--force", "2"]]
)
def test_a_touch_near_an_end_or_a_fast_string_needs_no_option(
    case: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["simulate", *case, "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["peaks"] == pytest.approx(result["theory"], rel=1e-3)


def test_a_line_for_a_person(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["simulate", "appendix", "--route", "modal"]) == 0
    assert "touched at 227.5 mm with 0 N" in (text := capsys.readouterr().out)
    assert "theory 695.01 Hz" in text


@pytest.mark.parametrize("suffix", [".wav", ".flac", ".FLAC"])
def test_both_microphones_are_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str
) -> None:
    out = tmp_path / f"touch{suffix}"
    options = [
        "--at",
        "0.3",
        "--force",
        "1",
        "--seconds",
        "0.2",
        "--route",
        "modal",
        "--out",
        str(out),
        "--json",
    ]
    assert cli.run(["simulate", "appendix", *options]) == 0
    result = json.loads(capsys.readouterr().out)
    frames, rate = soundfile.read(out)
    assert (frames.shape, rate, result["gain"]) == ((8820, 2), 44100, 1.0)
    assert np.abs(frames).max(axis=0) == pytest.approx([0.24, 0.24], abs=0.12)


def test_a_sound_too_loud_for_the_file_is_turned_down(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "loud.flac"
    loud = ["--set", "drive.amplitude=0.1", "--route", "modal", "--out", str(out), "--json"]
    assert cli.run(["simulate", "appendix", *loud]) == 0
    gain = json.loads(capsys.readouterr().out)["gain"]
    assert gain < 0.1
    assert np.abs(soundfile.read(out)[0]).max() == pytest.approx(0.99, abs=1e-3)


def test_an_untouched_string(capsys: pytest.CaptureFixture[str]) -> None:
    untouched = ["--untouched", "--route", "modal", "--set", "pluck.place=0.5", "--json"]
    assert cli.run(["simulate", "appendix", *untouched]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["position"] is None
    assert result["peaks"] == pytest.approx([243.25, 243.25], rel=1e-3)


def test_the_twin_tells_what_was_true_as_well(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["simulate", "prototype", "--model", "twin", "--at", "0.08", "--force", "0.5"]
    assert cli.run([*arguments, "--set", "across=0.02", "--set", "material=wood"]) == 0
    text = capsys.readouterr().out
    assert "prototype, touched at 80.0 mm with 0.5 N (twin, 0.4 s, simulated)" in text
    assert "in contact 100% of the time, sliding 100%" in text
    assert cli.run(["simulate", "prototype", "--model", "twin", "--untouched"]) == 0
    assert capsys.readouterr().out.rstrip().endswith("settled")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["prototype", "--model", "twin", "--at", "0.3"], "a touch at 0.3 m: allowed is 0.004 to 0.196 m"),
        (["prototype", "--model", "twin", "--set", "materiel=wood"], "did you mean 'material'?"),
        (["apendix"], "did you mean 'appendix'?"),
        (["appendix", "--model", "split_strin"], "did you mean 'split_string'?"),
        (["appendix", "--route", "modl"], "did you mean 'modal'?"),
        (["appendix", "--at", "0.65"], "position 0.65 m: allowed is strictly between 0 and 0.65 m"),
        (["appendix", "--at", "0"], "position 0 m"),
        (["appendix", "--at", "nan"], "position nan m"),
        (["appendix", "--force", "-1"], "force -1 N: allowed is 0 N or more"),
        (["appendix", "--seconds", "0"], "0 seconds: allowed is above 0"),
        (["appendix", "--seconds", "0.001"], "allowed is 0.01 s or more"),
        (
            ["appendix", "--at", "0.05", "--set", "time_step=1e-6"],
            "allowed is below 5.891e-07 s = 0.95 dxi/v on the segment of 0.05 m; --set time_step=5e-07",
        ),
        (["appendix", "--untouched", "--at", "0.2"], "--untouched with --at or --force"),
        (
            ["appendix", "--out", "touch.mp3"],
            "file 'touch.mp3': allowed is a name that ends in .wav",
        ),
        (["appendix", "--out", "nowhere/touch.wav"], "make 'nowhere' first"),
        (["appendix", "--set", "drive.amplitud=1"], "did you mean 'amplitude'?"),
        (["appendix", "--set", "mixing=[0.5, 0.5]", "--route", "modal"], "mixing l1 + l2 = 1"),
        ([], "Missing argument 'PRESET'"),
    ],
)
def test_what_cannot_be_simulated_is_one_line_and_status_2(
    arguments: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["simulate", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert line in printed.err
    assert printed.err.count("\n") == 1
