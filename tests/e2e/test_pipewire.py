"""Commands under ``pw-jack``, on a PipeWire server of the test's own: PipeWire as a JACK server."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.bringup import STEPS, Virtual
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import sensor_of
from monochord.sessions import check, read_session

pytestmark = [pytest.mark.slow, pytest.mark.jack]
RATE = 44100
CARD = "Scarlett 4i4 USB Pro"
"""Description of the device, after which PipeWire names its ports."""
PORTS = [f"{CARD}:capture_AUX{k}" for k in range(2)]
INPUT, OUTPUT = "strings", "alsa_input.usb-scarlett"  # node names of the two ends of the loopback
CONFIG = f"""
context.properties = {{
    core.daemon = true  core.name = pipewire-0
    default.clock.rate = {RATE}  default.clock.allowed-rates = [ {RATE} 48000 ]
    default.clock.quantum = 512  default.clock.min-quantum = 64  default.clock.max-quantum = 2048
}}
context.spa-libs = {{
    audio.convert.* = audioconvert/libspa-audioconvert
    support.* = support/libspa-support
}}
context.modules = [
    {{ name = libpipewire-module-rt  flags = [ ifexists nofail ] }}
    {{ name = libpipewire-module-protocol-native }}
    {{ name = libpipewire-module-metadata }}
    {{ name = libpipewire-module-spa-node-factory }}
    {{ name = libpipewire-module-client-node }}
    {{ name = libpipewire-module-access }}
    {{ name = libpipewire-module-adapter }}
    {{ name = libpipewire-module-link-factory }}
    {{ name = libpipewire-module-loopback  args = {{
        audio.position = [ AUX0 AUX1 ]
        capture.props = {{ node.name = {INPUT}  node.description = "Strings"  media.class = Audio/Sink }}
        playback.props = {{ node.name = {OUTPUT}  node.description = "{CARD}"  media.class = Audio/Source }}
    }} }}
]
context.objects = [
    {{ factory = metadata  args = {{ metadata.name = default }} }}
    {{ factory = spa-node-factory  args = {{
        factory.name = support.node.driver  node.name = Dummy-Driver  node.group = pipewire.dummy
        priority.driver = 20000 }} }}
]
"""
"""A server with one stereo device, ``CARD``: what is played into ``Strings`` is what it captures."""
PORT_CONFIG = """{ direction: "%s", mode: "dsp", format: { mediaType: "audio", mediaSubtype: "raw",
    format: "F32P", rate: 44100, channels: 2, position: [ "AUX0", "AUX1" ] } }"""
PLAY = """
import math, sys, time
import soundfile
from monochord.capture.jack import libjack
from monochord.lab.player import Player

def captures(client):
    return libjack.library().jack_get_ports(client.handle, b"monochord:in_2", None, libjack.IS_INPUT)

player = None
for line in sys.stdin:
    if line == "go\\n":
        while not captures(player._client):
            time.sleep(0.02)
        player.begin_at(time.monotonic() + 0.3)
        player.wait(60.0)
        print("played", flush=True)
        continue
    if player:
        player.close()
    sound = soundfile.read(line.strip(), dtype="float32", always_2d=True)[0].T
    ports = "Strings:playback_AUX0", "Strings:playback_AUX1"
    player = Player(sound, 44100, connect=ports, begin=math.inf)
    print("ready", flush=True)
"""
"""Joins with the file it reads the name of, and plays it at ``go``, once somebody captures the device.

A client that joins may cost the others some periods, so that it has to be there before.
"""


@dataclass
class PipeWire:
    """A running server; `environment` is that of its clients."""

    process: "subprocess.Popen[bytes]"
    environment: Mapping[str, str]

    def run(self, *arguments: str) -> "subprocess.CompletedProcess[str]":
        """Run a command of Monochord under ``pw-jack`` to its end."""
        command = ("pw-jack", sys.executable, "-m", "monochord", *arguments)
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False)

    def start(
        self, *arguments: str, python: tuple[str, ...] = ("-m", "monochord")
    ) -> "subprocess.Popen[str]":
        """Start a command of Monochord, or another program of Python, under ``pw-jack``."""
        pipe = subprocess.PIPE
        command = ("pw-jack", sys.executable, *python, *arguments)
        return subprocess.Popen(
            command, env=self.environment, stdin=pipe, stdout=pipe, stderr=pipe, text=True
        )


def configured(environment: Mapping[str, str]) -> bool:
    """Give both ends of the loopback their ports, as a session manager does; return whether it could."""
    listed = subprocess.run(["pw-dump"], env=environment, capture_output=True, text=True, check=False)
    nodes = json.loads(listed.stdout) if listed.returncode == 0 else []
    names = {
        each["info"]["props"].get("node.name"): str(each["id"]) for each in nodes if "Node" in each["type"]
    }
    if not {INPUT, OUTPUT} <= names.keys():
        return False
    for name, direction in ((INPUT, "Input"), (OUTPUT, "Output")):
        command = ["pw-cli", "set-param", names[name], "PortConfig", PORT_CONFIG % direction]
        subprocess.run(command, env=environment, capture_output=True, check=True)
    return True


@contextmanager
def server(folder: Path) -> Generator[PipeWire]:
    """A PipeWire server in a folder of its own, without a session manager and without real devices."""
    (folder / "run").mkdir(mode=0o700)
    (folder / "config").mkdir()
    (folder / "config/pipewire.conf").write_text(CONFIG, encoding="utf-8")
    for name in ("client.conf", "client-rt.conf", "jack.conf"):
        shutil.copy(Path("/usr/share/pipewire", name), folder / "config")
    environment = os.environ | {
        "XDG_RUNTIME_DIR": str(folder / "run"),
        "PIPEWIRE_CONFIG_DIR": str(folder / "config"),
    }
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(["pipewire"], env=environment, stdout=log, stderr=log)
        try:
            deadline = time.monotonic() + 20.0
            while not configured(environment):
                assert process.poll() is None, (folder / "log").read_text(encoding="utf-8")
                assert time.monotonic() < deadline
                time.sleep(0.1)
            yield PipeWire(process, environment)
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            process.wait(20.0)


@pytest.fixture(scope="module")
def pipewire(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PipeWire]:
    """The server of this module's tests; they are skipped where PipeWire is not installed."""
    missing = [name for name in ("pipewire", "pw-jack", "pw-cli", "pw-dump") if not shutil.which(name)]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed (Debian: apt install pipewire pipewire-jack)")
    with server(tmp_path_factory.mktemp("pipewire")) as running:
        yield running


@dataclass
class Player:
    """A process that plays files into the device."""

    process: "subprocess.Popen[str]"

    def load(self, file: Path) -> None:
        """Join the server with a file's sound, not yet played."""
        self._tell(str(file))
        self._wait_for("ready")

    def play(self, *, to_the_end: bool = True) -> None:
        """Play the file; wait for its end, unless another one follows it meanwhile."""
        self._tell("go")
        if to_the_end:
            self._wait_for("played")

    def _tell(self, line: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def _wait_for(self, line: str) -> None:
        assert self.process.stdout
        while (said := self.process.stdout.readline()) != f"{line}\n":
            assert said == "played\n"  # of the file before


@pytest.fixture
def player(pipewire: PipeWire) -> Iterator[Player]:
    """The player of one test."""
    with pipewire.start(python=("-c", PLAY)) as process:
        yield Player(process)
        process.kill()


@contextmanager
def recorder(pipewire: PipeWire, out: Path) -> Generator["subprocess.Popen[str]"]:
    """A recording of the device that has begun, and is ended at the end."""
    with pipewire.start("record", str(out), "--source", "jack", "--json") as process:
        while not out.exists() or out.stat().st_size < 200_000:
            assert process.poll() is None
            time.sleep(0.05)
        yield process
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    assert check(out).sound


def test_a_devices_ports_are_listed_and_the_doctor_says_who_serves(pipewire: PipeWire) -> None:
    listed = pipewire.run("list", "devices", "--json")
    devices = [each for each in json.loads(listed.stdout)["devices"] if each["source"] == "jack"]
    assert [device["name"] for device in devices if device["is_default"]] == PORTS
    checks = json.loads(pipewire.run("doctor", "--json").stdout)["checks"]
    jack = next(each for each in checks if each["name"] == "JACK")
    assert "PipeWire" in jack["detail"]
    assert f"{RATE} Hz" in jack["detail"]


def test_a_name_of_jack_is_answered_with_pipewires(pipewire: PipeWire) -> None:
    for command in (
        "live --source jack system:capture_1,system:capture_2 --length 0.65 --seconds 1",
        "doctor --sensor prototype --source jack --yes --set source.ports=system:capture_1",
    ):
        done = pipewire.run(*command.split())
        line = done.stderr.splitlines()[-1]
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
        assert "system:capture_1" in line
        assert "PipeWire" in line.split(";")[-1]
        assert ",".join(PORTS) in line.split(";")[-1]


def test_without_pw_jack_it_says_to_use_it(pipewire: PipeWire) -> None:
    server = ["--set", "source.server=nobody"]  # whatever else runs on this machine
    for command in (
        ["live", "--source", "jack", *server, "--length", "0.65", "--open-frequency", "110"],
        ["doctor", "--sensor", "prototype", "--source", "jack", "--yes", *server],
    ):
        done = subprocess.run(
            [sys.executable, "-m", "monochord", *command],
            env=pipewire.environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        line = done.stderr.splitlines()[-1]
        assert done.returncode == 2
        assert line.split("; ")[-1].startswith("PipeWire runs here")
        assert "pw-jack" in line


def test_what_is_played_is_recorded_to_the_bit(pipewire: PipeWire, player: Player, tmp_path: Path) -> None:
    played = np.random.default_rng(1).uniform(-0.5, 0.5, (2, 2 * RATE)).astype(np.float32)
    soundfile.write(tmp_path / "noise.wav", played.T, RATE, subtype="FLOAT")
    player.load(tmp_path / "noise.wav")
    with recorder(pipewire, tmp_path / "take.mcap"):
        player.play()
        time.sleep(0.5)  # what is still on its way
    audio = read_session(tmp_path / "take.mcap").audio
    first, *_ = np.flatnonzero(np.any(audio.samples != 0.0, axis=0))
    assert np.array_equal(audio.samples[:, first : first + played.shape[1]], played)
    assert audio.gaps == ()


def test_a_stall_is_a_gap_by_the_frames_count_where_no_xrun_is_told(
    pipewire: PipeWire, tmp_path: Path
) -> None:
    with recorder(pipewire, tmp_path / "take.mcap") as process:
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        process.send_signal(signal.SIGCONT)
        time.sleep(1.0)
    audio = read_session(tmp_path / "take.mcap").audio
    assert sum(end - begin for begin, end in audio.gaps) / RATE == pytest.approx(0.5, abs=0.2)


def test_a_touch_is_located_live(pipewire: PipeWire, player: Player, tmp_path: Path) -> None:
    note, pressed = tmp_path / "touch.wav", ("--at", "0.08", "--force", "1", "--seconds", "2")
    made = pipewire.run("simulate", "prototype", "--model", "twin", *pressed, "--out", str(note))
    assert made.returncode == 0
    player.load(note)
    with pipewire.start("live", "demo", "--source", "jack", "--sensor", "prototype", "--json") as process:
        assert process.stdout
        lines = [process.stdout.readline()]
        player.play()
        process.send_signal(signal.SIGINT)
        lines += process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == 0
    records = [json.loads(line) for line in lines]
    places = [each["position"] for each in records if each["valid"]]
    assert len(places) > 10  # a busy machine skips windows
    assert np.median(places) == pytest.approx(0.08, abs=1e-3)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("fault", ["", "microphone 2 dead"])
def test_a_sensor_is_brought_up(pipewire: PipeWire, player: Player, tmp_path: Path, fault: str) -> None:
    virtual = Virtual(sensor=sensor_of(load_sensor("prototype"), "plausible", build=1002), seed=1)
    for step in STEPS:
        take, gains = virtual.take(step), (1.0, 0.0 if fault else 1.0)
        soundfile.write(tmp_path / f"{step.name}.wav", take.samples.T * gains, RATE, subtype="FLOAT")
    out = tmp_path / "mine.toml"
    words = ("--sensor", "prototype", "--source", "jack", "--json", "--out", str(out))
    with pipewire.start("doctor", *words) as doctor:
        assert doctor.stderr
        assert doctor.stdin
        for line in doctor.stderr:
            name, *_ = line.split() or [""]
            if name in {step.name for step in STEPS}:
                player.load(tmp_path / f"{name}.wav")
                player.play(to_the_end=False)
                doctor.stdin.write("\n")  # Enter, as the prompt asks for
                doctor.stdin.flush()
        assert doctor.stdout
        printed = json.loads(doctor.stdout.read())
    assert printed["faults"] == ([fault] if fault else [])
    assert doctor.returncode == bool(fault)
    assert out.exists()
