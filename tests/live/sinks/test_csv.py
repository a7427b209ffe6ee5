import csv
import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from tests.live.sinks.made import SIGNAL, update

from monochord.core.types import Estimate, Tracked
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.live.sinks.base import Run, Update
from monochord.live.sinks.csv import Csv

POSITION = Estimate(value=0.2275, std=2e-4, unit="m")


def rows(path: Path, *updates: Update) -> list[dict[str, str]]:
    with Csv(path=str(path)).open(Run(signal=SIGNAL)) as writer:
        for each in updates:
            writer.write(each)
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


def test_a_row_has_estimates_reasons_truth_and_counters(tmp_path: Path) -> None:
    force = Estimate.abstain("N", 'too "soft", says it')
    given = replace(
        update({"position": POSITION, "force": force}, {"position": 0.22}),
        tracked=Tracked(estimates={"position": Estimate(value=0.22, std=math.inf, unit="m")}),
        decided={"contact": True},
        adc_time=time.monotonic() - 100.0,
        events=(Event(name="contact", on=True, time=0.11, delay=0.0, confidence=0.9),),
        notes=tuple(
            Note(key=key, level="warning", sentence="", remedy="", since=0.0) for key in ("hum", "clipping")
        ),
    )
    (row,) = rows(tmp_path / "out.csv", given)
    assert abs(float(row.pop("stamp")) - (time.time() - 100.0)) < 60.0
    assert row == {
        "time": "0.01",
        "frequency": "",
        "position": "0.2275",
        "position_std": "0.0002",
        "valid": "1",
        "force": "",
        "force_std": "",
        "true_position": "0.22",
        "latency": "0.002",
        "dropped": "64",
        "gaps": "1",
        "xruns": "5",
        "skipped": "3",
        "position_why_not": "",
        "force_why_not": 'too "soft", says it',
        "true_contact": "",
        "true_slip": "",
        "true_force": "",
        "tracked_position": "0.22",
        "tracked_position_std": "",
        "tracked_force": "",
        "tracked_force_std": "",
        "decided_contact": "1",
        "decided_slip": "",
        "events": '[{"name": "contact", "on": true, "time": 0.11, "delay": 0.0, "confidence": 0.9}]',
        "notes": "hum clipping",
        "more": "",
    }


def test_what_the_first_window_had_no_column_for_is_not_lost(tmp_path: Path) -> None:
    hard = Estimate(value=3.5, std=0.5, unit="Pa")
    first, second = rows(
        tmp_path / "out.csv",
        update({"position": POSITION}),
        update({"position": POSITION, "hardness": hard}, {"force": 0.8}),
    )
    assert first["more"] == ""
    assert json.loads(second["more"]) == {
        "hardness": 3.5,
        "hardness_std": 0.5,
        "true_force": 0.8,
        "hardness_why_not": "",
    }


def test_numbers_survive_exactly(tmp_path: Path) -> None:
    values = np.random.default_rng(2).standard_normal(50)
    updates = [update({"position": Estimate(value=np.float64(v), std=math.inf, unit="m")}) for v in values]
    assert [float(row["position"]) for row in rows(tmp_path / "out.csv", *updates)] == values.tolist()
