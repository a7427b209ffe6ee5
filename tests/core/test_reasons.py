"""Reasons: code asks by key, people read the sentence, and files keep the sentence."""

import copy
import csv
import io
import json
import math
import pickle
from typing import TypeVar

import msgspec
import numpy as np
import pytest

from monochord.core import reasons
from monochord.core.reasons import ABSTAINING, DetailedReason, Finding, Reason
from monochord.core.types import Estimate

T = TypeVar("T")
DETUNED = Reason.DETUNED.with_detail(4.12, "below", "its known pitch")


def sent(reason: T) -> T:
    """Return a reason as another process receives it."""
    return pickle.loads(pickle.dumps(reason))  # noqa: S301


def test_every_reason_is_found_by_its_sentence_and_no_two_share_one() -> None:
    assert len({each.value for each in Reason}) == len(Reason) == len(Reason.__members__)
    for each in Reason:
        assert Reason.of(each) is each
        assert Reason.of(str(each)) is each
    assert Reason.of("a moth on the string") is Reason.OTHER
    assert (Reason.OTHER.finding, bool(Reason.NONE), Reason.NONE.finding) == (ABSTAINING, False, None)


def test_a_reason_with_a_detail_keeps_its_key_and_its_numbers() -> None:
    assert Reason.of(DETUNED) is Reason.DETUNED
    assert DETUNED.detail == (4.12, "below", "its known pitch")
    assert "4.1 % below its known pitch" in DETUNED
    for again in (sent(DETUNED), copy.deepcopy(DETUNED)):
        assert (again, again.reason, again.detail) == (DETUNED, Reason.DETUNED, DETUNED.detail)
    assert sent(Reason.GAP) is copy.deepcopy(Reason.GAP) is Reason.GAP


@pytest.mark.parametrize("reason", [Reason.SILENCE, DETUNED])
def test_a_reason_is_its_sentence_wherever_it_is_written(reason: str) -> None:
    text = "".join(reason)
    estimate = Estimate.abstain("m", reason)
    assert estimate.reason is reason
    assert (estimate.reason == text, hash(reason), repr(reason)) == (True, hash(text), repr(text))
    assert str(estimate) == f"no answer: {text}"
    assert repr(estimate) == repr(Estimate.abstain("m", text))
    assert estimate.reason == Estimate.abstain("m", text).reason
    assert (f"{reason}", f"{reason:>80}", json.dumps([reason])) == (text, f"{text:>80}", json.dumps([text]))
    assert np.array([reason, "gap"], np.str_).tolist() == [text, "gap"]
    line = io.StringIO()
    csv.writer(line).writerow([reason])
    assert line.getvalue().strip() == text


def test_a_reason_in_own_words_stays_as_it_is() -> None:
    estimate = Estimate.abstain("m", "a moth on the string")
    assert (type(estimate.reason), estimate.reason) == (str, "a moth on the string")
    assert (
        Estimate(value=math.nan, std=math.nan, unit="m", valid=False, reason=np.str_("gap")).reason == "gap"
    )
    assert msgspec.json.encode(Estimate.abstain("m", Reason.GAP).reason) == b'"gap"'


def test_findings_say_what_to_do() -> None:
    findings = [each for each in vars(reasons).values() if isinstance(each, Finding)]
    findings += [each.finding for each in Reason if each.finding]
    assert len({each.key for each in findings}) > 20
    for each in findings:
        assert each.level in ("info", "warning", "error")
        assert all(text[0].isupper() and text.endswith(".") for text in (each.sentence, each.remedy))


def test_a_detail_is_refused_where_the_sentence_has_no_room_for_it() -> None:
    with pytest.raises(IndexError):
        Reason.DETUNED.with_detail(4.12)
    assert isinstance(Reason.FEW_WINDOWS.with_detail(3), DetailedReason)
