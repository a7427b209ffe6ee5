import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.live.sinks.made import SIGNAL, update

from monochord.core.types import Estimate, Tracked
from monochord.live.health import Note
from monochord.live.sinks.base import Run, Update
from monochord.live.sinks.jsonl import Jsonl
from monochord.perception.watching import Condition

POSITION = Estimate(value=0.2275, std=2e-4, unit="m")
FREQUENCY = Estimate(value=169.2307692307692, std=0.05, unit="Hz")
CORE = ["time", "frequency", "position", "position_std", "valid", "why_not"]


def lines(path: Path, *updates: Update, everything: bool = True) -> list[dict[str, Any]]:
    with Jsonl(path=str(path), everything=everything).open(Run(signal=SIGNAL)) as writer:
        for each in updates:
            writer.write(each)
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def test_the_position_alone(tmp_path: Path) -> None:
    (line,) = lines(
        tmp_path / "out.jsonl",
        update({"frequency": FREQUENCY, "position": POSITION, "force": POSITION}, {"position": 0.2}),
        everything=False,
    )
    assert list(line) == CORE
    assert line == {
        "time": 0.01,
        "frequency": 169.2307692307692,
        "position": 0.2275,
        "position_std": 2e-4,
        "valid": True,
        "why_not": "",
    }


def test_an_abstention_has_nulls_and_its_reason(tmp_path: Path) -> None:
    silent = {"frequency": Estimate.abstain("Hz", "silence"), "position": Estimate.abstain("m", "silence")}
    (line,) = lines(tmp_path / "out.jsonl", update(silent), everything=False)
    assert line == {**dict.fromkeys(CORE), "time": 0.01, "valid": False, "why_not": "silence"}


def test_a_frequency_may_be_known_without_a_position(tmp_path: Path) -> None:
    estimates = {"frequency": FREQUENCY, "position": Estimate.abstain("m", "below the open string")}
    (line,) = lines(tmp_path / "out.jsonl", update(estimates))
    assert line["frequency"] == FREQUENCY.value
    assert line["position"] is None
    assert line["why_not"] == "below the open string"


def test_everything_else_beside_it(tmp_path: Path) -> None:
    force = Estimate(value=0.8, std=math.inf, unit="N")
    estimates = {"frequency": FREQUENCY, "position": POSITION, "force": force}
    truth = {"contact": 1.0, "position": 0.228, "force": math.nan}
    (line,) = lines(tmp_path / "out.jsonl", update(estimates, truth))
    assert list(line)[:6] == CORE
    assert line["force"] == 0.8
    assert line["force_std"] is None
    assert line["frequency_std"] == 0.05
    assert (line["true_contact"], line["true_position"], line["true_force"]) == (1.0, 0.228, None)
    assert (line["latency"], line["dropped"], line["gaps"], line["xruns"], line["skipped"]) == (
        0.002,
        64,
        1,
        5,
        3,
    )


def test_what_is_followed_over_time_too(tmp_path: Path) -> None:
    sound = replace(
        update({"position": POSITION}),
        tracked=Tracked(estimates={"position": POSITION}),
        decided={"slip": True},
    )
    pitch = Condition(open_frequency=Estimate(value=322.4, std=0.5, unit="Hz"), deviation=0.03)
    note = Note(key="hum", level="error", sentence="Hum.", remedy="Look.", since=0.0)
    told = replace(sound, notes=(note,), condition=pitch)
    line, early, other = lines(
        tmp_path / "out.jsonl", told, replace(sound, condition=Condition()), replace(sound, condition=None)
    )
    names = ("open_frequency", "open_frequency_std", "open_frequency_deviation")
    assert [line[name] for name in names] == [322.4, 0.5, 0.03]
    assert [early[name] for name in names] == [None] * 3
    assert not {*names} & {*other}
    assert (line["tracked_position"], line["tracked_position_std"]) == (0.2275, 2e-4)
    assert (line["decided_slip"], line["events"], line["notes"]) == (True, [], ["hum"])


def test_numbers_survive_exactly(tmp_path: Path) -> None:
    values = np.random.default_rng(2).standard_normal(50)
    updates = [update({"position": Estimate(value=np.float64(v), std=0.1, unit="m")}) for v in values]
    assert [line["position"] for line in lines(tmp_path / "out.jsonl", *updates)] == values.tolist()


def test_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    with Jsonl().open(Run(signal=SIGNAL)) as writer:
        writer.write(update({"position": POSITION}))
        assert json.loads(capsys.readouterr().out)["position"] == 0.2275
