"""Model folders: loaded, opened and asked for a prediction."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from tests.fuzz.base import Input, Target, taken_from

from monochord.core.types import Signal, Window
from monochord.perception.features import FEATURES
from monochord.perception.heads import HEADS
from monochord.perception.model import Definition, Model, ModelState, load
from monochord.perception.model.definition import FeatureRecord, HeadRecord
from monochord.perception.model.probe import probed
from monochord.perception.model.saving import TEXT, WEIGHTS

RATE, SIZE = 16000, 400
SIGNAL = Signal(sample_rate=RATE, channels=2)
OPTIONS = {"bins": 8}
HIDDEN = {"position": {"hidden": [3]}, "force": {"hidden": [3]}}


def drawn_model(folder: Path, *, heads: tuple[str, ...]) -> None:
    """Save a model whose weights were drawn, not learned."""
    random = np.random.default_rng(0)
    extractor = FEATURES.build("log_mel", OPTIONS).prepare(SIGNAL, SIZE)
    record = FeatureRecord(name="log_mel", options=OPTIONS, columns=extractor.columns)
    definition = Definition(
        title="drawn", sample_rate=RATE, channels=2, window=SIZE, hop=SIZE, feature=record, simulated=True,
        heads={name: HeadRecord(task=HEADS.build(name, HIDDEN.get(name)).task()) for name in heads},
    )  # fmt: skip
    weights = {
        name: random.normal(size=shape).astype(np.float32) for name, shape in definition.shapes().items()
    }
    weights["scaler.scale"][:] = 5.0
    weights["scaler.probe"] = probed(extractor, 2, SIZE)
    Model(definition=definition, weights=weights).save(folder)


class Fuzz(Target):
    """A definition and its weights, most often with the checksum that they then have."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        for number, heads in enumerate((("contact", "position", "force", "slip"), ("contact",))):
            drawn_model(folder / str(number), heads=heads)
            yield taken_from(folder / str(number))

    def fit(self, edited: Input) -> Input:
        try:
            tree = json.loads(edited[TEXT])
            tree["weights"] = hashlib.sha256(edited[WEIGHTS]).hexdigest()
            return {**edited, TEXT: json.dumps(tree).encode()}
        except (KeyError, ValueError, TypeError, RecursionError):
            return edited

    def run(self, folder: Path) -> None:
        model, state = load(folder), ModelState()
        model.check(SIGNAL)
        for number in range(3):
            samples = np.random.default_rng(number).normal(size=(2, SIZE)).astype(np.float32)
            state, _ = model.step(
                state, Window(samples=samples, start=number * SIZE, sample_rate=RATE, has_gap=False)
            )
