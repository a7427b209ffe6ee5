"""The hardware suite: the same touches in every condition, each with one thing as hardware may have it.

`CONDITIONS` lists what is changed, and the plan `hardware` the touches. In the last of them a model should
abstain: a driver or a microphone is dead, the string is another, what touches is foam, or two things touch.
To add a condition, add it to this list; where a new quantity deviates, see `monochord.lab.deviation`.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from itertools import cycle
from pathlib import Path
from typing import TypeAlias

from monochord.core.config import to_tree
from monochord.core.errors import InputError, did_you_mean
from monochord.core.units import Metres
from monochord.lab.collection import made_folder
from monochord.lab.deviation import NONE, Deviation
from monochord.lab.offline import CollectedSession, make
from monochord.lab.plan import Assignment, Group, Plan, assignments
from monochord.lab.plans import load_plan
from monochord.lab.workers import run_all

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with what is done, how many sessions are done, and how many there are."""
PLAN = "hardware"
"""Preset of the plan whose touches every condition repeats."""
QUICK_GRID = (2, 1)
"""Places and forces of a group in a quick suite."""
SOURCES = ("physics", "lab/render.py", "lab/schedule.py", "lab/motors.py", "lab/force_sensor.py")
"""Folder and files of the package whose text the sound depends on."""
FIRST_BUILD = 1001
"""Seed of the first build, beyond those that plans train on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """What the sensor or its surroundings have in one part of the suite; nothing is "clean".

    Parameters
    ----------
    name
        As tables show it.
    deviation
        What deviates of the sensor and the object.
    motors
        Whether the robot's motors sound in the frame.
    builds
        Number of builds that the touches are spread over; 0 for the design itself.
    material
        Of the objects; empty for those of the plan.
    second
        Distance in m of a second object that touches at the same time; 0 for none.
    is_retuned
        Whether the open string may have another pitch: estimators are then also tested with the string as
        `monochord tune` measures it.
    """

    name: str
    deviation: Deviation = NONE
    motors: bool = False
    builds: int = 0
    material: str = ""
    second: Metres = 0.0
    is_retuned: bool = False


CONDITIONS: tuple[Condition, ...] = (
    Condition(name="clean"),
    *(
        Condition(name=f"distortion {100.0 * share:g} %", deviation=Deviation(distortion=share))
        for share in (0.001, 0.003, 0.01)
    ),
    *(Condition(name=f"SNR {snr:g} dB", deviation=Deviation(snr=snr)) for snr in (50.0, 40.0, 30.0)),
    *(
        Condition(name=f"{warming:+g} K", deviation=Deviation(warming=warming), is_retuned=True)
        for warming in (20.0, -20.0)
    ),
    *(
        Condition(name=f"drive x{drive:g}", deviation=Deviation(drive=drive))
        for drive in (0.5, 2.0, 4.0, 8.0)
    ),
    Condition(name="spring 1e5 N/m", deviation=Deviation(spring=1e5)),
    Condition(name="spring 1e6 N/m", deviation=Deviation(spring=1e6)),
    Condition(name="linear contact", deviation=Deviation(linear=True)),
    Condition(name="yielding ends", deviation=Deviation(ends=True), is_retuned=True),
    Condition(name="motors", motors=True),
    Condition(name="16 builds", builds=16, is_retuned=True),
    Condition(name="driver 1 dead", deviation=Deviation(dead_driver=1)),
    Condition(name="driver 2 dead", deviation=Deviation(dead_driver=2)),
    Condition(name="microphone 1 dead", deviation=Deviation(dead_microphone=1)),
    Condition(name="microphone 2 dead", deviation=Deviation(dead_microphone=2)),
    Condition(name="microphones swapped", deviation=Deviation(swapped=True)),
    Condition(name="gauge x1.2", deviation=Deviation(gauge=1.2)),
    Condition(name="foam", material="foam"),
    Condition(name="two touches", second=0.03),
    *(
        Condition(name=f"tuning {percent:+d} %", deviation=Deviation(pitch=0.01 * percent), is_retuned=True)
        for percent in (-6, -4, -2, 2, 4, 6)
    ),
)
"""The conditions of the suite."""


def chosen_conditions(names: Sequence[str] = ()) -> list[Condition]:
    """Return the conditions of these names, with the clean one first; all of them for no names.

    Raises
    ------
    InputError
        If there is none of a name.

    Examples
    --------
    >>> [condition.name for condition in chosen_conditions(["motors"])]
    ['clean', 'motors']
    """
    known = [condition.name for condition in CONDITIONS]
    for name in names:
        if name not in known:
            raise InputError(f"condition '{name}'", ", ".join(known), did_you_mean(name, known))
    return [each for each in CONDITIONS if not names or each.name in {CONDITIONS[0].name, *names}]


def plan_of(condition: Condition, sensor: str, *, quick: bool = False) -> Plan:
    """Return the plan of a condition: the touches of every other one.

    A `quick` plan has but `QUICK_GRID` touches of one object held, and of one sliding.

    Examples
    --------
    >>> plan_of(CONDITIONS[1], "prototype").deviation.distortion
    0.001
    """
    plan = load_plan(PLAN, [f"sensor={sensor}"])
    groups = list(plan.groups)
    if quick:
        first = {group.protocol: replace(group, grid=QUICK_GRID) for group in reversed(groups)}
        groups = list(reversed(first.values()))
    if condition.motors:
        groups = [replace(group, motors="synthetic") for group in groups]
    if condition.material:
        groups = [replace(group, material=condition.material) for group in groups]
    if condition.second:
        groups = [replace(group, second=condition.second) for group in groups]
    if condition.builds:
        groups = _spread(groups, condition.builds)
    return replace(plan, groups=tuple(groups), deviation=condition.deviation)


def render_suite(
    conditions: Sequence[Condition],
    sensor: str,
    folder: Path,
    *,
    seed: int = 0,
    quick: bool = False,
    workers: int | None = None,
    progress: Progress = lambda *_: None,
) -> dict[str, Path]:
    """Return the folder with the sessions of each condition, by its name; what exists is not rendered again.

    The folders' names depend on the plan, the seed and the code of the twin: a suite of other sounds never
    takes the sessions of this one.

    Parameters
    ----------
    conditions
        Of `CONDITIONS`.
    sensor
        A preset's name or a file.
    folder
        That holds these folders; made if missing.
    seed
        Random seed: of touches, surfaces and noise.
    quick
        Whether to render a few touches only.
    workers
        Processes; None for one a core.
    progress
        Called for each session.

    Raises
    ------
    InputError
        If the folder cannot be made, or the sensor cannot have a condition.
    """
    folders: dict[str, Path] = {}
    jobs: list[tuple[Assignment, Path]] = []
    for condition in conditions:
        plan = plan_of(condition, sensor, quick=quick)
        own = made_folder(folder.resolve() / f"{_slug(condition.name)}-{_key(plan, seed)}")
        folders[condition.name] = own
        jobs += [(session, own) for session in assignments(plan, seed)]
    with closing(run_all(jobs, _made, workers=workers)) as results:
        for done, _ in enumerate(results, start=1):
            progress("rendering", done, len(jobs))
    return folders


def _made(job: tuple[Assignment, Path]) -> CollectedSession:
    return make(*job)


def _spread(groups: Sequence[Group], builds: int) -> list[Group]:
    """Return the groups with each protocol's touches spread over all builds, a session for each."""
    seeds: dict[str, Iterator[int]] = {}
    result: list[Group] = []
    for group in groups:
        share = builds // sum(other.protocol == group.protocol for other in groups)
        own = seeds.setdefault(group.protocol, cycle(range(FIRST_BUILD, FIRST_BUILD + builds)))
        share = min(share, group.grid[0] * group.grid[1])
        result.append(replace(group, builds=tuple(next(own) for _ in range(share)), sessions=share))
    return result


def _slug(name: str) -> str:
    """Return a condition's name as that of a folder.

    >>> _slug("tuning -6 %"), _slug("+20 K")
    ('tuning_-6', '+20_k')
    """
    return "_".join(name.lower().replace("%", "").replace("/", "_").split())


def _key(plan: Plan, seed: int) -> str:
    """Return what the sound of a plan depends on, as a short text."""
    digest = hashlib.sha256(json.dumps([to_tree(plan), seed], sort_keys=True).encode())
    digest.update(_code())
    return digest.hexdigest()[:12]


@cache
def _code() -> bytes:
    """Return the SHA-256 of the code and presets that make sound."""
    package = Path(str(files("monochord")))
    digest = hashlib.sha256()
    for source in SOURCES:
        path = package / source
        for file in [path] if path.is_file() else sorted(path.rglob("*")):
            if file.suffix in (".py", ".toml"):
                digest.update(file.read_bytes())
    return digest.digest()
