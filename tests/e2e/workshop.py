"""A folder with what the how-to pages presuppose, and somebody in it who types the commands of a page."""

import csv
import json
import os
import re
import shlex
import shutil
import signal
import sys
import time
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from urllib.request import HTTPCookieProcessor, build_opener

import numpy as np
import soundfile
from tests.contract.test_documents import blocks
from tests.contract.test_layout import PAGES, ROOT
from tests.contract.test_open_closed import write_distribution
from tests.e2e.test_newcomer import BUILD, Newcomer, Process
from tests.e2e.test_robot_labels import first
from websockets.sync.client import connect

from monochord.bringup import STEPS, Virtual
from monochord.capture.dds.participant import Participant
from monochord.core.types import Audio
from monochord.core.units import Hertz
from monochord.physics.sensors import load_sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord_encoders.network import Sizes, Weights, network_of

HOW_TO, PRESETS = ROOT / "docs" / "how-to", ROOT / "src" / "monochord" / "physics"
LIVE = "live", "demo", "record", "tune"
"""Commands that listen: they start before other programs, as on an audio workstation."""
SHOWS = re.compile(r"^ +\d+\.\d+ s  ", re.MULTILINE)
"""A line about the windows or the recording so far."""
INTERRUPTED = 130
PATIENCE = 120.0
AT_MOST = 5.0
"""Longest `--seconds` that is waited for."""
PLACES, HELD, APART = (0.065, 0.09, 0.115, 0.14), 1.6, 1.2
"""Where the reader touches in m, how long, and how long not, in s."""
OBJECTS = ("plastic", "plastic_2", "plastic_3", "plastic_4", "wood", "metal_tube", "allen_key", "music")
LAMP = '''
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import monochord as mc


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamp(mc.Sink):
    """A lamp that shines while something touches."""

    @contextmanager
    def open(self, run):
        yield self

    def write(self, update):
        Path("lamp.txt").write_text(f"{bool(update.decided.get('contact'))}")
'''


def touched(rate: int) -> Audio:
    """Return the sound of a touch."""
    twin = VirtualSensor("prototype", seed=1, sample_rate=rate)
    untouched = twin.advance(2.0)[0]
    twin.press(0.08, 1.0)
    touch = twin.advance(1.5)[0]
    twin.release()
    return np.concatenate((untouched, touch, twin.advance(1.0)[0]), axis=1)


def riff(rate: int, open_frequency: Hertz) -> Audio:
    """Return three notes on a string of a guitar: open, and at its frets 5 and 12."""
    time = np.arange(rate // 2) / rate
    notes = [open_frequency * 2.0 ** (fret / 12.0) for fret in (0, 5, 12)]
    levels = [(n, 0.2 / n * np.exp(-(0.5 + 0.3 * n) * time)) for n in range(1, 15)]
    parts = [sum(level * np.sin(2.0 * np.pi * n * f * time + n) for n, level in levels) for f in notes]
    return np.concatenate(parts).astype(np.float32)


def group(name: str, **options: object) -> str:
    """Return a group of a plan whose sessions take a few seconds."""
    short = {"name": name, "grid": [2, 1], "forces": [0.8, 1.2], "hold": 0.5, "days": [1], **options}
    return "[[groups]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in short.items())


class Reader(Newcomer):
    """Types the commands of a page, with some words replaced by others."""

    def __init__(self, folder: Path, server: str, stack: ExitStack, substitutions: Mapping[str, str]) -> None:
        super().__init__(folder, server, BUILD, stack)
        self.workshop, self.stack, self.substitutions = folder, stack, substitutions
        self.ports: dict[str, object] = {}

    def typed(self, line: str) -> str:
        """Return a command as it is typed here."""
        for part, other in self.substitutions.items():
            if part in line:
                if "{cluster}" in other:
                    self.ports["cluster"] = self.stack.enter_context(cluster())
                line = line.replace(part, other.format(**self.ports))
        return line

    def prepare(self) -> None:
        """Fill the workshop with what the pages presuppose, after sessions, dataset and run."""
        here = self.folder
        for name in ("take", "session", "touches", "check"):
            shutil.copy(here / "sessions" / "hold_000.mcap", here / f"{name}.mcap")
        shutil.copy(PRESETS / "sensors" / "prototype.toml", here / "my_sensor.toml")
        shutil.copy(PRESETS / "strings" / "prototype.toml", here / "my_string.toml")
        steps = Virtual(sensor=load_sensor("prototype"), seed=1)
        (here / "takes").mkdir()
        for step in STEPS:
            soundfile.write(here / "takes" / f"{step.name}.wav", steps.take(step).samples.T, 44100)
        shutil.copy(here / "takes" / "pluck.wav", here / "pluck.wav")
        shutil.copy(here / "takes" / "both.wav", here / "driven.wav")
        for name, rate in (("take", 44100), ("at 48 kHz", 48000)):
            soundfile.write(here / f"{name}.wav", touched(rate).T, rate)
        soundfile.write(here / "riff.mp3", riff(44100, 329.63), 44100, format="MP3")
        (table,) = [
            text for text in blocks(PAGES[HOW_TO / "sessions.md"], "text") if text.startswith("time,")
        ]
        (here / "take.csv").write_text(table, encoding="utf-8")
        (here / "tcp.csv").write_text("time,x,y,z,rx,ry,rz\n0.0,0.1,0.0,0.0,0.1,0.2,0.3\n", encoding="utf-8")
        (bench,) = [text for text in blocks(PAGES[HOW_TO / "record.md"], "toml") if "bench.toml" in text]
        bench = bench.replace('"192.168.1.1"', '"{net_ft}"\nhttp_port = {http}'.format(**self.ports))
        (here / "bench.toml").write_text(self.typed(bench), encoding="utf-8")
        (here / "short.toml").write_text(group("hold") + group("slide", protocol="slide"), encoding="utf-8")
        (finger,) = [text for text in blocks(PAGES[HOW_TO / "a-hand.md"], "toml") if "finger.toml" in text]
        (here / "finger.toml").write_text(finger, encoding="utf-8")
        robot = '<robot name="arm"><link name="fingertip"/></robot>'
        (here / "arm.urdf").write_text(robot, encoding="utf-8")
        objects = [group(name, material=re.sub(r"_\d$|^music$", "", name) or "plastic") for name in OBJECTS]
        (here / "objects.toml").write_text("\n".join(objects), encoding="utf-8")
        builds = group("hold", sessions=8, builds=[*range(1, 9)], grid=[8, 1], world="plausible")
        (here / "builds.toml").write_text(builds, encoding="utf-8")
        write_distribution(here, "my_lab", ["[monochord.sinks]", "lamp = my_lab.lamp"])
        sizes = Sizes(depth=1, width=64, inner=256, columns=9)
        network_of(Weights(sizes=sizes), 100).model.save_pretrained(here / "ast")
        (here / "my_lab").mkdir()
        (here / "my_lab" / "lamp.py").write_text(LAMP, encoding="utf-8")
        for line in (
            "monochord tune --source twin --out sensor.toml",
            "monochord collect small --seed 1 --out monday",
            "monochord collect objects.toml --out objects",
            "monochord collect builds.toml --out builds",
            "monochord calibrate demo --sessions touches.mcap --out mine",
            "monochord simulate wound_036 --untouched --seconds 1 --out open.wav",
            "monochord simulate wound_036 --at 0.25 --seconds 1 --out guitar.wav",
            "monochord simulate wound_036 --at 0.325 --seconds 1 --out twelfth-fret.wav",
        ):
            self.follow(line)
        for name in ("left", "right"):
            shutil.copy(here / "sensor.toml", here / f"{name}.toml")

    def open(self, folder: Path, meant: Mapping[str, str]) -> None:
        """Go into a copy of the workshop, in which some files have the names of others."""
        shutil.copytree(self.workshop, folder, copy_function=linked)
        for name, other in meant.items():
            shutil.move(folder / name, folder / f"other {name}")
            shutil.move(folder / other, folder / name)
        self.folder = folder

    def follow(self, line: str, *, touches: bool = False) -> None:
        """Run a command, which ends by itself, or by Control-C once it shows that it works."""
        line, begin = self.typed(line), time.monotonic()
        words = shlex.split(line, comments=True)[1:]
        self.clear(line, words)
        if words[:2] == ["sessions", "label"]:
            self.label(words)
        elif words[0] == "doctor" and "--drift" in words:
            self.listens_to_drift(words)
        else:
            self.by_hand(words)
            self.runs(line, words, touches=touches)
        self.say(f"{time.monotonic() - begin:5.1f} s  {line}")

    def clear(self, line: str, words: list[str]) -> None:
        """Remove what a command would write, where it does not replace or continue it."""
        after = {words[k + 1] for k, word in enumerate(words) if word in ("--out", "--save-config")}
        after |= {re.sub(r"toml$", "html", name) for name in after if words[0] == "doctor"}
        if words[0] == "tune" and "--out" not in words:
            after.add("sensor.toml")
        if words[0] == "record" or words[:2] == ["sessions", "label"]:
            after |= {word for word in words[1:3] if word.endswith(".mcap")}
        kept = {name for name in after if f"{name}/" in line or "--force" in words}
        for out in (self.folder / name for name in after - kept):
            shutil.rmtree(out) if out.is_dir() else out.unlink(missing_ok=True)

    def runs(self, line: str, words: list[str], *, touches: bool) -> None:
        command = ["bash", "-c", f"exec {shlex.quote(sys.executable)} -u -m {line}"]
        with ExitStack() as stack:
            if words[0] in LIVE:
                stack.enter_context(first())
            process = self.process(command)
        assert process.process.stdin
        process.process.stdin.close()
        status = 0
        if is_endless(words):
            self.watch(line, words, process)
            if touches:
                self.touches()
            process.process.send_signal(signal.SIGINT)
            status = INTERRUPTED if words[0] == "doctor" else 0  # its steps have not been done
        printed = process.end(status)
        assert "nan" not in printed.split()

    def watch(self, line: str, words: list[str], process: Process) -> None:
        """Wait until a command shows by a line, a file, a message or its page that it works."""
        files = [self.folder / name for name in re.findall(r"--sink \w+=(\S+\.\w+)\b", line)]
        files += [self.folder / "lamp.txt"] if "lamp" in words else []
        deadline = time.monotonic() + PATIENCE
        with ros_messages(line) as messages:
            while not any(file.exists() and file.stat().st_size for file in files):
                out, err = process.read["out"], process.read["err"]
                if link := re.search(r"^page: (\S+)", out, re.MULTILINE):
                    return answers(link[1], has_sound=words[0] in LIVE)
                if SHOWS.search(out) or SHOWS.search(err) or messages:
                    return None
                assert process.process.poll() is None, (line, out, err)
                assert time.monotonic() < deadline, (line, out, err)
                time.sleep(0.05)
        return None

    def touches(self) -> None:
        """Touch the string where it is known."""
        time.sleep(APART)
        for place in PLACES:
            self.does(f"press {1e3 * place:.3f} 1.0")
            time.sleep(HELD)
            self.does("release")
            time.sleep(APART)

    def by_hand(self, words: list[str]) -> None:
        """Do what a page asks of its reader before a command."""
        if words[:2] == ["sessions", "import"] and words[3] == "touches.csv":
            self.fills_in()
        if "mine.json" in words:
            shutil.copy(self.folder / "dataset" / "split.json", self.folder / "mine.json")
        cut = self.folder / "sessions" / "cut.mcap"
        cut.unlink(missing_ok=True)
        if words[:2] == ["sessions", "recover"]:
            whole = (self.folder / "take.mcap").read_bytes()
            cut.write_bytes(whole[: len(whole) // 2])

    def fills_in(self) -> None:
        """Complete the table of the touches of take.mcap."""
        self.follow("monochord sessions touches take.mcap --out touches.csv")
        table = self.folder / "touches.csv"
        with table.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == len(PLACES)
        with table.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, ["begin", "end", "position", "force"])
            writer.writeheader()
            writer.writerows(row | {"position": x, "force": 1.0} for row, x in zip(rows, PLACES, strict=True))

    def listens_to_drift(self, words: list[str]) -> None:
        doctor = self.monochord(words)
        for _ in STEPS:
            doctor.until("Enter to record")
            doctor.type("s")
        doctor.until("Enter to record")
        doctor.type("")
        doctor.end()


def is_endless(words: list[str]) -> bool:
    """Return whether a command runs until Control-C, or longer than a test waits."""
    if "--seconds" in words:
        return float(words[words.index("--seconds") + 1]) > AT_MOST
    is_of_a_file = words[0] == "live" and any(word.endswith((".wav", ".mcap")) for word in words[1:3])
    is_of_a_file &= "source.speed=1" not in words  # as long as the sound
    return "--web" in words or (words[0] in LIVE[:3] and not is_of_a_file)


def answers(link: str, *, has_sound: bool) -> None:
    """Ask for a page, and wait until it shows sound."""
    link = re.sub(r"//[^/]*:", "//127.0.0.1:", link)
    with build_opener(HTTPCookieProcessor()).open(link) as page:
        assert page.status == 200
    if has_sound:
        token = link.partition("token=")[2]
        headers = {"Cookie": f"monochord={token}"} if token else {}
        place = link.partition("?")[0].replace("http:", "ws:")
        with connect(f"{place}live", additional_headers=headers, open_timeout=30) as client:
            while '"moment"' not in str(client.recv(PATIENCE)):
                pass


@contextmanager
def ros_messages(line: str) -> Generator[list[object]]:
    """Yield the wrenches that a command publishes."""
    received: list[object] = []
    if not (sink := re.search(r"--sink ros2(?:=(\S+))?", line)):
        yield received
        return
    domain = re.search(r"ros2\.domain=(\d+)", line)
    with Participant(domain=int(domain[1]) if domain else None) as here:
        place = sink[1] or "/monochord"
        for string in ("/left", "/right") if "--skin" in line else ("",):
            here.reader(
                f"{place}{string}/wrench", "WrenchStamped", lambda message, _: received.append(message)
            )
        yield received


@contextmanager
def cluster() -> Generator[str]:
    """The address of a dask scheduler with a worker."""
    from distributed import LocalCluster

    options: Any = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0"}
    started: Any = LocalCluster(host="127.0.0.1", **options)
    with started:
        yield started.scheduler_address


def linked(source: str, copy: str) -> str:
    """Copy a file, by a link where it is large: nothing writes into a session or dataset in place."""
    if Path(source).stat().st_size < 1 << 16:
        return shutil.copy2(source, copy)
    os.link(source, copy)
    return copy
