"""Labels from a robot, by the commands of the guide: the paper's bench, and an arm without a force sensor.

The twin plays through a real JACK server, a simulated Net F/T sends RDT over UDP, and a simulated robot sends
its pose as JSON datagrams, each from a process of its own.
"""

import csv
import json
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import own_server
from tests.devices.robot import UdpSettings
from tests.ports import free_ports

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.priority import before_other_programs
from monochord.lab.assignment import assignments
from monochord.lab.net_ft_device import NetFtSettings
from monochord.lab.plan import Plan
from monochord.lab.player import PlayerSettings
from monochord.lab.real_time import _Device, _process
from monochord.lab.render import Rendering, render
from monochord.sessions import read_session

pytestmark = [pytest.mark.jack, pytest.mark.slow, pytest.mark.real_time, pytest.mark.timeout(900)]
GUIDE = Path(__file__).parents[2] / "docs" / "how-to" / "record.md"
PLAN = {
    "name": "bench",
    "force_rate": 1000.0,
    "groups": [{"name": "hold", "grid": [3, 2], "hold": 1.0, "forces": [0.5, 1.5], "material": "plastic"}],
}


def guide(title: str) -> list[str]:
    """Return the commands under a title of the guide, without the program's name."""
    text = GUIDE.read_text(encoding="utf-8").partition(f"## {title}\n")[2]
    block = text.partition("```sh\n")[2].partition("```")[0]
    return [line.removeprefix("monochord ") for line in block.replace("\\\n", "").splitlines()]


@contextmanager
def first() -> Generator[None]:
    """Start what is started here before other programs, where that is permitted."""
    with ExitStack() as stack:
        with suppress(InputError):
            stack.enter_context(before_other_programs())
        yield


@dataclass(frozen=True)
class Bench:
    """A session to be played, and the addresses of its devices."""

    folder: Path
    rendering: Rendering
    server: str
    addresses: dict[str, dict[str, str]]
    devices: list[_Device]

    def run(self, line: str) -> str:
        """Run a command of the guide, at this bench's addresses."""
        net_ft, player = self.addresses["net_ft_device"], self.addresses["player"]
        words = shlex.split(
            line.replace("net_ft=192.168.1.1", f"net_ft={net_ft['address']}").replace(
                "pose_udp=9871", f"pose_udp={self.addresses['pose']['port']}"
            )
        )
        command = [sys.executable, "-m", "monochord", *words]
        if words[0] != "record":
            run = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)
            assert run.returncode == 0, run.stderr
            return run.stdout
        sets = [f"source.server={self.server}", f"source.ports={','.join(player['ports'])}"]
        if "net_ft" in line:
            sets += [f"net_ft.http_port={net_ft['http_port']}", "net_ft.silence_seconds=5"]
        command += ["--seconds", f"{self.rendering.seconds + 3.0:g}", *(f"--set={each}" for each in sets)]
        with ExitStack() as stack:
            with first():
                process = stack.enter_context(
                    subprocess.Popen(
                        command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
                    )
                )
            out = self.folder / words[1]
            deadline = time.monotonic() + 60.0
            while not (out.exists() and out.stat().st_size > 50_000):
                assert process.poll() is None, process.communicate()
                assert time.monotonic() < deadline
                time.sleep(0.02)
            begin = time.monotonic() + 1.0
            for device in self.devices:
                device.begin_at(begin)
            printed, error = process.communicate(timeout=120)
            assert process.returncode == 0, error
            return printed


@pytest.fixture
def bench(tmp_path: Path) -> Generator[Bench]:
    session = assignments(from_tree(Plan, PLAN))[0]
    rendering = render(session)
    (port,) = free_ports(1)
    with own_server() as server, ExitStack() as stack:
        scripts: dict[str, tuple[dict[str, Any], Any]] = {
            "monochord.lab.player": (
                {"samples": rendering.microphones.astype(np.float64)},
                PlayerSettings(
                    sample_rate=session.plan.sample_rate,
                    client_name=f"bench-{os.getpid()}",
                    server=server.name,
                ),
            ),
            "monochord.lab.net_ft_device": (
                {"wrenches": rendering.wrench},
                NetFtSettings(rate=session.plan.force_rate),
            ),
            "tests.devices.robot": (
                {"poses": rendering.pose},
                UdpSettings(rate=session.plan.pose_rate, port=port),
            ),
        }
        with first():
            devices = [
                stack.enter_context(_process(module, tmp_path / f"{module}.npz", arrays, settings))
                for module, (arrays, settings) in scripts.items()
            ]
        addresses = {device.name: device.address for device in devices}
        folder = tmp_path / "lab"
        folder.mkdir()
        yield Bench(folder, rendering, server.name, addresses | {"pose": {"port": str(port)}}, devices)


def test_the_papers_bench_labels_its_own_recording(bench: Bench) -> None:
    record, check, build, audit, calibrate = guide("The paper's bench")
    bench.run(record)
    session = read_session(bench.folder / "take.mcap")
    assert {"wrench", "pose"} <= {*session.streams}
    assert bench.run(check).startswith("ok")
    bench.run(build)
    assert "no leak" in bench.run(audit)
    result = json.loads(bench.run(f"{calibrate} --json"))
    assert result["heads"]["position"]["touches"] >= 6
    assert result["heads"]["position"]["before"] < 2e-3


def test_an_arm_without_a_force_sensor_gives_positions_and_its_program_the_forces(bench: Bench) -> None:
    record, touches, import_, audit, calibrate = guide("An arm without a force sensor")
    bench.run(record)
    bench.run(touches)
    table = bench.folder / "touches.csv"
    with table.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["position"]]
    labels = bench.rendering.labels
    edges = np.flatnonzero(np.diff((labels["contact"] == 1.0).astype(int))).reshape(-1, 2)
    held = [slice(first + 300, last) for first, last in edges.tolist() if last - first > 600]  # no taps
    true = [tuple(float(np.nanmean(labels[name][each])) for name in ("position", "force")) for each in held]
    for row in rows:  # what the robot's program knows: the force at each place
        place, force = min(true, key=lambda each: abs(each[0] - float(row["position"])))
        assert float(row["position"]) == pytest.approx(place, abs=1e-3)
        row["force"] = f"{force:.3f}"
    assert len(rows) >= 5
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, ["begin", "end", "position", "force"])
        writer.writeheader()
        writer.writerows(rows)
    bench.run(import_)
    assert bench.run(audit).startswith("ok")
    result = json.loads(bench.run(f"{calibrate} --json"))
    assert result["heads"]["position"]["touches"] >= 5
