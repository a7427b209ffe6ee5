"""From answers to estimates: units, doubt, and when nothing is said."""

import dataclasses
import math

import pytest

from monochord.perception.model import Definition, Model
from monochord.perception.model.definition import Calibration
from monochord.perception.model.estimates import abstentions, amount, estimates, probability
from monochord.perception.model.network import Answer

SURE = Answer(value=9.0)


def answers(contact: float = 9.0, **others: Answer) -> dict[str, Answer]:
    usual = {name: Answer(value=0.0) for name in ("slip", "position", "force")}
    return {"contact": Answer(value=contact), **usual, **others}


def calibrated(definition: Definition, name: str, factor: float) -> Definition:
    record = dataclasses.replace(definition.heads[name], calibration=Calibration(factor=factor))
    return dataclasses.replace(definition, heads={**definition.heads, name: record})


def test_amounts_are_in_the_unit_of_their_label(drawn: Model) -> None:
    told = estimates(drawn.definition, answers(position=Answer(value=2.0, log_spread=math.log(3.0))))[
        "position"
    ]
    assert (told.value, told.unit, told.valid) == (pytest.approx(0.102), "m", True)
    assert told.std == pytest.approx(3e-3 * math.sqrt(2.0))


def test_calibration_scales_the_doubt_alone(drawn: Model) -> None:
    wider = calibrated(drawn.definition, "position", 2.5)
    before, after = (amount(SURE, each.heads["position"]) for each in (drawn.definition, wider))
    assert after == (before[0], pytest.approx(2.5 * before[1]))
    softer = calibrated(drawn.definition, "slip", 4.0)
    assert probability(Answer(value=4.0), softer.heads["slip"]) == pytest.approx(1.0 / (1.0 + math.exp(-1.0)))


def test_without_contact_there_is_nothing_to_locate(drawn: Model) -> None:
    told = estimates(drawn.definition, answers(contact=-0.1))
    assert {name for name, each in told.items() if each.why_not == "no contact"} == {
        "slip",
        "position",
        "force",
    }
    assert told["contact"].valid
    assert told["contact"].value == pytest.approx(0.475, abs=1e-3)


def test_too_much_doubt_is_an_abstention(drawn: Model) -> None:
    told = estimates(drawn.definition, answers(position=Answer(value=0.0, log_spread=math.log(50.0))))
    assert told["position"].why_not == "too unsure"
    assert told["contact"].valid


def test_so_many_windows_make_only_so_sure(drawn: Model) -> None:
    record = drawn.definition.heads["slip"]
    known = dataclasses.replace(record, calibration=Calibration(windows=98))
    assert probability(Answer(value=1e3), known) == pytest.approx(0.99)
    assert probability(Answer(value=-1e3), known) == pytest.approx(0.01)


@pytest.mark.parametrize("logit", [-1e9, 1e9])
def test_an_extreme_logit_is_a_probability(drawn: Model, logit: float) -> None:
    chance = probability(Answer(value=logit), drawn.definition.heads["slip"])
    assert chance == pytest.approx(float(logit > 0.0))


def test_all_heads_abstain_for_one_reason(drawn: Model) -> None:
    told = abstentions(drawn.definition, "gap")
    assert {each.why_not for each in told.values()} == {"gap"}
    assert told["force"].unit == "N"
