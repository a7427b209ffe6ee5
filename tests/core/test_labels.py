"""The label of a window follows from what is true in it, by the rules that the module states."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.labels import LabelTrack, Rules, one_window_labels, window_labels


def labels_of(
    columns: dict[str, np.ndarray], rate: float = 1000.0, rules: Rules | None = None
) -> dict[str, float]:
    """Labels of the window from 0 to 0.1 s."""
    time = np.arange(len(columns["contact"])) / rate
    labels = window_labels(
        LabelTrack(time=time, columns=columns), np.array([0.0]), np.array([0.1]), rules or Rules()
    )
    return {name: float(values[0]) for name, values in labels.items()}


def touched(share: float, count: int = 200) -> np.ndarray:
    return (np.arange(count) < share * 100).astype(float)


@pytest.mark.parametrize(
    ("share", "contact", "transition"),
    [
        (1.0, 1.0, 0.0),
        (0.9, 1.0, 0.0),
        (0.89, np.nan, 1.0),
        (0.11, np.nan, 1.0),
        (0.1, 0.0, 0.0),
        (0.0, 0.0, 0.0),
    ],
)
def test_a_window_is_touched_untouched_or_a_transition(
    share: float, contact: float, transition: float
) -> None:
    labels = labels_of({"contact": touched(share)})
    assert labels["contact"] == pytest.approx(contact, nan_ok=True)
    assert labels["transition"] == transition


def test_means_are_over_the_touched_part_alone_and_valid_in_contact_only() -> None:
    on = touched(0.95)
    columns = {"contact": on, "position": np.where(on > 0, 0.07, np.nan), "force": np.where(on > 0, 1.5, 0.0)}
    labels = labels_of(columns)
    assert labels["position"] == pytest.approx(0.07)
    assert labels["force"] == pytest.approx(1.5)
    assert labels["force_std"] == pytest.approx(0.0, abs=1e-7)
    for share in (0.5, 0.0):
        masked = labels_of({"contact": touched(share), "position": np.full(200, 0.07), "force": np.ones(200)})
        assert np.isnan([masked[name] for name in ("position", "force", "force_std", "slip")]).all()


def test_the_deviation_of_the_force_is_that_within_the_window() -> None:
    ramp = np.arange(200) / 100.0 + 5.0
    labels = labels_of({"contact": np.ones(200), "force": ramp})
    assert labels["force"] == pytest.approx(ramp[:100].mean())
    assert labels["force_std"] == pytest.approx(ramp[:100].std())


@pytest.mark.parametrize(
    ("share", "slip"), [(1.0, 1.0), (0.5, 1.0), (0.49, np.nan), (0.11, np.nan), (0.1, 0.0), (0.0, 0.0)]
)
def test_sliding_for_half_of_a_touch_is_slip(share: float, slip: float) -> None:
    labels = labels_of({"contact": np.ones(200), "slip": touched(share)})
    assert labels["slip"] == pytest.approx(slip, nan_ok=True)


@pytest.mark.parametrize("rate", [37.0, 100.0, 999.0, 7000.0])
def test_shares_are_of_time_whatever_the_rate_of_the_labels(rate: float) -> None:
    rng = np.random.default_rng(0)
    time = np.unique(np.concatenate([[0.0, 0.05], rng.uniform(0.0, 0.2, round(0.2 * rate))]))
    track = LabelTrack(
        time=time, columns={"contact": np.ones(time.size), "other": (time >= 0.05).astype(float)}
    )
    labels = window_labels(track, np.array([0.0]), np.array([0.1]))
    assert labels["other"][0] == pytest.approx(0.5)


def test_what_is_not_known_is_not_made_up() -> None:
    unknown = np.where(np.arange(200) < 11, np.nan, 1.0)
    labels = labels_of({"contact": unknown, "force": np.ones(200)})
    assert np.isnan(list(labels.values())).all()
    few = np.where(np.arange(200) < 9, np.nan, 1.0)
    assert labels_of({"contact": few, "force": np.ones(200)})["contact"] == 1.0
    holed = labels_of({"contact": np.ones(200), "force": unknown})
    assert holed["contact"] == 1.0
    assert np.isnan(holed["force"])


def test_a_label_holds_for_a_while_only() -> None:
    track = LabelTrack(time=np.array([0.0, 10.0]), columns={"contact": np.ones(2)})
    begin = np.array([0.0, 0.15, 5.0, 10.0, 11.0])
    labels = window_labels(track, begin, begin + 0.1)["contact"]
    assert labels == pytest.approx([1.0, np.nan, np.nan, 1.0, np.nan], nan_ok=True)


def test_no_labels_at_all_leave_everything_unknown() -> None:
    nothing = LabelTrack(time=np.zeros(0), columns={"contact": np.zeros(0), "force": np.zeros(0)})
    labels = window_labels(nothing, np.array([0.0]), np.array([0.1]))
    assert all(np.isnan(values).all() for values in labels.values())


def test_other_columns_are_means_whether_touched_or_not() -> None:
    assert labels_of({"contact": np.zeros(200), "settled": touched(0.3)})["settled"] == pytest.approx(0.3)


def test_labels_without_contact_or_out_of_order_are_refused() -> None:
    with pytest.raises(InputError, match="contact"):
        window_labels(LabelTrack(time=np.zeros(1), columns={"force": np.zeros(1)}), np.zeros(1), np.ones(1))
    back = LabelTrack(time=np.array([1.0, 0.0]), columns={"contact": np.ones(2)})
    with pytest.raises(InputError, match="order"):
        window_labels(back, np.zeros(1), np.ones(1))


@pytest.mark.parametrize("shares", [{"touched": 0.1}, {"still": 0.6}, {"known": 0.0}, {"hold": 0.0}])
def test_rules_that_contradict_themselves_are_refused(shares: dict[str, float]) -> None:
    with pytest.raises(InputError, match="|".join(shares)):
        Rules(**shares)


def test_a_window_alone_is_labelled_as_among_others() -> None:
    rng = np.random.default_rng(0)
    time = np.sort(rng.uniform(0.0, 5.0, 2000))
    contact = (np.sin(7.0 * time) > 0.0).astype(float)
    slip = (np.sin(31.0 * time) > 0.0).astype(float)
    slip[rng.random(time.size) < 0.05] = np.nan
    track = LabelTrack(time=time, columns={"contact": contact, "force": contact + 0.1 * time, "slip": slip})
    begin = np.arange(-0.2, 5.2, 0.013)
    together = window_labels(track, begin, begin + 0.1)
    for row, first in enumerate(begin.tolist()):
        expected = {name: float(v[row]) for name, v in together.items() if not np.isnan(v[row])}
        assert one_window_labels(track, first, first + 0.1) == pytest.approx(expected, abs=1e-6)
