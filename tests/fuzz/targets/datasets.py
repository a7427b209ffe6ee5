"""Dataset folders: audited, and opened for training."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.fuzz.base import Input, Target, command, taken_from

from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.datasets.build import BuildOptions, build_dataset
from monochord.datasets.split import split_dataset
from monochord.datasets.store import open_dataset
from monochord.perception.training.examples import chosen, examples_of, read_split, training_data
from monochord.perception.training.settings import TrainingSettings
from monochord.sessions import Description, SessionClock, SessionWriter

RATE = 16000
FEATURE = {"name": "log_mel"}


class Fuzz(Target):
    """`monochord audit`, and what `monochord train` reads before its first step."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        files: list[Path] = []
        for number in range(4):
            random = np.random.default_rng(number)
            files.append(folder / f"take{number}.mcap")
            description = Description(
                name=f"take{number}", sample_rate=RATE, simulated=True, object="made", day=number
            )
            with SessionWriter(files[-1], description, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
                samples = np.round(random.uniform(-0.5, 0.5, (2, RATE // 5)), 1).astype(np.float32)
                writer.audio(Block(samples=samples, start=0, adc_time=0.0))
                time = np.arange(200) / 1000
                touched = (time > 0.1).astype(float)
                known = np.where(touched > 0.0, 0.0, np.nan)
                slides = (time > 0.15).astype(float) + known
                labels = {"contact": touched, "position": 0.1 + known, "force": 1.0 + known, "slip": slides}
                writer.labels(time, labels)
        dataset = build_dataset(files, folder / "dataset", BuildOptions(window=0.02, hop=0.02))
        for by in ("session", "time"):
            split_dataset(dataset, by=by, fractions=(0.5, 0.25, 0.25)).write(dataset.path / "split.json")
            yield taken_from(dataset.path)

    def run(self, folder: Path) -> None:
        refused: InputError | None = None
        try:
            command("audit", folder, "--json")
        except InputError as error:
            refused = error
        settings = replace(TrainingSettings(), dataset=folder, feature=FEATURE)
        dataset = open_dataset(folder)
        split = read_split(settings, dataset)
        source = training_data(settings, dataset, split)
        for name in ("train", "validation"):
            rows = split.parts[name]
            chosen(dataset, rows, source.tasks, name)
            examples = examples_of(source, rows, name)
            assert np.isfinite(examples.base).all(), "rows that are no numbers"
        if refused:
            raise refused
