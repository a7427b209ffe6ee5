"""A newcomer with a box of parts follows the guide word for word, from bring-up to live estimates.

The box is the twin of a build that no model was trained on, as a sound card in a real JACK server. The
newcomer reads what the commands say, and has a ruler, a kitchen scale and a hand that is 1.5 mm and 15 % off
what it is asked for. ``pytest -m slow tests/e2e/test_newcomer.py -s`` prints the log with times, and the
errors.
"""

import json
import os
import re
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.contract.test_documents import command_lines

from monochord.capture.jack.client import JackClient
from monochord.core.errors import DeviceError, InputError
from monochord.core.priority import before_other_programs
from monochord.physics.known_touches import in_newtons
from monochord.sessions import read_session

pytestmark = [pytest.mark.jack, pytest.mark.slow, pytest.mark.real_time, pytest.mark.timeout(1800)]
GUIDE = Path(__file__).parents[2] / "docs" / "how-to" / "bring-up.md"
BUILD, DAY = 1003, 5
HAND = 1.5, 0.15
"""Standard deviations of a hand: place in mm, force as a share."""
TRIALS = 8
HELD, APART = 2.0, 1.2
PATIENCE = 120.0


def steps_of_the_guide() -> list[list[str]]:
    """Return the commands of the guide in order, without the check of the computer."""
    return [words for words in command_lines(GUIDE.read_text(encoding="utf-8")) if words != ["doctor"]]


class Process:
    """A running command, whose output is read as it comes, each chunk with its time."""

    def __init__(self, command: list[str], folder: Path, environment: dict[str, str]) -> None:
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stdin=pipe, stdout=pipe, stderr=pipe
        )
        self.read = {"out": "", "err": ""}
        self.lines: list[tuple[float, str]] = []
        self._seen = {"out": 0, "err": 0}
        self._readers = [
            threading.Thread(target=self._reads, args=(name, stream), daemon=True)
            for name, stream in (("out", self.process.stdout), ("err", self.process.stderr))
        ]
        for reader in self._readers:
            reader.start()

    def _reads(self, name: str, stream: Any) -> None:
        rest = ""
        while chunk := os.read(stream.fileno(), 65536):
            text = chunk.decode()
            self.read[name] += text
            if name == "out":
                *lines, rest = (rest + text).split("\n")
                self.lines += [(time.monotonic(), line) for line in lines]

    def until(self, pattern: str, where: str = "err") -> str:
        """Wait for a pattern in what has been printed since the last call, and return what it matched."""
        deadline = time.monotonic() + PATIENCE
        while True:
            found = re.compile(pattern).search(self.read[where], self._seen[where])
            if found:
                self._seen[where] = found.end()
                return found[0]
            assert self.process.poll() is None or self.running_out(), self.read
            assert time.monotonic() < deadline, (pattern, self.read)
            time.sleep(0.01)

    def running_out(self) -> bool:
        """Return whether output of an ended process is still being read."""
        return any(reader.is_alive() for reader in self._readers)

    def type(self, line: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        for reader in self._readers:
            reader.join()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            assert stream
            stream.close()

    def end(self, status: int = 0) -> str:
        assert self.process.wait(PATIENCE) == status, self.read
        for reader in self._readers:
            reader.join()
        assert "Traceback" not in self.read["err"]
        return self.read["out"]


class Newcomer:
    """Follows the guide with the box of parts."""

    def __init__(self, folder: Path, server: str, build: int, stack: ExitStack) -> None:
        self.begun = time.monotonic()
        self.folder, self._stack = folder, stack
        self.environment = {**os.environ, "JACK_DEFAULT_SERVER": server, "JACK_NO_START_SERVER": "1"}
        self.hand = np.random.default_rng(4)
        self.box = self.start(["tests.e2e.box_of_parts", server, str(build), str(DAY)])
        self.length = float(self.box.until(r"ready [\d.]+\n", "out").split()[1])

    def say(self, text: str) -> None:
        sys.stdout.write(f"{time.monotonic() - self.begun:7.1f} s  {text}\n")
        sys.stdout.flush()

    def start(self, words: list[str]) -> Process:
        """Start a program before others, as an audio workstation does."""
        with ExitStack() as first:
            with suppress(InputError):
                first.enter_context(before_other_programs())
            return self.process([sys.executable, "-u", "-m", *words])

    def process(self, command: list[str]) -> Process:
        """Start a command, which ends with the guide."""
        root = Path(__file__).parents[2]
        paths = os.pathsep.join([str(root), str(root / "src")])
        process = Process(command, self.folder, {**self.environment, "PYTHONPATH": paths})
        self._stack.callback(process.close)
        return process

    def monochord(self, words: list[str]) -> Process:
        self.say(f"$ monochord {shlex.join(words)}")
        return self.start(["monochord", *words])

    def does(self, what: str) -> None:
        """Do something with the box, and wait until it is done."""
        self.box.type(what)
        self.box.until(re.escape(what) + "\n", "out")

    def bring_up(self, words: list[str]) -> None:
        doctor = self.monochord(words)
        for name in ("quiet", "pluck", "tap", "driver_1", "driver_2", "both", "press", "damped"):
            asked = doctor.until(rf"{name} \(.*\n")
            self.say(asked.strip())
            doctor.until("Enter to record")
            self.does(f"step {name}")
            doctor.type("")
        printed = doctor.end()
        self.say(printed.strip().replace("\n", "\n            "))
        assert "No fault." in printed

    def label(self, words: list[str]) -> None:
        label = self.monochord(words)
        for _ in range(int(words[words.index("--touches") + 1])):
            asked = label.until(r"Press near (\d+) mm with about (\d+) g")
            place, grams = map(float, re.findall(r"\d+", asked))
            place += HAND[0] * self.hand.standard_normal()
            grams *= 1.0 + HAND[1] * self.hand.standard_normal()
            self.does(f"press {place:.3f} {in_newtons(grams, 'g'):.4f}")
            label.until("Recorded")
            read = f"{round(2.0 * place) / 2.0:g} {grams:.0f}"  # half a millimetre, and a gram
            self.does("release")
            label.type(read)
            self.say(f"{asked} ... {read}")
        self.say(label.end().strip().replace("\n", "\n            "))

    def live(self, words: list[str]) -> dict[str, float]:
        """Touch at places in between; return the errors of what is shown."""
        live = self.monochord([*words, "--json"])
        live.until(r"\{", "out")
        time.sleep(3.0)
        touches: list[tuple[float, float, float, float]] = []
        rng = np.random.default_rng(9)
        for _ in range(TRIALS):
            place, force = rng.uniform(0.055, 0.145), rng.uniform(0.4, 1.6)
            self.does(f"press {1e3 * place:.3f} {force:.4f}")
            begin = time.monotonic()
            time.sleep(HELD)
            self.does("release")
            touches.append((begin + 0.8, begin + HELD, place, force))
            time.sleep(APART)
        live.process.send_signal(2)
        live.end()
        errors: dict[str, list[float]] = {"position": [], "force": []}
        answered: list[bool] = []
        for begin, end, place, force in touches:
            shown = [json.loads(line) for at, line in live.lines if begin < at < end]
            answered += [each["position"] is not None for each in shown]
            for name, truth in (("position", place), ("force", force)):
                own = [each[name] for each in shown if each[name] is not None]
                if own:
                    errors[name].append(abs(float(np.median(own)) - truth))
        assert errors["position"]
        return {
            "position": float(np.median(errors["position"])),
            "force": float(np.mean(errors["force"])),
            "answered": float(np.mean(answered)),
        }


@contextmanager
def empty_server(name: str) -> Generator[str]:
    """Run a JACK server without ports of its own: the box is the only sound card."""
    line = ["jackd", "-n", name, "-S", "-R", "-d", "dummy", "-r", "44100", "-p", "1024", "-C", "0", "-P", "0"]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(line, stdin=quiet, stdout=quiet, stderr=quiet) as server:
        try:
            for _ in range(400):
                with suppress(DeviceError):
                    JackClient("probe", name).close()
                    break
                time.sleep(0.05)
            yield name
        finally:
            server.terminate()


def test_a_newcomer_follows_the_guide(tmp_path: Path) -> None:
    doctor, tune, uncalibrated, label, calibrate, live = steps_of_the_guide()
    with ExitStack() as stack:
        server = stack.enter_context(empty_server(f"newcomer-{os.getpid()}"))
        person = Newcomer(tmp_path, server, BUILD, stack)
        person.bring_up(doctor)
        person.does("on")
        tune[tune.index("--length") + 1] = f"{person.length:.4f}"  # what this newcomer's ruler says
        person.say(person.monochord(tune).end().strip())
        person.label(label)
        printed = person.monochord(calibrate).end()
        person.say(printed.strip().replace("\n", "\n            "))
        before = person.live(uncalibrated)
        after = person.live(live)
        for name, scale, unit in (("position", 1e3, "mm"), ("force", 1.0, "N")):
            person.say(
                f"{name}: {scale * before[name]:.2f} {unit} before, {scale * after[name]:.2f} {unit} after"
            )
        person.say(f"answered: {before['answered']:.0%} before, {after['answered']:.0%} after")
        seconds = time.monotonic() - person.begun
    session = read_session(tmp_path / "touches.mcap")
    assert session.description.object == "plastic rod"
    assert session.audio.samples.any()
    assert after["answered"] > 0.8
    assert after["position"] < 2e-3
    assert after["force"] < 0.35
    assert seconds < 900.0
