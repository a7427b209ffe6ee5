"""Make the bundled model from nothing: simulate, build, train the reader's network, then the heads.

    python -m studies.bundled_model FOLDER

takes 48 minutes on two cores, and 50 GB of disk. FOLDER receives the sessions of both plans, their
datasets, and the training run. Existing parts are kept, so an interrupted run continues. Three fifths of the
builds train the reader's network, these and another quarter the heads, and the others calibrate them. The
network and the model replace those of the package.
"""

import json
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from shutil import copy2, rmtree

import click
import numpy as np
from safetensors.numpy import save_file
from studies._command import main, progress_bar
from studies._reader_training import Examples, Job, examples_of, jobs_of, train_network

import monochord as mc
from monochord.core.types import StringParams
from monochord.core.units import Metres
from monochord.datasets import Dataset, Split, open_dataset
from monochord.lab import assignments, load_plan, run_all
from monochord.perception.model import bundled_folder
from monochord.perception.reader import FILE, Network
from monochord.physics.sensors import load_sensor

PLANS = {
    "ordinary": {"studies/plans/builds_2.toml": (), "studies/plans/edges.toml": ()},
    "odd": {"studies/plans/odd.toml": ("world=plausible",)},
}
"""Plans of ordinary touches and of faults, with their overrides; those of a name make one dataset."""
CORRECTIONS = '{force = ["position", "open - rest"]}'
"""What an unknown build and object add to the uncertainty, and what known touches take away again."""
READER, HEADS = 0.6, 0.85
"""Share of the builds up to which they train the reader's network, and up to which they train heads."""
SENSOR, LENGTH_STD = "prototype", 0.0058
"""The design, and how far real strings are off its length where no ruler measured them: evenly within 1 %."""


def plan_sessions(name: str, seed: int) -> dict[str, tuple[int, Metres]]:
    """Return the build and the true length of the string of each session of a name's plans, by session."""
    return {
        session.name: (session.build or 0, session.sensor().string.length)
        for file, overrides in PLANS[name].items()
        for session in assignments(load_plan(file, list(overrides)), seed)
    }


def share_of(build: int, seed: int) -> float:
    """Return a random rank of a build, from 0 to 1; the same in all plans."""
    return float(np.random.default_rng((seed, build)).random())


def reader_jobs(datasets: Mapping[str, Dataset], count: int, seed: int) -> list[Job]:
    """Return the windows of both datasets that train the reader's network."""
    design, jobs = load_sensor(SENSOR).string, list[Job]()
    for name, dataset in datasets.items():
        known = plan_sessions(name, seed)
        strings = dict[str, StringParams]()
        for part in dataset.manifest.parts:
            build, length = known[part.name]
            if share_of(build, seed) < READER:
                tension = (part.tension or design.tension) * (length / design.length) ** 2  # at its pitch
                strings[part.name] = replace(design, length=length, tension=tension)
        jobs += jobs_of(name, dataset, strings, count, seed)
    return jobs


def train_reader(folder: Path, *, count: int, epochs: int, seed: int, workers: int | None) -> Network:
    """Return the reader's network, trained on both datasets in a folder."""
    datasets = {name: open_dataset(folder / f"{name}_dataset") for name in PLANS}
    parts, jobs = list[Examples](), reader_jobs(datasets, count, seed)
    work = partial(examples_of, datasets=datasets, seed=seed)
    with progress_bar("windows") as progress:
        for done, (_, part) in enumerate(run_all(jobs, work, workers=workers), 1):
            progress("windows", done, len(jobs))
            parts.append(part)
    examples = Examples.joined(parts)
    with progress_bar("epochs") as progress:

        def report(epoch: int, loss: float) -> None:
            progress("epochs", epoch, epochs)
            print(f"reader, epoch {epoch} of {epochs}: loss {loss:.3f}", flush=True)

        return train_network(examples, epochs=epochs, seed=seed, report=report)


def heads_split(folder: Path, seed: int) -> Path:
    """Write the split of the ordinary dataset for the heads."""
    dataset, known = open_dataset(folder / "ordinary_dataset"), plan_sessions("ordinary", seed)
    share = [share_of(known[part.name][0], seed) for part in dataset.manifest.parts]
    own = np.array(share)[dataset.session]
    rows = {"train": own < HEADS, "validation": own >= HEADS, "test": own < 0.0}
    parts = {name: np.flatnonzero(each) for name, each in rows.items()}
    file = folder / "heads_split.json"
    Split(by="build", parts=parts, seed=seed, dataset=dataset.checksum).write(file)
    return file


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--count", default=90, show_default=True, help="Touched windows of a session for the reader.")
@click.option("--epochs", default=14, show_default=True, help="Passes of the reader's network.")
@click.option("--seed", default=0, show_default=True, help="Random seed.")
@click.option("--workers", type=int, help="Worker processes; by default one a core.")
@click.option("--heads-only", is_flag=True, help="Keep the package's reader.")
def command(
    folder: Path, *, count: int, epochs: int, seed: int, workers: int | None, heads_only: bool
) -> None:
    """Make the bundled model in FOLDER."""
    begin = time.monotonic()

    def report(what: str) -> None:
        print(f"{what}, after {(time.monotonic() - begin) / 60.0:.1f} min", flush=True)

    for name, plans in PLANS.items():
        sessions, dataset = folder / name, folder / f"{name}_dataset"
        if not dataset.is_dir():
            for file, overrides in plans.items():
                mc.collect(file, sessions / Path(file).stem, settings=overrides, seed=seed, workers=workers)
                report(f"collected {file}")
            folders = [sessions / Path(file).stem for file in plans]
            mc.build(folders, dataset, split="build", force=True, workers=workers)
            rmtree(sessions)
            report(f"built {name}")
    if not heads_only:
        network = train_reader(folder, count=count, epochs=epochs, seed=seed, workers=workers)
        save_file(network._asdict(), FILE)
        report("trained the reader")
    run = folder / "run"
    rmtree(run, ignore_errors=True)
    settings = [
        f"split={heads_split(folder, seed)}",
        f"length_std={LENGTH_STD}",
        f"corrections={CORRECTIONS}",
        f"seed={seed}",
        'methods=["network"]',  # for builds of other worlds than those that validation has
    ]
    model = mc.train(folder / "ordinary_dataset", run, config="reader", settings=settings, workers=workers)
    target = bundled_folder("demo")
    assert target is not None
    for file in (run / "model").iterdir():
        copy2(file, target / file.name)
    print(json.dumps(model.scores, indent=1))
    report("trained the heads")


if __name__ == "__main__":
    main(command)
