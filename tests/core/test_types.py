import dataclasses
import inspect
import math
import pickle

import numpy as np
import pytest

from monochord.core import types
from monochord.core.types import Block, Estimate, StreamHealth, Window

NOUNS = [
    noun
    for _, noun in inspect.getmembers(types, inspect.isclass)
    if noun.__module__ == types.__name__ and dataclasses.is_dataclass(noun)
]


def test_every_noun_is_frozen_has_slots_and_takes_keywords_only() -> None:
    assert len(NOUNS) > 5
    for noun in NOUNS:
        assert getattr(noun, "__dataclass_params__").frozen, noun  # noqa: B009
        assert "__slots__" in vars(noun), noun
        assert all(field.kw_only for field in dataclasses.fields(noun)), noun


def test_nouns_with_arrays_are_found_in_lists() -> None:
    blocks = [Block(samples=np.zeros((2, 4), np.float32), start=start) for start in (0, 4)]
    assert blocks.index(blocks[1]) == 1
    assert len({*blocks}) == 2


def test_an_abstention_has_no_number_and_a_reason() -> None:
    estimate = Estimate.abstain("m", "silence")
    assert not estimate.valid
    assert math.isnan(estimate.value)
    assert math.isnan(estimate.std)
    assert (estimate.unit, estimate.reason) == ("m", "silence")


def test_a_window_lasts_its_frames_over_its_rate() -> None:
    window = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    assert window.duration == 0.1


def test_one_streams_health_is_not_anothers() -> None:
    with pytest.raises(TypeError):
        StreamHealth().clock_offsets["realtime"] = 1.0  # pyright: ignore[reportIndexIssue]


def test_an_estimate_crosses_to_another_process() -> None:
    estimate = Estimate(value=0.2, std=0.001, unit="m")
    assert pickle.loads(pickle.dumps(estimate)) == estimate  # noqa: S301


@pytest.mark.parametrize(
    ("estimate", "shown"),
    [
        (Estimate(value=0.0824, std=3e-4, unit="m"), "82.4 +- 0.3 mm"),
        (Estimate(value=0.5241, std=0.031, unit="N"), "0.52 +- 0.03 N"),
        (Estimate(value=0.0824, std=9.6e-5, unit="m"), "82.4 +- 0.1 mm"),
        (Estimate(value=1.234e-5, std=2e-7, unit="m"), "0.0123 +- 0.0002 mm"),
        (Estimate(value=1009.8, std=2.51, unit="Hz"), "1010 +- 3 Hz"),
        (Estimate(value=0.981, std=0.012, unit="1"), "0.98 +- 0.01"),
        (Estimate(value=0.12, std=math.inf, unit="m"), "120 +- ? mm"),
        (Estimate(value=0.12, std=0.0, unit="m"), "120 +- 0 mm"),
        (Estimate.abstain("m", "two candidates"), "no answer: two candidates"),
    ],
)
def test_an_estimate_is_shown_to_a_person(estimate: Estimate, shown: str) -> None:
    class Printer:
        text: str

    said = list[str]()
    printer = Printer()
    printer.text = said.append  # pyright: ignore[reportAttributeAccessIssue]
    estimate._repr_pretty_(printer, cycle=False)  # pyright: ignore[reportPrivateUsage]
    assert (str(estimate), f"{estimate}", said) == (shown, shown, [shown])
    assert repr(estimate).startswith("Estimate(value=")
    assert np.isclose(float(estimate), estimate.value, equal_nan=True)


def test_the_reason_by_its_older_name_warns() -> None:
    estimate = Estimate.abstain("m", "silence")
    with pytest.warns(DeprecationWarning, match=r"Estimate\.reason"):
        assert estimate.why_not == "silence"
    assert "why_not" not in {each.name for each in dataclasses.fields(estimate)}
