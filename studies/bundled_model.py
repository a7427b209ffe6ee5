"""Make the bundled model from nothing: simulate, train the reader's networks, then the heads.

    python -m studies.bundled_model FOLDER
    python -m studies.bundled_model FOLDER --start src/monochord/perception/reader/network.safetensors

FOLDER receives all parts, each of which is kept, so an interrupted run continues. With `--start` the network
of single windows is kept, and the memory learns on. Three quarters of the builds train the reader: first its
network of single windows, then its memory, on what that network makes of every window. Sessions of the other
builds validate both, and train and calibrate the heads: to these the reader is as it is to an unknown sensor.
Networks and model replace those of the package.
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from shutil import copy2, rmtree
from typing import Any, TypeVar
from zlib import crc32

import click
import numpy as np
from safetensors.numpy import load_file, save_file
from studies._command import main, progress_bar
from studies._memory_training import Rows, read_rows, train_memory, write_rows
from studies._reader_sessions import Variant, record, sound_file
from studies._reader_training import read_examples, train_network, write_examples

import monochord as mc
from monochord.core.types import Audio, Floats
from monochord.datasets import Split, open_dataset
from monochord.lab import Assignment, assignments, collect, load_plan, run_all
from monochord.perception.model import bundled_folder
from monochord.perception.reader import FILE, ReaderNetwork
from studies import _memory_figures

PLANS: Mapping[str, tuple[str, ...]] = {"studies/plans/builds_3.toml": (), "studies/plans/grips.toml": ()}
"""Plans and their overrides."""
CORRECTIONS = '{force = ["position", "open - rest"]}'
"""What an unknown build and object add to the uncertainty, and what known touches take away again."""
READER, HEADS = 0.75, 0.88
"""Share of the builds up to which they train the reader's networks, and up to which they train heads."""
OFTEN = frozenset(
    {
        "slid",
        "slid_again",
        "slid_fast",
        "slid_far",
        "slid_smoothly",
        "slid_smoothly_again",
        "swung",
        "swayed",
        "swayed_rolling",
        "swung_by_motors",
        "led_by_force",
        "led_by_force_ideal",
        "left_alone",
        "left_alone_again",
        "swayed_again",
        "other_soft",
        "pressed_hard",
        "out_of_tune",
        "microphones_exchanged",
    }
)
"""Groups chosen twice as often: few windows have a force that swings, a place that moves, a hard press, or
what the memory forgets first."""
REPORTED = 250
"""Updates between two reports."""
LENGTH_STD = 0.0058
"""How far real strings are off their design's length where no ruler measured them: evenly within 1 %."""
VALIDATED = {"plain": None, "changed": 0}
"""Takes of a session that validate; as many train as is asked for."""
Job = TypeVar("Job")


def share_of(build: int, seed: int) -> float:
    """Return a random rank of a build, from 0 to 1; the same in all plans."""
    return float(np.random.default_rng((seed, build)).random())


def planned(plans: Mapping[str, Sequence[str]], seed: int) -> list[Assignment]:
    """Return the sessions of all plans in random order, so that the first of them are a fair sample."""
    every = [one for file, own in plans.items() for one in assignments(load_plan(file, list(own)), seed)]
    return [every[at] for at in np.random.default_rng(seed).permutation(len(every)).tolist()]


def in_turn(
    what: str, jobs: Sequence[Job], work: Callable[[Job], None], *, workers: int | None = None
) -> None:
    """Do each job, with a bar."""
    with progress_bar(what) as progress:
        for done, _ in enumerate(run_all(jobs, work, workers=workers), 1):
            progress(what, done, len(jobs))


def group_weights(groups: Sequence[str], rows: Rows) -> Floats:
    """Return how often each session (n,) is chosen: a group by the root of its windows."""
    windows = np.bincount(rows.session, minlength=len(groups))
    total = dict.fromkeys(groups, 0.0)
    for group, count in zip(groups, windows.tolist(), strict=True):
        total[group] += count
    sessions = {group: groups.count(group) for group in total}
    often = {group: 2.0 if group in OFTEN else 1.0 for group in total}
    return np.array([often[group] * np.sqrt(total[group]) / sessions[group] for group in groups])


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--sessions", default=100_000, help="Most sessions.")
@click.option("--count", default=100, show_default=True, help="Touched windows of a session for the reader.")
@click.option("--takes", default=2, show_default=True, help="Variants of a session, each changed otherwise.")
@click.option("--epochs", default=14, show_default=True, help="Passes of the network of single windows.")
@click.option("--updates", default=20_000, show_default=True, help="Updates of the memory.")
@click.option(
    "--start",
    type=click.Path(path_type=Path),
    help="Networks: that of windows is kept, the memory learns on.",
)
@click.option("--seed", default=0, show_default=True, help="Random seed.")
@click.option("--workers", type=int, help="Worker processes; by default one a core.")
@click.option("--only", type=click.Choice(("reader", "heads")), help="Make only the networks, or the heads.")
def command(
    folder: Path,
    *,
    sessions: int,
    count: int,
    takes: int,
    epochs: int,
    updates: int,
    start: Path | None,
    seed: int,
    workers: int | None,
    only: str | None,
) -> None:
    """Make the bundled model in FOLDER."""
    begin = time.monotonic()

    def report(what: str) -> None:
        print(f"{what}, after {(time.monotonic() - begin) / 60.0:.1f} min", flush=True)

    work = planned(PLANS, seed)[:sessions]
    if only != "heads":
        train_reader(
            folder,
            work,
            count=count,
            takes=takes,
            epochs=epochs,
            updates=updates,
            start=start,
            seed=seed,
            workers=workers,
            report=report,
        )
        copy2(folder / "network.safetensors", FILE)
    if only != "reader":
        train_heads(folder, work, seed=seed, workers=workers, report=report)


def train_reader(
    folder: Path,
    work: Sequence[Assignment],
    *,
    count: int,
    takes: int,
    epochs: int,
    updates: int,
    start: Path | None,
    seed: int,
    workers: int | None,
    report: Callable[[str], None],
) -> None:
    """Write the reader's networks, network.safetensors, and figures.json into a folder."""
    sounds, windows = folder / "sounds", folder / "windows"
    for each in (sounds, windows):
        each.mkdir(parents=True, exist_ok=True)
    in_turn("sessions", work, partial(record, folder=sounds), workers=workers)
    report(f"recorded {len(work)} sessions")
    heard = [one for one in work if share_of(one.build or 0, seed) < READER]
    unheard = [one for one in work if share_of(one.build or 0, seed) >= READER]
    taught = [Variant(file=sound_file(one, sounds), take=take) for one in heard for take in range(takes)]
    file = folder / "windows.safetensors"
    if not file.exists() and start:
        save_file(_network(load_file(start))._asdict(), file)
    elif not file.exists():
        make = partial(write_examples, folder=windows, count=count // takes, seed=seed)
        in_turn("windows", taught, make, workers=workers)
        examples = read_examples([variant.within(windows) for variant in taught])
        report(f"analysed {len(examples.kind)} windows")
        with progress_bar("epochs") as progress:

            def epoch(number: int, loss: float) -> None:
                progress("epochs", number, epochs)
                report(f"reader, epoch {number} of {epochs}: loss {loss:.3f}")

            network = train_network(examples, epochs=epochs, seed=seed, report=epoch)
        save_file(network._asdict(), file)
    arrays = load_file(file)
    tests = {
        name: [Variant(file=sound_file(one, sounds), take=take) for one in unheard]
        for name, take in VALIDATED.items()
    }
    target = folder / f"rows_{crc32(file.read_bytes()):08x}"
    target.mkdir(exist_ok=True)
    make = partial(write_rows, network=_network(arrays), folder=target, seed=seed)
    in_turn("rows", [*taught, *(each for own in tests.values() for each in own)], make, workers=workers)
    rows = Rows.joined([read_rows(variant.within(target)) for variant in taught])
    report(f"read {len(rows.contact)} windows with the reader")
    with progress_bar("updates") as progress:

        def update(number: int, loss: float) -> None:
            progress("updates", number, updates)
            if number % REPORTED == 0:
                report(f"memory, update {number} of {updates}: loss {loss:.3f}")

        weight = group_weights([one.group.name for one in heard for _ in range(takes)], rows)
        memory = train_memory(
            rows, weight, updates=updates, seed=seed, report=update, start=load_file(start) if start else None
        )
    save_file({**arrays, **memory}, folder / "network.safetensors")
    groups, result = [one.group.name for one in unheard], dict[str, Any]()
    for name, own in tests.items():
        told = [read_rows(variant.within(target)) for variant in own]
        result[name] = _memory_figures.figures(memory, told, groups)
        print(name, *_memory_figures.table(result[name]), sep="\n", flush=True)
    (folder / "figures.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    report("trained the memory")


def _network(arrays: Mapping[str, Audio]) -> ReaderNetwork:
    return ReaderNetwork(*(np.ascontiguousarray(arrays[name], np.float32) for name in ReaderNetwork._fields))


def train_heads(
    folder: Path,
    work: Sequence[Assignment],
    *,
    seed: int,
    workers: int | None,
    report: Callable[[str], None],
) -> None:
    """Train and calibrate the heads on sessions of builds that the reader has not heard."""
    unheard = [one for one in work if share_of(one.build or 0, seed) >= READER]
    data = folder / "heads_dataset"
    if not data.is_dir():
        folders = list[Path]()
        for plan in {one.plan.name: one.plan for one in unheard}.values():
            own = [one for one in unheard if one.plan.name == plan.name]
            folders.append(folder / "heads_sessions" / plan.name)
            with progress_bar("sessions") as progress:
                for done, _ in enumerate(collect(own, folders[-1], workers=workers), 1):
                    progress(plan.name, done, len(own))
        mc.build(folders, data, split="build", force=True, workers=workers)
        rmtree(folder / "heads_sessions")
        report(f"built a dataset of {len(unheard)} sessions")
    run = folder / "run"
    rmtree(run, ignore_errors=True)
    settings = [
        f"split={heads_split(data, unheard, seed)}",
        f"length_std={LENGTH_STD}",
        f"corrections={CORRECTIONS}",
        f"seed={seed}",
        'methods=["network"]',  # for builds of other worlds than those that validation has
    ]
    model = mc.train(data, run, config="reader", settings=settings, workers=workers)
    target = bundled_folder("demo")
    assert target is not None
    for file in (run / "model").iterdir():
        copy2(file, target / file.name)
    print(json.dumps(model.scores, indent=1))
    report("trained the heads")


def is_ordinary(session: Assignment) -> bool:
    """Return whether nothing about a session is a fault, and no two objects touch."""
    deviation, group = session.deviation, session.group
    faults = deviation.swapped, deviation.dead_microphone, deviation.dead_driver
    return not any((*faults, group.second, group.driver_dies, group.detuned))


def heads_split(data: Path, sessions: Sequence[Assignment], seed: int) -> Path:
    """Write the split of the heads' dataset: limits of faults are what ordinary sessions do not exceed."""
    dataset, own = open_dataset(data), {one.name: one for one in sessions}
    each = [own[part.name] for part in dataset.manifest.parts]
    share = np.array([share_of(one.build or 0, seed) for one in each])[dataset.session]
    ordinary = np.array([is_ordinary(one) for one in each])[dataset.session]
    rows = {
        "train": ordinary & (share < HEADS),
        "validation": ordinary & (share >= HEADS),
        "test": ~ordinary,
    }
    parts = {name: np.flatnonzero(each) for name, each in rows.items()}
    file = data.with_name("heads_split.json")
    Split(by="build", parts=parts, seed=seed, dataset=dataset.checksum).write(file)
    return file


if __name__ == "__main__":
    main(command)
