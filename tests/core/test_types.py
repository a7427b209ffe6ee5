import dataclasses
import inspect
import math
import pickle

import numpy as np
import pytest

from monochord.core import types
from monochord.core.types import Estimate, StreamHealth, Window

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


def test_an_abstention_has_no_number_and_a_reason() -> None:
    estimate = Estimate.abstain("m", "silence")
    assert not estimate.valid
    assert math.isnan(estimate.value)
    assert math.isnan(estimate.std)
    assert (estimate.unit, estimate.why_not) == ("m", "silence")


def test_a_window_lasts_its_frames_over_its_rate() -> None:
    window = Window(samples=np.zeros((2, 4410), np.float32), start=0, sample_rate=44100)
    assert window.duration == 0.1


def test_one_streams_health_is_not_anothers() -> None:
    with pytest.raises(TypeError):
        StreamHealth().clock_offsets["realtime"] = 1.0  # pyright: ignore[reportIndexIssue]


def test_an_estimate_crosses_to_another_process() -> None:
    estimate = Estimate(value=0.2, std=0.001, unit="m")
    assert pickle.loads(pickle.dumps(estimate)) == estimate  # noqa: S301
