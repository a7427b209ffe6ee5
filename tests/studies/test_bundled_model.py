"""The bundled model from nothing: which builds teach what, and the export of the reader's network."""

from pathlib import Path

import numpy as np
import pytest

from monochord.lab import assignments, load_plan
from monochord.perception.reader import CELLS, CHANNELS, KINDS, POSITIONS
from monochord.perception.reader.network import logits

pytest.importorskip("torch")

from studies._reader_training import Examples, train_network
from studies.bundled_model import HEADS, PLANS, READER, share_of

ROOT = Path(__file__).parents[2]


def test_a_build_teaches_the_reader_or_the_heads_in_all_plans() -> None:
    share = np.array([share_of(build, 0) for build in range(6001, 6301)])
    assert np.mean(share < READER) == pytest.approx(READER, abs=0.06)
    assert np.mean(share >= HEADS) == pytest.approx(1.0 - HEADS, abs=0.06)
    plans = [load_plan(str(ROOT / file), list(sets)) for own in PLANS.values() for file, sets in own.items()]
    sealed = load_plan(str(ROOT / "studies/plans/sealed_8.toml"))
    trained = {one.build for plan in plans for one in assignments(plan, 0)}
    assert not trained & {one.build for one in assignments(sealed, 0)}


def test_the_network_learns_and_runs_as_a_kernel() -> None:
    """Touched windows have a loud line in a cell that moves with the position; untouched ones have none."""
    random = np.random.default_rng(0)
    position = np.where(random.random(2048) < 0.7, random.uniform(0.2, 0.8, 2048), np.nan)
    cells = random.integers(0, 30, (2048, CHANNELS, CELLS)).astype(np.uint8)
    for window, place in zip(cells, position, strict=True):
        if np.isfinite(place):
            for channel, share in enumerate((place, 1.0 - place)):
                cell = round(np.log(1.0 / share / 0.3) / 0.003)
                window[[channel, 2 + channel], cell - 1 : cell + 2] = 255
    examples = Examples(cells=cells, position=position, kind=np.zeros(2048, np.int64))
    losses: list[float] = []
    network = train_network(examples, epochs=6, seed=0, report=lambda _, loss: losses.append(loss))
    assert losses[-1] < 0.8 * losses[0]
    outputs = np.array([logits(window.astype(np.float32) / 255.0, network) for window in cells[:20]])
    assert outputs.shape == (20, 1 + len(POSITIONS) + len(KINDS))
    assert np.isfinite(outputs).all()
