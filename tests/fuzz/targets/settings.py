"""What a person writes in TOML: settings of commands, plans, grids and presets; and ``--set`` over them."""

from collections.abc import Callable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from tests.fuzz.base import Input, Target

from monochord.cli import live as live_command
from monochord.cli import record as record_command
from monochord.core.config import dump_toml, load_toml, override
from monochord.core.errors import InputError
from monochord.lab.collection import chosen
from monochord.lab.plans import load_plan
from monochord.live import LiveRun
from monochord.perception.training.settings import TrainingSettings
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.strings import load_string

LIVE = """seconds = 5.0
string = "appendix"
[source]
name = "wav"
path = "take.wav"
[estimator]
name = "closed_form"
length = 0.65
open_frequency = 110.0
calibration = [[392.0, 0.2], [440.0, 0.3, 1e-4]]
[window]
length = 0.1
hop = 0.01
[sinks.terminal]
[sinks.jsonl]
path = "out.jsonl"
"""
RECORD = """seconds = 2.0
[source]
name = "jack"
ports = "player:"
[instruments.net_ft]
address = "127.0.0.1"
bias = true
[instruments.udp]
columns = ["a", "b"]
stream = "oven"
[about]
object = "plastic"
sensor = "prototype"
radius = 0.005
preamp_gains = [20.0, 19.5]
[disk]
start = 1e8
"""
UNSAID = dict.fromkeys(
    ("source", "device", "rate", "length", "open_frequency", "estimator", "window", "hop", "string",
     "seconds", "real_time", "object", "simulated", "material", "radius", "sensor", "notes")
)  # fmt: skip
ASSIGNMENTS = """seed=3
window.hop=0.02
source.path=take.wav
feature={name="log_mel"}
heads.force.hidden=[8, 8]
estimator.calibration=[[392.0, 0.2]]
groups=[]
net_ft.bias=true
title="a text"
"""


def _train(file: Path, assignments: Sequence[str]) -> None:
    settings = TrainingSettings.read(override(load_toml(file), assignments))
    settings.tasks()
    dump_toml(settings.resolved())


def _live(file: Path, assignments: Sequence[str]) -> None:
    tree = live_command._tree(None, None, {**UNSAID, "config": file, "sinks": (), "as_json": False})
    dump_toml(LiveRun.read(override(tree, assignments)).resolved())


def _record(file: Path, assignments: Sequence[str]) -> None:
    options = {
        **UNSAID,
        "object_": None,
        "config": file,
        "instruments": ("pose_udp",),
        "assignments": assignments,
    }
    record_command._job(Path("take.mcap"), options)


def _plan(file: Path, assignments: Sequence[str]) -> None:
    plan = load_plan(str(file), assignments)
    sessions = chosen(plan)
    for session in (sessions[0], sessions[-1]):
        session.cells()
        session.sensor()
        assert session.radius > 0.0
        assert session.epoch > 0.0


KINDS: dict[str, Callable[[Path, Sequence[str]], Any]] = {
    "train": _train,
    "live": _live,
    "record": _record,
    "plan": _plan,
    "string": lambda file, _: load_string(str(file)).usual_contact,
    "material": lambda file, _: load_material(str(file)),
    "sensor": lambda file, _: load_sensor(str(file)),
}
FOLDERS = {
    "train": "monochord.perception.training.configs",
    "plan": "monochord.lab.plans",
    "string": "monochord.physics.strings",
    "material": "monochord.physics.materials",
    "sensor": "monochord.physics.sensors",
}


class Fuzz(Target):
    """A file of each kind, most with lines of ``A.B=C`` beside it."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        texts = [("live", LIVE), ("record", RECORD)]
        for kind, package in FOLDERS.items():
            presets = sorted(Path(str(files(package))).glob("*.toml"))
            texts += [(kind, each.read_text(encoding="utf-8")) for each in presets[:3]]
        for kind, text in texts:
            yield {f"{kind}.toml": text.encode()}
            fitting = [
                line for line in ASSIGNMENTS.splitlines() if line.partition(".")[0].partition("=")[0] in text
            ]
            yield {f"{kind}.toml": text.encode(), "assignments.set": "\n".join(fitting).encode()}

    def run(self, folder: Path) -> None:
        beside = folder / "assignments.set"
        lines = (
            beside.read_text(encoding="utf-8", errors="surrogateescape").split("\n")
            if beside.exists()
            else []
        )
        kinds = [kind for kind in KINDS if (folder / f"{kind}.toml").exists()]
        if not kinds:
            raise InputError("no settings", "some")
        # An argument of a command holds no zero byte.
        KINDS[kinds[0]](folder / f"{kinds[0]}.toml", [line for line in lines if line and "\0" not in line])
