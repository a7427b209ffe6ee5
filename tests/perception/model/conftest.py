"""A model with weights that were drawn, not learned."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.types import Signal, Window
from monochord.perception.features import FEATURES
from monochord.perception.heads import HEADS
from monochord.perception.model import Definition, Model
from monochord.perception.model.definition import FeatureRecord, HeadRecord
from monochord.perception.model.probe import probed

Sound = Callable[..., Window]
RATE, SIZE = 8000, 800
SIGNAL = Signal(sample_rate=RATE, channels=2)


def record(count: int) -> FeatureRecord:
    options = {"count": count}
    columns = FEATURES.build("bands", options).prepare(SIGNAL, SIZE).columns
    return FeatureRecord(name="bands", options=options, columns=columns)


@pytest.fixture
def drawn(made_up_features: None) -> Model:
    """Return one of all heads."""
    heads = {name: HeadRecord(task=HEADS.build(name).task()) for name in HEADS.names()}
    heads["position"] = HeadRecord(task=heads["position"].task, offset=0.1, scale=1e-3)
    definition = Definition(
        title="drawn",
        sample_rate=RATE,
        channels=2,
        window=SIZE,
        hop=SIZE,
        feature=record(24),
        heads=heads,
        simulated=True,
    )
    rng = np.random.default_rng(0)
    weights = {
        name: rng.normal(size=shape, scale=shape[-1] ** -0.5).astype(np.float32)
        for name, shape in definition.shapes().items()
    }
    weights["scaler.mean"][:], weights["scaler.scale"][:] = 0.0, 5.0
    extractor = FEATURES.build("bands", {"count": 24}).prepare(SIGNAL, SIZE)
    weights["scaler.probe"] = probed(extractor, 2, SIZE)
    # So that some windows are untouched and some are not.
    rows = extractor(np.stack([made(k).samples for k in range(20)])) / 5.0
    logits = rows @ weights["contact.0.weight"][0]
    weights["contact.0.weight"] *= np.float32(3.0 / logits.std())
    weights["contact.0.bias"][0] = -3.0 * np.median(logits) / logits.std()
    return Model(definition=definition, weights=weights)


@pytest.fixture
def signal() -> Signal:
    """Return the signal that it is of."""
    return SIGNAL


@pytest.fixture
def sound() -> Sound:
    """Return what makes a window of two tones and some noise, by its number."""
    return made


def made(number: int, *, start: int | None = None, has_gap: bool = False) -> Window:
    """Return such a window."""
    rng, time = np.random.default_rng(number), np.arange(SIZE) / RATE
    tones = np.sin(2.0 * np.pi * np.outer(rng.uniform(200.0, 3000.0, 2), time))
    samples = (0.1 * tones + 0.01 * rng.normal(size=(2, SIZE))).astype(np.float32)
    return Window(
        samples=samples, start=number * SIZE if start is None else start, sample_rate=RATE, has_gap=has_gap
    )
