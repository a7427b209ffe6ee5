"""Scores on validation, and as a person reads them."""

import numpy as np
import pytest

from monochord.perception.heads import HEADS
from monochord.perception.training.scores import amount_scores, chance_scores, lines


def test_a_perfect_answer_scores_perfectly() -> None:
    truth = np.array([True, False, True, True])
    assert chance_scores(truth, truth.astype(float)) == {
        "windows": 4,
        "accuracy": 1.0,
        "auc": 1.0,
        "baseline_accuracy": 0.75,
    }
    label = np.linspace(0.0, 1.0, 5)
    found = amount_scores(label, label, 0.5)
    assert (found["mae"], found["r"], found["baseline_mae"]) == (0.0, pytest.approx(1.0), pytest.approx(0.3))


def test_a_person_reads_millimetres() -> None:
    tasks = {name: HEADS.build(name).task() for name in HEADS.names()}
    scores = {
        "position": amount_scores(np.array([0.1, 0.12]), np.array([0.101, 0.123]), 0.11),
        "slip": chance_scores(np.array([True, False]), np.array([0.9, 0.8])),
    }
    assert lines(scores, tasks) == [
        "  position   mean error 2 mm, r 1.000 (2 windows; the mean label: 10 mm)",
        "  slip       50.00 % right, area under the curve 1.0000 (2 windows; always the same: 50.0 %)",
    ]
