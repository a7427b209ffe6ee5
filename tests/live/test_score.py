import math
from typing import Any

import pytest
from tests.live.sinks.made import SIGNAL, window_update

from monochord.core.types import Estimate
from monochord.live import Scorer
from monochord.live.sinks.base import Run, Update

UNITS = {"position": "m", "force": "N"}


def update(
    given: dict[str, tuple[float, float] | None], truth: dict[str, float], time: float = 0.0
) -> Update:
    estimates = {
        name: Estimate.abstain(UNITS.get(name, ""), "silence")
        if pair is None
        else Estimate(value=pair[0], std=pair[1], unit=UNITS.get(name, ""))
        for name, pair in given.items()
    }
    return window_update(round(100 * time), estimates, truth=truth)


def test_settled_windows_with_a_touch_count() -> None:
    score = Scorer()
    touch = {"contact": 1.0, "position": 0.2, "settled": 1.0}
    with score.open(Run(signal=SIGNAL)) as writer:
        for position in (0.201, 0.197, 0.2, 0.21):
            writer.write(update({"position": (position, 0.0)}, touch))
        writer.write(update({"position": None}, touch))
        writer.write(update({"position": (0.5, 0.0)}, {**touch, "settled": 0.0}, 1.0))
        writer.write(update({"position": (0.5, 0.0)}, {"contact": 0.0}, 2.0))
        writer.write(update({"position": (0.5, 0.0)}, {}, 3.0))
    assert score.median_error() == pytest.approx(0.002)
    tree = score.tree()
    assert (tree["median_error"], tree["answered"], tree["abstained"]) == (pytest.approx(0.002), 4, 1)


def test_nothing_to_score() -> None:
    score = Scorer()
    score.write(update({"position": None}, {"contact": 1.0, "position": 0.2}))
    assert math.isnan(score.median_error())
    assert score.tree()["median_error"] is None
    assert "nan" not in " ".join(score.lines() + Scorer().lines())
    assert Scorer().tree() == {"median_error": None, "answered": 0, "abstained": 0}


def estimates_of(truth: dict[str, float], **wrong: Any) -> dict[str, tuple[float, float] | None]:
    """Return estimates that are the truth, but for some."""
    perfect: dict[str, tuple[float, float] | None] = {"contact": (truth["contact"], 0.0)}
    for name in ("position", "force", "slip"):
        perfect[name] = (truth[name], 0.01) if truth["contact"] else None
    return perfect | wrong


def session(score: Scorer, **wrong: Any) -> Scorer:
    """Play a second each of nothing, a touch at rest and one that slides, a window every 50 ms.

    The windows at 1 s and 1.05 s hold the touch's begin and have no label; that at 2 s holds the slide's.
    """
    for k in range(60):
        truth = {"contact": float(k >= 20), "settled": 1.0}
        if k >= 20:
            truth |= {"position": 0.1, "force": 1.0, "slip": float(k >= 40)}
        estimates = estimates_of(truth, **(wrong if k >= 20 else {}))
        for name in {20: truth, 21: truth, 40: ["slip"]}.get(k, ()):
            truth = {label: value for label, value in truth.items() if label != name}
        score.write(update(estimates, truth, 0.05 * k))
    return score


def test_a_perfect_estimator_has_a_perfect_score() -> None:
    tree = session(Scorer()).tree()
    assert (tree["contact_windows"], tree["position_windows"], tree["slip_windows"]) == (58, 38, 37)
    for name in ("contact_accuracy", "contact_area", "slip_accuracy", "slip_area"):
        assert tree[name] == 1.0
    for name in ("position_within_5mm", "force_within_0.2n", "position_coverage", "force_coverage"):
        assert tree[name] == 1.0
    assert (tree["position_mae"], tree["force_mae"]) == (0.0, 0.0)


def test_errors_and_abstentions_are_scored() -> None:
    score = session(Scorer(), position=(0.106, 0.002), force=None, slip=(0.9, 0.3), contact=(0.4, 0.5))
    tree = score.tree()
    assert (tree["contact_accuracy"], tree["contact_area"]) == (pytest.approx(20 / 58), 1.0)
    assert (tree["slip_accuracy"], tree["slip_area"]) == (pytest.approx(19 / 37), 0.5)
    assert (tree["position_mae"], tree["position_within_5mm"]) == (pytest.approx(0.006), 0.0)
    assert (tree["position_coverage"], tree["force_mae"]) == (0.0, None)
    assert (tree["position_told"], tree["position_right"]) == (1.0, 0.0)
    assert (tree["force_told"], tree["force_right"]) == (0.0, None)


def test_a_withheld_window_is_not_told_and_not_wrong() -> None:
    score = session(Scorer(), contact=None)
    tree, lines = score.tree(), score.lines()
    assert (tree["contact_told"], tree["contact_right"]) == (pytest.approx(20 / 58), 1.0)
    for name in ("position", "force", "slip"):
        assert (tree[f"{name}_told"], tree[f"{name}_right"]) == (1.0, 1.0)
    contact, position, force, slip = lines
    assert contact.startswith("contact  told in 34.5 % of 58 windows, of these 100.0 % right")
    assert "100.0 % right within 5 mm" in position
    assert "100.0 % right within 0.2 N" in force
    assert slip.startswith("slip     told in 100.0 %")
