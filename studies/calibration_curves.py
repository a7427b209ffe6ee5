"""What known touches are worth: errors of a calibrated model over their number, on sensors drawn by seed.

Each sensor is touched by one object at random places and forces: builds of the twin in the plausible world,
and those of two simulators of the tests that share no line with it. The first N touches are known, the last
`HELD_OUT` are scored, in windows where the uncalibrated model states the quantity. Every figure is the mean
over sensors of the difference to that model on the same windows. Extra trees are fitted to the same known
touches alone, on the model's features. `MARGIN` says when a difference counts as no loss.

``python -m studies.calibration_curves MODEL --builds 12 --most 150`` renders each sensor once, in a minute,
and keeps its windows in the scratch folder: another model needs some 20 s a sensor.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import TypeAlias

import click
import numpy as np
from scipy.special import stdtrit
from sklearn.ensemble import ExtraTreesRegressor
from studies._command import lines_of, main, progress_bar
from tests import beam_elements, finite_differences
from tests.finite_differences import HELD, REST, Take

from monochord import VirtualSensor
from monochord.core.types import Block, Floats, Indices
from monochord.datasets import BuildOptions, Dataset, build_dataset, open_dataset
from monochord.figures import style
from monochord.lab import run_all
from monochord.perception.model import Model, load, quantity
from monochord.perception.training import (
    Replayed,
    adapt,
    correctable,
    counting,
    read_in_turn,
    touches_of,
    with_residuals,
)
from monochord.perception.tuning import tension_estimator
from monochord.physics.sensors import load_sensor
from monochord.sessions import Description, SessionClock, SessionWriter

RATE, EVERY = 44100, 221
"""Samples a second, and samples from one label to the next."""
HELD_OUT = 50
NUMBERS = (1, 5, 10, 25, 50, 150, 500)
HEADS = ("position", "force")
UNITS = {"position": (1e3, "mm"), "force": (1.0, "N")}
LABELS = ("model", "calibrated", "extra trees alone")
COLUMNS = ("sensor", "builds", "touches", *LABELS, "calibrated - model", "calibrated - trees", "< 1 se")
"""Of the table: errors in mm or N, differences with the upper ends of their 95 % intervals, coverage."""
MARGIN = 0.05
"""A difference is a loss if its mean is above 0 and its upper end above this share of the error."""
Curves: TypeAlias = dict[str, dict[str, list[float]]]
"""By head and number of touches: the errors of `LABELS`, and the calibrated model's coverage."""
MATERIALS = ("plastic", "wood", "rubber", "brass_rod")


def of_twin(seed: int, touches: int) -> Take:
    """Return a take of a build of the twin in the plausible world, touched by one object."""
    random = np.random.default_rng(seed)
    twin = VirtualSensor("prototype", seed=seed, build=seed, day=seed, world="plausible")
    material = MATERIALS[seed % len(MATERIALS)]
    takes = [twin.advance(1.0)]
    for _ in range(touches):
        twin.press(random.uniform(0.05, 0.15), random.uniform(0.15, 2.0), material=material)
        takes.append(twin.advance(HELD + 0.1))
        twin.release()
        takes.append(twin.advance(REST))
    labels = {key: np.concatenate([label[key] for _, label in takes]) for key in (*HEADS, "contact")}
    sound = np.concatenate([each for each, _ in takes], axis=1).astype(np.float32)
    place, force, contact = (labels[key] for key in (*HEADS, "contact"))
    return Take(sound=sound, contact=contact, position=place, force=force)


SENSORS: Mapping[str, Callable[[int, int], Take]] = {
    "twin": of_twin,
    "finite_differences": finite_differences.take,
    "beam_elements": beam_elements.take,
}


def rendered(sensor: str, seed: int, touches: int, model: Model, scratch: Path) -> Dataset:
    """Return a sensor's windows, rendered unless they are there."""
    name = f"{sensor}_{seed}_{touches}"
    folder, part, file = (scratch / f"{name}.{kind}" for kind in ("dataset", "part", "mcap"))
    if not folder.exists():
        take = SENSORS[sensor](seed, touches + HELD_OUT)
        at, file = slice(None, None, EVERY), scratch / f"{name}.mcap"
        file.unlink(missing_ok=True)
        rmtree(part, ignore_errors=True)
        string = load_sensor("prototype").string
        about = Description(name=name, sample_rate=RATE, simulated=True, string=string)
        with SessionWriter(file, about, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
            writer.audio(Block(samples=take.sound, start=0, adc_time=0.0))
            columns = {key: getattr(take, key)[at].astype(np.float64) for key in (*HEADS, "contact")}
            off = columns["contact"] != 1.0
            columns |= {key: np.where(off, np.nan, columns[key]) for key in HEADS}
            columns["slip"] = np.where(off, np.nan, 0.0)
            writer.labels(np.arange(len(off)) * EVERY / RATE, columns)
        trained = model.definition
        options = BuildOptions(window=trained.window / RATE, hop=trained.hop / RATE)
        build_dataset([file], part, options, listen=tension_estimator(trained.string))
        part.rename(folder)
        file.unlink()
    return open_dataset(folder)


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A sensor's windows, and what the uncalibrated model makes of them."""

    dataset: Dataset
    replayed: Replayed
    rows: Indices
    features: Floats

    @classmethod
    def of(cls, model: Model, dataset: Dataset) -> "Recorded":
        """Return a sensor's windows, read in turn by the model."""
        replayed = read_in_turn(with_residuals(correctable(model)), dataset, np.arange(len(dataset)))
        counted = [counting(model.definition, head, dataset, replayed.outputs) for head in HEADS]
        rows = np.unique(np.concatenate(counted))
        batches = [model.prepared.extractor(dataset.batch(rows[k : k + 64])) for k in range(0, len(rows), 64)]
        features = np.concatenate(batches).astype(np.float64)
        return cls(dataset=dataset, replayed=replayed, rows=rows, features=features)

    def counted(self, model: Model, head: str) -> Indices:
        """Return the rows of windows that count for a head."""
        return counting(model.definition, head, self.dataset, self.replayed.outputs)

    def errors(self, model: Model, head: str, rows: Indices) -> tuple[Floats, Floats]:
        """Return the error of a model's estimate in windows, and its standard error, in SI units."""
        record, own = model.definition.heads[head], model.corrections.get(head)
        outputs = [self.replayed.outputs[row][head] for row in rows.tolist()]
        value, std = np.array([quantity(each, record, own) for each in outputs]).T
        if head == "position" and not (record.correction and record.correction.touches):
            std = np.hypot(std, model.definition.length_std * value)
        return value - self.dataset.label(head)[rows], std


def curves(model: Model, recorded: Recorded, numbers: Sequence[int]) -> Curves:
    """Return, by head and number, the mean errors of model, calibrated model and trees, and a coverage."""
    touch = touches_of(recorded.dataset)
    every = np.unique(touch[recorded.rows])
    rest, at = every[-HELD_OUT:], {row: k for k, row in enumerate(recorded.rows.tolist())}
    result: dict[str, dict[str, list[float]]] = {head: {} for head in HEADS}
    for number in numbers:
        known = np.isin(touch, every[: min(number, len(every) - HELD_OUT)])
        valid = {name: each & known for name, each in recorded.dataset.valid.items()}
        own = adapt(model, replace(recorded.dataset, valid=valid), replayed=recorded.replayed).model
        for head in HEADS:
            rows = recorded.counted(model, head)
            rows = rows[recorded.errors(model, head, rows)[1] <= model.definition.heads[head].task.limit]
            test, taught = rows[np.isin(touch[rows], rest)], rows[known[rows]]
            if not len(test):  # the object is too soft to be placed
                continue
            before, after = (recorded.errors(each, head, test) for each in (model, own))
            x = recorded.features
            trees = ExtraTreesRegressor(100, max_features=0.3, min_samples_leaf=2, random_state=0)
            label = recorded.dataset.label(head)
            guess = np.full(len(test), label[test].mean())
            if len(taught):
                trees.fit(x[[at[row] for row in taught.tolist()]], label[taught])
                guess = trees.predict(x[[at[row] for row in test.tolist()]])
            alone = guess - label[test]
            sizes = [float(np.abs(each).mean()) for each in (before[0], after[0], alone)]
            covered = float(np.mean(np.abs(after[0]) < after[1]))
            result[head][str(number)] = [*sizes, covered]
    return result


def _of_sensor(job: tuple[str, int], *, model: Model, numbers: Sequence[int], scratch: Path) -> Curves:
    dataset = rendered(*job, numbers[-1], model, scratch)
    return curves(model, Recorded.of(model, dataset), numbers)


@click.command(help=__doc__)
@click.argument("model", default="demo")
@click.option("--builds", type=click.IntRange(1), default=12, help="Sensors of each simulator.")
@click.option("--most", type=click.IntRange(1), default=150, help="Largest number of known touches.")
@click.option("--seed", type=int, default=47_000, help="First seed of the sensors.")
@click.option("--sensor", "only", multiple=True, type=click.Choice([*SENSORS]), help="Only these.")
@click.option("--workers", type=click.IntRange(1), help="Worker processes; by default one a core.")
@click.option("--scratch", type=click.Path(path_type=Path, file_okay=False), default=Path("calibration"))
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="JSON file of the figures.")
@click.option("--figure", type=click.Path(path_type=Path, dir_okay=False), help="PNG of the curves.")
def calibration_curves(
    model: str,
    builds: int,
    most: int,
    seed: int,
    only: tuple[str, ...],
    workers: int | None,
    scratch: Path,
    out: Path | None,
    figure: Path | None,
) -> None:
    """Render the sensors, calibrate the model with more and more touches, and print the table."""
    numbers = [each for each in NUMBERS if each <= most]
    scratch.mkdir(parents=True, exist_ok=True)
    jobs = [(sensor, seed + number) for number in range(builds) for sensor in only or SENSORS]
    work = partial(_of_sensor, model=load(model), numbers=numbers, scratch=scratch)
    done: dict[tuple[str, int], Curves] = {}
    with progress_bar("calibration") as progress:
        for job, result in run_all(jobs, work, workers=workers):
            done[job] = result
            progress(job[0], len(done), len(jobs))
    figures = {name: [done[job] for job in jobs if job[0] == name] for name in only or SENSORS}
    for head in HEADS:
        print(head, *lines_of(COLUMNS, rows_of(figures, head)), sep="\n")
    if out is not None:
        out.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    if figure is not None:
        _draw(figures, figure)


def _values(builds: Sequence[Curves], head: str, number: str) -> Floats:
    """Return the figures (builds, 4) of the sensors that have some."""
    return np.array([each[head][number] for each in builds if number in each[head]])


def rows_of(figures: Mapping[str, Sequence[Curves]], head: str) -> list[tuple[str, ...]]:
    """Return the table's rows: the model's error, and differences with the upper ends of their intervals."""
    factor = UNITS[head][0]
    rows: list[tuple[str, ...]] = []
    for sensor, builds in figures.items():
        for number in dict.fromkeys(number for each in builds for number in each[head]):
            values = _values(builds, head, number)
            before, after, trees, covered = values.T
            cells = [f"{factor * each.mean():.3f}" for each in (before, after, trees)]
            for off in (after - before, after - trees):
                deviation = off.std(ddof=1) if len(off) > 1 else np.nan
                upper = off.mean() + stdtrit(max(len(off) - 1, 1), 0.975) * deviation / len(off) ** 0.5
                lost = off.mean() > 0.0 and upper > MARGIN * before.mean()
                cells.append(f"{factor * off.mean():+.3f} to {factor * upper:+.3f}{'!' if lost else ''}")
            rows.append((sensor, str(len(values)), number, *cells, f"{100.0 * covered.mean():.0f} %"))
    return rows


def _draw(figures: Mapping[str, Sequence[Curves]], path: Path) -> None:
    """Draw the errors over the number of touches, a row for each head."""
    page = style.canvas(105.0)
    panels = page.subplots(len(HEADS), len(figures), squeeze=False, sharex=True)
    letters = iter("abcdef")
    for row, head in zip(panels, HEADS, strict=True):
        factor, unit = UNITS[head]
        for panel, (sensor, builds) in zip(row, figures.items(), strict=True):
            numbers = list(dict.fromkeys(number for each in builds for number in each[head]))
            values = [_values(builds, head, number) for number in numbers]
            for column, (label, colour) in enumerate(zip(LABELS, style.COLOURS, strict=False)):
                each = [factor * value[:, column] for value in values]
                means = [value.mean() for value in each]
                # As far as sensors differ from the model on each: a paired interval.
                off = [factor * (value[:, column] - value[:, 0]) for value in values]
                bars = [value.std() / len(value) ** 0.5 for value in off]
                x = [int(number) for number in numbers]
                panel.errorbar(x, means, bars, label=label, color=colour, fmt="o-", markersize=2.5, lw=1.0)
            panel.set_xscale("log")
            panel.set_ylim(0.0, 1.6 * factor * np.mean([value[:, 0].mean() for value in values]))
            style.dress(
                panel, next(letters), sensor.replace("_", " "), "known touches", f"error of {head} in {unit}"
            )
    style.key(page, panels[0][0])
    page.savefig(path)


if __name__ == "__main__":
    main(calibration_curves)
