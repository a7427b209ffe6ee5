"""Results whose scores are known: touches drawn at random, and the estimates of an oracle."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monochord.datasets.store import Dataset, open_dataset
from monochord.evaluation.replay import Selection
from monochord.evaluation.results import Results, Trial
from monochord.physics.sensors import load_sensor

Oracle = Callable[..., Results]
STRING = load_sensor("prototype").string
SESSIONS, WINDOWS, HOP = 6, 200, 0.1


def truth_of(session: int) -> dict[str, np.ndarray]:
    """A touch of 1.5 s in every 2 s, the first at 0.5 s, each with its position and force; odd ones slide."""
    draw = np.random.default_rng(session)
    number = np.arange(WINDOWS) // 20
    contact = (np.arange(WINDOWS) % 20 >= 5).astype(float)
    onset = np.arange(WINDOWS) % 20 == 5
    contact[onset] = np.nan
    touched = np.where(contact == 1.0, 0.0, np.nan)
    slip = touched + number % 2
    return {
        "contact": contact,
        "transition": onset.astype(float),
        "position": touched + draw.uniform(0.05, 0.15, 10)[number],
        "force": touched + draw.uniform(0.1, 2.0, 10)[number],
        "slip": slip,
        "slip_across": np.where(slip == 1.0, 0.01, touched),
        "slip_along": touched,
        "settled": np.where(onset, 0.0, 1.0),
    }


def oracle(*, objects: tuple[str, ...] = ("plastic",) * SESSIONS, spread: float = 0.0) -> Results:
    """Results whose every estimate is the truth, plus normal errors of `spread` standard errors."""
    truth = [truth_of(session) for session in range(len(objects))]
    joined = {name: np.concatenate([each[name] for each in truth]) for name in truth[0]}
    draw = np.random.default_rng(99)
    stds = {"contact": 0.01, "slip": 0.01, "position": 1e-3, "force": 0.05}
    size = len(joined["contact"])
    filled = {"contact": np.nan_to_num(joined["contact"], nan=1.0), "slip": joined["slip"]}
    value = filled | {name: joined[name].copy() for name in ("position", "force")}
    for name in ("position", "force"):
        value[name] += spread * stds[name] * draw.normal(size=size)
    return Results(
        estimator="oracle",
        window=0.1,
        hop=HOP,
        trials=tuple(
            Trial(session=f"take{number}", object=body, day=number % 3, build=1, simulated=True)
            for number, body in enumerate(objects)
        ),
        trial=np.repeat(np.arange(len(objects), dtype=np.int32), WINDOWS),
        start=np.tile(HOP * np.arange(WINDOWS, dtype=np.float64), len(objects)),
        usable=np.ones(size, bool),
        truth=joined,
        value=value,
        std={name: np.where(np.isnan(value[name]), np.nan, stds[name]) for name in value},
        reason_index={name: np.isnan(value[name]).astype(np.int16) for name in value},
        reasons=("", "no contact"),
    )


@pytest.fixture(name="oracle", scope="session")
def _oracle() -> Oracle:
    """Return the function that makes an oracle's results."""
    return oracle


@pytest.fixture(scope="session")
def sessions(small: Path) -> tuple[Path, ...]:
    """Two sessions of the twin: touches at rest, touches that slide."""
    return small / "hold_000.mcap", small / "slide_000.mcap"


@pytest.fixture(scope="session")
def dataset(small: Path) -> Dataset:
    """Return the dataset of these sessions."""
    return open_dataset(small / "dataset")


def selection(dataset: Dataset, rows: np.ndarray | None = None) -> Selection:
    """Return rows of a dataset, or all of it, as sound of the prototype's string."""
    return Selection(dataset=dataset, rows=np.arange(len(dataset)) if rows is None else rows, string=STRING)
