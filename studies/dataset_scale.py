"""Time and memory of a dataset by its number of sessions: written, built, opened, and learned from.

Sessions are made up: half a second of noise at 8 kHz with a touch. They are written, built with split and
audit, opened, and ridge regression is trained on them: features, heads and calibration. Each step runs in a
process of its own, whose processor time and largest memory count. A thousand sessions take half a minute, and
a hundred thousand an hour and 10 GB of disk: ``python -m studies.dataset_scale FOLDER 1000 10000 100000``.
"""

import json
import multiprocessing
import resource
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import click
import numpy as np
from studies._command import lines_of, main, progress_bar

import monochord as mc
from monochord.core.errors import InputError
from monochord.perception.training import TrainingSettings, train
from monochord.sessions import SessionClock

RATE, SECONDS = 8000, 0.5
SENSOR = "long"
"""A preset whose string is read at this rate."""
A_FOLDER = 1000
"""Number of sessions in a folder."""
KIB, MB = 1024, 1e6


@click.command(name="dataset_scale")
@click.argument("folder", type=click.Path(path_type=Path))
@click.argument("counts", type=int, nargs=-1, required=True)
@click.option("--json", "numbers", type=click.Path(path_type=Path), help="File of the numbers.")
def dataset_scale(folder: Path, counts: Sequence[int], numbers: Path | None) -> None:
    """Measure datasets of COUNTS sessions, made in the new FOLDER."""
    if folder.exists():
        raise InputError(f"folder '{folder}', which already exists", "a new folder")
    heads = ("sessions", "step", "CPU s", "ms a session", "memory MB")
    rows: list[tuple[str, ...]] = []
    steps: dict[str, Callable[[Path, int], None]] = {
        "write": write,
        "build": build,
        "open": load,
        "ridge": ridge,
    }
    figures: list[dict[str, float | str]] = []
    with progress_bar("sessions") as report:
        for done, (count, (name, step)) in enumerate(product(counts, steps.items())):
            report(f"{name} {count} sessions", done, len(counts) * len(steps))
            seconds, memory = measured(step, folder / str(count), count)
            figures.append({"sessions": count, "step": name, "cpu": seconds, "memory": memory})
            each = 1e3 * seconds / count
            rows.append((str(count), name, f"{seconds:.1f}", f"{each:.2f}", f"{memory / MB:.0f}"))
    print("\n".join(lines_of(heads, rows)))
    if numbers is not None:
        numbers.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def measured(step: Callable[[Path, int], None], folder: Path, count: int) -> tuple[float, float]:
    """Return the processor time in s and the largest memory in bytes of a step in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(_cost, step, folder, count).result()


def _cost(step: Callable[[Path, int], None], folder: Path, count: int) -> tuple[float, float]:
    before = time.process_time()
    step(folder, count)
    return time.process_time() - before, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * float(KIB)


def write(folder: Path, count: int) -> None:
    """Write made-up sessions of two objects, seven days and a hundred builds."""
    for number in range(count):
        home = folder / "sessions" / str(number // A_FOLDER)
        home.mkdir(parents=True, exist_ok=True)
        rng = np.random.default_rng(number)
        about = mc.Description(
            name=f"{number}",
            sample_rate=RATE,
            object=("wood", "plastic")[number % 2],
            day=number % 7,
            build=number % 100,
            simulated=True,
        )
        sound = 0.1 * rng.standard_normal((2, round(SECONDS * RATE)))
        times = np.arange(round(100 * SECONDS)) / 100.0
        touched = times >= 0.4 * SECONDS
        labels = {
            "contact": touched.astype(float),
            "position": np.where(touched, rng.uniform(0.05, 0.15), np.nan),
            "force": np.where(touched, rng.uniform(0.1, 2.0), np.nan),
            "slip": np.where(touched, 0.0, np.nan),
        }
        clock = SessionClock(epoch_ns=10**18, origin=0.0)
        with mc.SessionWriter(home / f"take_{number}.mcap", about, clock) as session:
            session.audio(mc.Block(samples=sound.astype(np.float32), start=0, adc_time=0.0))
            session.labels(times, labels)


def build(folder: Path, _count: int) -> None:
    """Build a dataset, split it by session, and audit it, in one process."""
    mc.build(folder / "sessions", folder / "dataset", workers=1)


def load(folder: Path, _count: int) -> None:
    """Open the dataset, and read a window of every session."""
    dataset = mc.load_dataset(folder / "dataset").dataset
    for part in dataset.manifest.parts:
        dataset.window(part.first)


def ridge(folder: Path, _count: int) -> None:
    """Train ridge regression on the dataset, in one process."""
    settings = TrainingSettings.read(
        {
            "dataset": str(folder / "dataset"),
            "sensor": SENSOR,
            "methods": ["ridge"],
            "heads": {"contact": {}, "position": {}, "force": {}},
        }
    )
    train(settings, folder / "run", workers=1)


if __name__ == "__main__":
    main(dataset_scale)
