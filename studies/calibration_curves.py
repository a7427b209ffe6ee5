"""What known touches are worth: errors of a calibrated model over their number, on sensors drawn by seed.

Each sensor is touched by one object at random places and forces: builds of the twin in the plausible world,
and those of two simulators of the tests that share no line with it. The first N touches are known, the last
`HELD_OUT` are scored, in windows where the uncalibrated model states the quantity. Every figure is the mean
over sensors of the difference to that model on the same windows. Extra trees are fitted to the same known
touches alone, on the model's features.

``python -m studies.calibration_curves MODEL --most 150`` takes some minutes for each sensor.
"""

import json
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from sklearn.ensemble import ExtraTreesRegressor
from studies._command import lines_of, main, progress_bar
from tests import beam_elements, finite_differences
from tests.finite_differences import HELD, REST, Take

from monochord import VirtualSensor
from monochord.core.types import Block, Floats, Indices
from monochord.datasets import BuildOptions, Dataset, build_dataset
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
    "twin, plausible": of_twin,
    "finite differences": finite_differences.take,
    "beam elements": beam_elements.take,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A sensor's windows, and what the uncalibrated model makes of them: nothing is rendered again."""

    dataset: Dataset
    replayed: Replayed
    rows: Indices
    features: Floats

    @classmethod
    def of(cls, model: Model, take: Take, folder: Path, name: str) -> "Recorded":
        """Return a take's windows, read in turn by the model."""
        at, file = slice(None, None, EVERY), folder / f"{name}.mcap"
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
        listen = tension_estimator(trained.string)
        dataset = build_dataset([file], folder / f"{name}.dataset", options, listen=listen)
        reader = with_residuals(correctable(model))
        replayed = read_in_turn(reader, dataset, np.arange(len(dataset)))
        counted = [counting(trained, head, dataset, replayed.outputs) for head in HEADS]
        rows = np.unique(np.concatenate(counted))
        batches = [model.extractors[0](dataset.batch(rows[k : k + 64])) for k in range(0, len(rows), 64)]
        return cls(
            dataset=dataset, replayed=replayed, rows=rows, features=np.concatenate(batches).astype(np.float64)
        )

    def counted(self, model: Model, head: str) -> Indices:
        """Return the rows of windows that count for a head."""
        return counting(model.definition, head, self.dataset, self.replayed.outputs)

    def errors(self, model: Model, head: str, rows: Indices) -> tuple[Floats, Floats]:
        """Return the error of a model's estimate in windows, and its standard error, in SI units."""
        record, own = model.definition.heads[head], model.corrections.get(head)
        variables = 0 if own is None else len(own.centre) - 1
        outputs = [self.replayed.outputs[row][head] for row in rows.tolist()]
        outputs = [each._replace(variables=each.variables[:variables]) for each in outputs]
        value, std = np.array([quantity(each, record, own) for each in outputs]).T
        return value - self.dataset.label(head)[rows], std


def curves(model: Model, recorded: Recorded, numbers: Sequence[int]) -> dict[str, dict[str, list[float]]]:
    """Return, by head, each number's errors: of the model, and less of the calibrated and of extra trees."""
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
            before, after = (recorded.errors(each, head, test) for each in (model, own))
            x = recorded.features
            trees = ExtraTreesRegressor(100, max_features=0.3, min_samples_leaf=2, random_state=0)
            label = recorded.dataset.label(head)
            if not len(taught):
                continue
            trees.fit(x[[at[row] for row in taught.tolist()]], label[taught])
            alone = trees.predict(x[[at[row] for row in test.tolist()]]) - label[test]
            sizes = [float(np.abs(each).mean()) for each in (before[0], after[0], alone)]
            covered = float(np.mean(np.abs(after[0]) < after[1]))
            result[head][str(number)] = [*sizes, covered]
    return result


@click.command(help=__doc__)
@click.argument("model", default="demo")
@click.option("--builds", type=click.IntRange(1), default=3, help="Sensors of each simulator.")
@click.option("--most", type=click.IntRange(1), default=500, help="Largest number of known touches.")
@click.option("--seed", type=int, default=47_000, help="First seed of the sensors.")
@click.option("--sensor", "only", multiple=True, type=click.Choice([*SENSORS]), help="Only these.")
@click.option("--scratch", type=click.Path(path_type=Path, file_okay=False), default=Path("calibration"))
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="JSON file of the figures.")
@click.option("--figure", type=click.Path(path_type=Path, dir_okay=False), help="PNG of the curves.")
def calibration_curves(
    model: str,
    builds: int,
    most: int,
    seed: int,
    only: tuple[str, ...],
    scratch: Path,
    out: Path | None,
    figure: Path | None,
) -> None:
    """Render the sensors, calibrate the model with more and more touches, and print the table."""
    given = load(model)
    given = replace(given, definition=replace(given.definition, known=None))
    numbers = [each for each in NUMBERS if each <= most]
    scratch.mkdir(parents=True, exist_ok=True)
    figures: dict[str, list[dict[str, dict[str, list[float]]]]] = {}
    with progress_bar("calibration") as progress:
        for sensor, take in SENSORS.items():
            if only and sensor not in only:
                continue
            for number in range(builds):
                progress(sensor, number, builds)
                name = f"{sensor.replace(', ', '_').replace(' ', '_')}_{seed + number}_{most}"
                kept = scratch / f"{name}.pickle"
                if not kept.exists():
                    sound = take(seed + number, most + HELD_OUT)
                    kept.write_bytes(pickle.dumps(Recorded.of(given, sound, scratch, name)))
                recorded: Recorded = pickle.loads(kept.read_bytes())  # noqa: S301  (written above)
                figures.setdefault(sensor, []).append(curves(given, recorded, numbers))
    columns = ("sensor", "touches", "model", "calibrated", "trees", "< 1 se")
    for head in HEADS:
        print(head, *lines_of(columns, _rows(figures, head)), sep="\n")
    if out is not None:
        out.write_text(json.dumps(figures, indent=1), encoding="utf-8")
    if figure is not None:
        _draw(figures, figure)


def _rows(figures: Mapping[str, list[dict[str, dict[str, list[float]]]]], head: str) -> list[tuple[str, ...]]:
    """Return the table's rows: the model's error, the differences to it with their standard errors."""
    factor, unit = UNITS[head]
    rows: list[tuple[str, ...]] = []
    for sensor, builds in figures.items():
        for number in builds[0][head]:
            values = np.array([each[head][number] for each in builds])
            off = factor * (values[:, 1:3] - values[:, :1])
            se = off.std(axis=0, ddof=1) / len(off) ** 0.5 if len(off) > 1 else np.full(2, np.nan)
            pairs = zip(off.mean(axis=0), se, strict=True)
            differences = [f"{mean:+.3f} ({error:.3f}) {unit}" for mean, error in pairs]
            first = f"{factor * values[:, 0].mean():.3f} {unit}"
            rows.append((sensor, number, first, *differences, f"{100.0 * values[:, 3].mean():.0f} %"))
    return rows


def _draw(figures: Mapping[str, list[dict[str, dict[str, list[float]]]]], path: Path) -> None:
    """Draw the differences over the number of touches, a row for each head."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    drawing = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = drawing.subplots(len(HEADS), len(figures), squeeze=False, sharex=True)
    for row, head in zip(axes, HEADS, strict=True):
        factor, unit = UNITS[head]
        for axis, (sensor, builds) in zip(row, figures.items(), strict=True):
            values = np.array([[each[head][number] for number in each[head]] for each in builds])
            x = [int(number) for number in builds[0][head]]
            axis.axhline(0.0, color="0.5", linewidth=0.8)
            for column, label in ((1, "calibrated"), (2, "extra trees alone")):
                off = factor * (values[:, :, column] - values[:, :, 0])
                se = off.std(axis=0) / len(off) ** 0.5
                axis.errorbar(x, off.mean(axis=0), se, marker="o", markersize=3, label=label)
            axis.set_xscale("log")
            axis.set_title(f"{head}, {sensor}", fontsize=8)
            axis.set_ylabel(f"change of the mean error in {unit}", fontsize=7)
            worst = 1.5 * factor * values[:, :, 0].mean()
            axis.set_ylim(-worst, worst)
    axes[-1][0].set_xlabel("known touches")
    axes[0][0].legend(fontsize=7)
    drawing.savefig(path, dpi=150)


if __name__ == "__main__":
    main(calibration_curves)
