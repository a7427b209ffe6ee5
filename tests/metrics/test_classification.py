"""Counts and shares agree with exact fractions; chance is one half where it should be."""

import json
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.metrics import accuracy, balanced_accuracy, confusion

GOLDEN = json.loads(Path(__file__).with_name("golden.json").read_text(encoding="utf-8"))
TRUTH = np.array(GOLDEN["rows"]["kind"]) == 1
SAID = np.array(GOLDEN["rows"]["probability"]) >= 0.5


def test_golden() -> None:
    assert confusion(TRUTH, SAID).tolist() == GOLDEN["expected"]["confusion"]
    for metric in (accuracy, balanced_accuracy):
        result = metric(TRUTH, SAID)
        assert result == pytest.approx(GOLDEN["expected"][metric.__name__], rel=0, abs=1e-12)


def test_perfect_and_reversed() -> None:
    assert accuracy(TRUTH, TRUTH) == balanced_accuracy(TRUTH, TRUTH) == 1.0
    assert accuracy(TRUTH, ~TRUTH) == balanced_accuracy(TRUTH, ~TRUTH) == 0.0


def test_always_no_is_chance_where_it_is_balanced() -> None:
    rare = np.arange(100) < 3
    assert accuracy(rare, np.zeros(100, bool)) == 0.97
    assert balanced_accuracy(rare, np.zeros(100, bool)) == 0.5


def test_numbers_0_and_1_will_do() -> None:
    assert accuracy(TRUTH.astype(float), SAID) == accuracy(TRUTH, SAID)  # pyright: ignore[reportArgumentType]


def test_what_is_no_yes_and_no_no_is_refused() -> None:
    with pytest.raises(InputError, match=r"0\.5 in estimate: allowed is 0 and 1"):
        accuracy(np.array([1, 0]), np.array([1.0, 0.5]))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="not finite"):
        confusion(np.array([1.0, np.nan]), np.array([1, 0]))  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="yes throughout: allowed is both"):
        balanced_accuracy(np.ones(3, bool), np.ones(3, bool))
    with pytest.raises(InputError, match="no throughout"):
        balanced_accuracy(np.zeros(3, bool), np.ones(3, bool))
    with pytest.raises(InputError, match="one dimension, the same length"):
        accuracy(np.ones(3, bool), np.ones(2, bool))
