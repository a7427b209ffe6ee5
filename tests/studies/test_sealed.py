"""Groups of a sealed plan are scored apart and together, and models stand side by side."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from studies.sealed import HARD, LEAST, SLIP, SOFT, command, groups_of, row_of

from monochord.evaluation.results import Results, Trial, write_results

SESSIONS = ("hold_wood_000", "hold_felt_tip_000", "soft_felt_tip_000", "at_half_003")


def results(error: float) -> Results:
    """Two touched windows and an untouched one of each session: places off, one withheld."""
    count = 3 * len(SESSIONS)
    touched = np.tile([1.0, 1.0, 0.0], len(SESSIONS))
    place, stated = np.full(count, 0.1), np.full(count, 0.1 + error)
    stated[0] = np.nan
    trials = tuple(
        Trial(session=each, mount="bolted" if each == SESSIONS[0] else "soft", build=at, simulated=True)
        for at, each in enumerate(SESSIONS)
    )
    return Results(
        estimator="model",
        window=0.1,
        hop=0.1,
        trials=trials,
        trial=np.repeat(np.arange(len(SESSIONS)), 3).astype(np.int32),
        start=np.linspace(0.0, 0.1 * (count - 1), count),
        usable=np.ones(count, bool),
        truth={"contact": touched, "position": place, "force": place, "slip": 0.0 * place},
        value={"contact": touched, "position": stated, "force": place, "slip": 0.0 * place},
        std={"position": np.full(count, 1e-3), "force": np.full(count, 0.1)},
        reason_index={"position": np.zeros(count, np.int16)},
    )


def test_hard_and_soft_objects_are_told_apart() -> None:
    counted = {name: len(part) for name, part in groups_of(results(0.0))}
    assert counted[HARD] == 3
    assert counted[SOFT] == 6
    assert counted["at nodes"] == counted["at_half"] == 3
    assert counted[f"{HARD}, mount bolted"] == 3
    assert counted["all"] == 12


def test_models_stand_side_by_side(tmp_path: Path) -> None:
    for name, error in (("before", 0.02), ("demo", 0.001)):
        (tmp_path / name).mkdir()
        write_results(results(error), tmp_path / name / "results.npz")
    file = tmp_path / "rows.json"
    folders = [str(tmp_path / name) for name in ("demo", "before")]
    ran = CliRunner().invoke(command, [*folders, "--rows", str(file)], catch_exceptions=False)
    assert ran.exit_code == 0
    rows = {(row["condition"], row["model"]): row for row in json.loads(file.read_text())}
    assert rows["all", "demo"]["far_off"] == 0.0
    assert rows["all", "before"]["far_off"] == pytest.approx(7 / 8)
    assert rows["all", "demo"]["placed"] == pytest.approx(7 / 8)
    assert rows["all", "demo"]["position_mae_mm"] == pytest.approx(1.0)
    assert rows["hold_wood", "demo"]["told"] == rows["hold_wood", "demo"]["told_right"] == 1.0
    assert list(rows)[:2] == [(HARD, "demo"), (HARD, "before")]


@pytest.mark.parametrize("slid", [LEAST - 1, LEAST])
def test_an_area_is_told_of_enough_windows_that_slide(slid: int) -> None:
    count = 3 * LEAST
    one = Trial(session="hold_wood_000", build=0, simulated=True)
    slip = (np.arange(count) < slid).astype(float)
    heard = np.where(slip > 0.0, 0.9, np.where(np.arange(count) < count - 3, 0.1, SLIP + 0.01))
    row = row_of(
        "hold_wood",
        Results(
            estimator="model",
            window=0.1,
            hop=0.1,
            trials=(one,),
            trial=np.zeros(count, np.int32),
            start=np.linspace(0.0, 0.1 * (count - 1), count),
            usable=np.ones(count, bool),
            truth={"contact": np.ones(count), "slip": slip},
            value={"contact": np.ones(count), "slip": heard},
            std={},
            reason_index={},
        ),
        model="demo",
    )
    assert row["slip_auc"] == (None if slid < LEAST else 1.0)
    assert (row["slid"], row["slid_slip"]) == (slid, 1.0)
    assert row["held_slip"] == pytest.approx(3 / (count - slid), abs=1e-5)
