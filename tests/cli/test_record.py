"""The verb `record`, in this process and in one of its own."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.cli import run
from monochord.lab.net_ft_device import NetFtDevice, NetFtSettings
from monochord.sessions import check, read_session

LOAD = np.array([[0.0, 0.0, 1.5, 0.0, 0.0, 0.0]])


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    samples = np.random.default_rng(0).uniform(-0.5, 0.5, (44100, 2))
    soundfile.write(tmp_path / "sound.wav", samples, 44100, subtype="FLOAT")
    return tmp_path / "sound.wav"


def words(out: Path, sound: Path, *more: str) -> list[str]:
    return ["record", str(out), "--source", "wav", "--set", f"source.path={sound}", *more]


def test_it_records_and_says_what(tmp_path: Path, sound: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "take.mcap"
    told = ["--object", "plastic", "--sensor", "prototype", "--note", "first try", "--radius", "0.004"]
    assert run(words(out, sound, *told)) == 0
    captured = capsys.readouterr()
    assert "frames 44100  dropped 0" in captured.out
    assert "the source ended" in captured.out
    assert "44100" not in captured.err
    description = read_session(out).description
    assert (description.object, description.notes, description.radius) == ("plastic", "first try", 0.004)
    assert description.sensor["name"] == "prototype"
    assert check(out).sound


def test_an_instrument_is_opened_where_it_is_and_set_by_its_name(
    tmp_path: Path, sound: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "take.mcap"
    with NetFtDevice(LOAD, NetFtSettings(rate=1000.0)) as device:
        beside = [
            "--instrument",
            f"net-ft={device.address}",
            "--set",
            f"net_ft.http_port={device.http_port}",
            "--set",
            "source.speed=1",
            "--seconds",
            "0.6",
            "--json",
        ]
        assert run(words(out, sound, *beside)) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert summary["instruments"]["net_ft"]["readings"] > 400
    assert summary["instruments"]["net_ft"]["missing"] == 0
    assert "net_ft" in captured.err  # the view
    assert np.allclose(read_session(out).readings("wrench").column("fz"), 1.5, atol=1e-3)


def test_settings_come_from_a_file_then_options_then_set(
    tmp_path: Path, sound: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config, out = tmp_path / "bench.toml", tmp_path / "take.mcap"
    config.write_text(
        f'seconds = 0.2\n[source]\nname = "wav"\npath = "{sound}"\n'
        '[about]\nobject = "wood"\nnote = "of the file"\nmaterial = "oak"\n',
        encoding="utf-8",
    )
    asked = ["--config", str(config), "--object", "metal", "--set", "about.material=steel", "--seconds", "9"]
    assert run(["record", str(out), *asked]) == 0
    description = read_session(out).description
    assert (description.object, description.notes, description.material) == ("metal", "of the file", "steel")
    assert read_session(out).audio.samples.shape[1] == 44100
    capsys.readouterr()


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--instrument", "netft=1.2.3.4"], "did you mean 'net_ft'"),
        (["--set", "net_ft.bias=true"], "add --instrument net_ft"),
        (["--set", "source.sped=1"], "did you mean 'speed'"),
        (["--sensor", "nonsense"], "sensor 'nonsense'"),
        (["--set", "disk.start=1e18"], "MB free: allowed is"),
        (["--seconds", "-1"], "a number above 0"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_line(
    tmp_path: Path, sound: Path, more: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "take.mcap"
    assert run(words(out, sound, *more)) == 2
    captured = capsys.readouterr()
    assert told in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert not out.exists()


def test_a_session_that_exists_is_not_overwritten(
    tmp_path: Path, sound: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "take.mcap"
    out.write_bytes(b"precious")
    assert run(words(out, sound)) == 2
    assert "exists" in capsys.readouterr().err
    assert out.read_bytes() == b"precious"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_its_summary(tmp_path: Path, sound: Path, number: signal.Signals) -> None:
    out = tmp_path / "take.mcap"
    command = [str(Path(sys.executable).with_name("monochord")), *words(out, sound, "--json")]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [*command, "--set", "source.speed=1", "--set", "source.repeat=0"], stdout=pipe, stderr=pipe, text=True
    ) as process:
        deadline = time.monotonic() + 30.0
        while not (out.exists() and out.stat().st_size > 200_000):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(number)
        printed, shown = process.communicate(timeout=20)
    assert process.returncode == 0
    summary = json.loads(printed)
    assert summary["stopped"] == "stopped by request"
    assert "Traceback" not in shown
    assert check(out).sound
    assert read_session(out).audio.samples.shape[1] == summary["frames"]
