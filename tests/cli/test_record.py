"""The command `record`, in this process and in one of its own."""

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, record, refusal
from tests.ports import free_ports

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


def test_it_records_and_says_what(tmp_path: Path, sound: Path, capsys: Capture) -> None:
    out = tmp_path / "take.mcap"
    arguments = ["--object", "plastic", "--sensor", "prototype", "--notes", "first try", "--radius", "0.004"]
    assert run(words(out, sound, *arguments)) == 0
    captured = capsys.readouterr()
    assert "44100" in captured.out
    assert "44100" not in captured.err
    description = read_session(out).description
    assert (description.object, description.notes, description.radius) == ("plastic", "first try", 0.004)
    assert description.sensor["name"] == "prototype"
    assert check(out).sound


def test_silence_is_told_meanwhile_at_the_end_and_by_the_check(tmp_path: Path, capsys: Capture) -> None:
    sound, out = tmp_path / "silence.wav", tmp_path / "take.mcap"
    soundfile.write(sound, np.zeros((2 * 44100, 2)), 44100)
    assert run(words(out, sound, "--set", "source.speed=4")) == 0
    captured = capsys.readouterr()
    assert run(["sessions", "check", str(out)]) == 0
    for text in (captured.err, captured.out, capsys.readouterr().out):
        assert all(word in text for word in ("silence", "driver", "gain", "input"))


def test_an_instrument_is_opened_where_it_is_and_set_by_its_name(
    tmp_path: Path, sound: Path, capsys: Capture
) -> None:
    out = tmp_path / "take.mcap"
    with NetFtDevice(LOAD, NetFtSettings(rate=1000.0)) as device:
        beside = f"--instrument net-ft={device.address} --set net_ft.http_port={device.http_port}"
        more = "--set source.speed=1 --seconds 0.6 --json"
        assert run(words(out, sound, *beside.split(), *more.split())) == 0
    captured = capsys.readouterr()
    summary = json.loads(captured.out)
    assert summary["instruments"]["net_ft"]["readings"] > 400
    assert summary["instruments"]["net_ft"]["missing"] == 0
    assert "net_ft" in captured.err  # the view
    assert np.allclose(read_session(out).readings("wrench").column("fz"), 1.5, atol=1e-3)


@contextmanager
def posing(ports: list[int]) -> Generator[None]:
    """Send poses to ports of this machine, with the number of the port's place in the list as x."""
    stopped = threading.Event()

    def send() -> None:
        with socket.socket(type=socket.SOCK_DGRAM) as sock:
            while not stopped.wait(0.01):
                for x, port in enumerate(ports):
                    with suppress(ConnectionRefusedError):
                        sock.sendto(json.dumps({"position": [x, 0, 0]}).encode(), ("127.0.0.1", port))

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


@pytest.mark.parametrize(
    ("asked", "rates", "streams"),
    [
        (["pose_udp={0}", "pose-udp={1}"], ["pose_udp.rate=100", "pose-udp-2.rate=50"], ["pose", "pose_2"]),
        (["left:pose_udp={0}", "right:pose-udp={1}"], ["left.rate=100", "right.rate=50"], ["left", "right"]),
        (["pose_udp={0}", "pose:pose_udp={1}"], ["pose_udp.rate=100", "pose.rate=50"], ["pose_2", "pose"]),
        (["left=9", "pose_udp={1}"], ["left.address=127.0.0.1:{0}", "pose_udp.rate=50"], ["left", "pose"]),
    ],
)
def test_two_instruments_of_a_kind_are_recorded_side_by_side(
    asked: list[str],
    rates: list[str],
    streams: list[str],
    tmp_path: Path,
    sound: Path,
    capsys: Capture,
) -> None:
    out, config, ports = tmp_path / "take.mcap", tmp_path / "bench.toml", free_ports(2)
    text = '[instruments.left]\nname = "pose-udp"\nrate = 100\n' if asked[0].startswith("left=") else ""
    config.write_text(text, encoding="utf-8")
    more = [word for each in asked for word in ("--instrument", each.format(*ports))]
    more += [word for each in ("source.speed=1", *rates) for word in ("--set", each.format(*ports))]
    with posing(ports):
        given = words(out, sound, "--config", str(config), "--seconds", "0.6", *more)
        counted = record(capsys, *given)["instruments"]
    assert [each["stream"] for each in counted.values()] == streams
    session = read_session(out)
    for x, (stream, rate) in enumerate(zip(streams, (100.0, 50.0), strict=True)):
        track = session.readings(stream)
        assert len(track.time) > 20
        assert set(track.column("x")) == {x}
        assert track.feed.rate == rate
    assert check(out).sound
    assert set(record(capsys, "sessions", "show", out)["streams"]) == set(streams)
    for form in ("wav-csv", "parquet"):
        assert run(["sessions", "export", form, str(out), "--out", str(tmp_path / form)]) == 0
        named = {path.stem for path in (tmp_path / form).rglob("*")}
        assert set(streams) <= named


def test_settings_come_from_a_file_then_options_then_set(
    tmp_path: Path, sound: Path, capsys: Capture
) -> None:
    config, out = tmp_path / "bench.toml", tmp_path / "take.mcap"
    config.write_text(
        f'seconds = 0.2\n[source]\nname = "wav"\npath = "{sound}"\n'
        '[about]\nobject = "wood"\nnote = "of the file"\nmaterial = "oak"\n',
        encoding="utf-8",
    )
    arguments = ["--object", "metal", "--set", "about.material=steel", "--seconds", "9"]
    assert run(["record", str(out), "--config", str(config), *arguments]) == 0
    description = read_session(out).description
    assert (description.object, description.notes, description.material) == ("metal", "of the file", "steel")
    assert read_session(out).audio.samples.shape[1] == 44100
    capsys.readouterr()


def test_a_session_that_exists_is_not_overwritten(tmp_path: Path, sound: Path, capsys: Capture) -> None:
    out = tmp_path / "take.mcap"
    out.write_bytes(b"precious")
    assert "take.mcap" in refusal(capsys, *words(out, sound))
    assert out.read_bytes() == b"precious"


def test_a_signal_ends_it_with_its_summary(tmp_path: Path, sound: Path) -> None:
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
        process.send_signal(signal.SIGTERM)
        printed, shown = process.communicate(timeout=20)
    assert process.returncode == 0
    summary = json.loads(printed)
    assert "Traceback" not in shown
    assert check(out).sound
    assert read_session(out).audio.samples.shape[1] == summary["frames"]
