"""Faults: their log odds, their reasons, and which heads abstain."""

import dataclasses

import numpy as np
import pytest
from tests.twins import sound_of

import monochord as mc
from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.datasets.faults import FAULTS as SIMULATED
from monochord.perception.model import Model, ModelState
from monochord.perception.model.definition import FaultRecord
from monochord.perception.model.faults import (
    FAULTS,
    MAX_ODDS,
    NAMES,
    fault_reason,
    log_odds,
)
from monochord.perception.model.network import HeadOutput
from monochord.perception.model.stepping import WindowReading, estimates_in
from monochord.perception.reader import KINDS
from monochord.physics.twin.virtual_sensor import VirtualSensor

COUNT = len(NAMES)


def odds(**named: float) -> np.ndarray:
    """Return log odds of all faults, -6 but for those named with underscores."""
    values = np.full(COUNT, -6.0)
    for name, value in named.items():
        values[NAMES.index(name.replace("_", " "))] = value
    return values


def test_the_reader_tells_every_fault_and_those_of_windows_are_simulated() -> None:
    assert ("ordinary", *NAMES) == KINDS
    assert set(SIMULATED) <= set(NAMES)


def test_what_is_told_of_touches_alone_is_not_told_without_one() -> None:
    kinds = np.concatenate(([1.0], 1.0 + odds(driver_dead=6.0, hum=20.0)))
    assert log_odds(kinds, touched=True)[NAMES.index("driver dead")] == pytest.approx(6.0)
    untouched = log_odds(kinds, touched=False)
    assert untouched[NAMES.index("driver dead")] == -MAX_ODDS
    assert untouched[NAMES.index("hum")] == MAX_ODDS


def test_a_reason_is_that_of_the_fault_furthest_above_its_limit() -> None:
    limits = np.full(COUNT, 2.0)
    assert fault_reason(odds(hum=1.0), limits) is Reason.NONE
    assert fault_reason(odds(hum=3.0), limits) is Reason.HUM
    limits[NAMES.index("clipping")] = -5.0
    assert fault_reason(odds(hum=3.0, clipping=0.0), limits) is Reason.MOSTLY_CLIPPED


def outputs(contact: float, position: float = 0.0, certainty: float = 1.0) -> dict[str, HeadOutput]:
    others = {name: HeadOutput(value=0.0, log_spread=-3.0) for name in ("slip", "force")}
    place = HeadOutput(value=position, log_spread=-3.0, certainty=certainty)
    return {"contact": HeadOutput(value=contact), "position": place, **others}


@pytest.mark.parametrize(
    ("fault", "contact", "told"),
    [
        ("microphone 1 dead", 9.0, False),
        ("hum", 9.0, False),
        ("microphones swapped", 9.0, True),
        ("driver dead", -9.0, True),
        ("two touches", 9.0, True),
        ("two touches", -9.0, False),
    ],
)
def test_contact_is_told_beside_faults_that_leave_it_right(
    drawn: Model, fault: str, contact: float, *, told: bool
) -> None:
    reading = WindowReading(ModelState(), outputs(contact), FAULTS[fault].reason)
    estimates = estimates_in(drawn.prepared, reading)
    assert estimates["contact"].valid is told
    others = {each.reason for name, each in estimates.items() if name != "contact"}
    assert others == {FAULTS[fault].reason}


def test_outside_the_sensing_range_all_that_a_touch_tells_is_withheld(drawn: Model) -> None:
    model = dataclasses.replace(drawn, sensing_range=(0.05, 0.15))
    at = drawn.definition.heads["position"]
    ends = ((0.0499, ""), (0.0501, ""), (0.1499, ""), (0.1501, ""))  # they are off by less than 0.14 mm
    beyond = ((place, Reason.OUTSIDE_RANGE) for place in (0.03, 0.0497, 0.1503, 0.16))
    for place, reason in ((0.10, ""), *ends, *beyond):
        reading = WindowReading(ModelState(), outputs(9.0, (place - at.offset) / at.scale), "")
        estimates = estimates_in(model.prepared, reading)
        assert {estimates[name].reason for name in ("slip", "position", "force")} == {reason}
        assert estimates["contact"].valid
    # One touch there may sound like two.
    two = FAULTS["two touches"].reason
    reading = WindowReading(ModelState(), outputs(9.0, (0.16 - at.offset) / at.scale), two)
    assert estimates_in(model.prepared, reading)["position"].reason is Reason.OUTSIDE_RANGE


def with_certainty(drawn: Model) -> Model:
    """Return the model with a position that has to be certain by 0.9."""
    record = drawn.definition.heads["position"]
    task = dataclasses.replace(record.task, certain=0.9)
    heads = {**drawn.definition.heads, "position": dataclasses.replace(record, task=task)}
    return dataclasses.replace(drawn, definition=dataclasses.replace(drawn.definition, heads=heads))


def test_a_silent_driver_withholds_no_position_that_is_certain(drawn: Model) -> None:
    model, silent = with_certainty(drawn), FAULTS["driver dead"].reason
    for certainty, reason in ((0.95, ""), (0.85, silent)):
        reading = WindowReading(ModelState(), outputs(9.0, certainty=certainty), silent)
        estimates = estimates_in(model.prepared, reading)
        assert {estimates[name].reason for name in ("slip", "position", "force")} == {reason}
        assert estimates["contact"].valid


def test_force_is_withheld_with_a_position_that_is_not_certain(drawn: Model) -> None:
    model = with_certainty(drawn)
    for certainty, reason in ((0.95, ""), (0.85, Reason.TWO_CANDIDATES)):
        estimates = estimates_in(
            model.prepared, WindowReading(ModelState(), outputs(9.0, certainty=certainty), "")
        )
        assert {estimates[name].reason for name in ("position", "force")} == {reason}
        assert estimates["slip"].valid


def test_a_record_for_another_number_of_faults_is_refused() -> None:
    with pytest.raises(InputError, match=f"3 limits of faults.*{COUNT}"):
        FaultRecord(limits=(0.0, 0.0, 0.0))


def test_a_feature_without_kinds_tells_no_faults(drawn: Model) -> None:
    definition = dataclasses.replace(drawn.definition, faults=FaultRecord(limits=(1.0,) * COUNT))
    with pytest.raises(InputError, match="'kind ordinary'"):
        _ = definition.fault_columns


@pytest.mark.parametrize("build", [131, 300])
def test_a_touch_is_told_again_once_a_fault_has_passed(build: int) -> None:
    rate, place, begin, end = 44100, 0.08, 3.0, 5.0
    twin = VirtualSensor("prototype", seed=1, build=build, world="plausible")
    sound, _ = sound_of(twin, 1.5, (place, 1.0), 5.5, material="plastic")
    during = slice(round(begin * rate), round(end * rate))
    spoilt = {
        "clipped": np.clip(4.0 * sound / np.abs(sound).max(), -1.0, 1.0),
        "microphone 1": sound * np.array([[0.0], [1.0]], np.float32),
        "microphone 2": sound * np.array([[1.0], [0.0]], np.float32),
    }
    for name, bad in spoilt.items():
        take = sound.copy()
        take[:, during] = bad[:, during]
        told = [(each.time, each.position) for each in mc.listen(take, sample_rate=rate, sensor="prototype")]
        assert not any(x.valid for time, x in told if begin + 0.3 < time < end - 0.1), name
        after = [abs(float(x) - place) < 2e-3 for time, x in told if time > end + 0.3]
        assert np.mean(after) > 0.98, name
