"""Results of an evaluation whose scores are known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monochord.evaluation.results import Results, Trial, write_results

Write = Callable[..., Path]
WINDOWS = 240


def made(
    *,
    objects: tuple[str, ...] = ("plastic", "wood"),
    noises: bool = True,
    simulated: bool = True,
    quiet: tuple[str, ...] = (),
    outliers: int = 0,
) -> Results:
    """Each trial is a third untouched, else touched at rest and sliding; estimates have known errors.

    The error is 1 mm and 0.05 N when clean, larger by 10^(-ratio / 20) times 10 in noise. Every tenth touched
    window has no estimate. Contact is right; slip is wrong in each fourth window. There are no estimates of
    what `quiet` names. The first `outliers` touched windows have positions far beyond the string.
    """
    kinds: list[tuple[str, float | None]] = [("", None)]
    kinds += [(noise, ratio) for noise in ("white", "hum") for ratio in (0.0, 10.0, 20.0)] if noises else []
    trials = [
        Trial(session=f"take {number}", object=body, noise=noise, ratio=ratio, simulated=simulated)
        for number, body in enumerate(objects)
        for noise, ratio in kinds
    ]
    count, index = len(trials), np.tile(np.arange(WINDOWS), len(trials))
    touched, sliding = index % 3 > 0, index % 3 == 2
    draw = np.random.default_rng(0)
    truth = {
        "contact": touched.astype(float),
        "position": np.where(touched, draw.uniform(0.05, 0.15, index.size), np.nan),
        "force": np.where(touched, draw.uniform(0.1, 2.0, index.size), np.nan),
        "slip": np.where(touched, sliding, np.nan),
    }
    worse = np.array([1.0 if t.ratio is None else 1.0 + 10.0 * 10.0 ** (-t.ratio / 20.0) for t in trials])
    off = worse.repeat(WINDOWS) * np.where(index % 2, 1.0, -1.0)
    silent = touched & (index % 10 == 0)
    value = {
        "contact": np.where(touched, 0.9, 0.2),
        "slip": np.where(sliding ^ (index % 4 == 0), 0.8, 0.1) + np.where(touched, 0.0, np.nan),
        "position": np.where(silent, np.nan, truth["position"] + 1e-3 * off),
        "force": np.where(silent, np.nan, truth["force"] + 0.05 * off),
    }
    value |= {name: np.full(index.size, np.nan) for name in quiet}
    value["position"][np.flatnonzero(np.isfinite(value["position"]))[:outliers]] = 5.0
    return Results(
        estimator="made_up",
        window=0.1,
        hop=0.1,
        trials=tuple(trials),
        trial=np.repeat(np.arange(count, dtype=np.int32), WINDOWS),
        start=np.tile(np.linspace(0.0, 23.9, WINDOWS), count),
        usable=np.ones(index.size, bool),
        truth=truth,
        value=value,
        std={name: np.full(index.size, np.nan) for name in value},
        reason_index={name: np.isnan(column).astype(np.int16) for name, column in value.items()},
        reasons=("", "no estimate"),
    )


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes such results into a file."""

    def into(**options: object) -> Path:
        file = tmp_path / "results.npz"
        write_results(made(**options), file)  # pyright: ignore[reportArgumentType]
        return file

    return into
