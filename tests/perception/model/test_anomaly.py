"""Sound unlike that of the training: heads abstain with the reason, and no reference learns it."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Estimate, Window
from monochord.perception.model import Model, ModelState
from monochord.perception.model.anomaly import UNLIKE, AnomalyState, Detector, step
from monochord.perception.model.definition import DETECTOR, AnomalyRecord
from monochord.perception.model.network import Layers

Sound = Callable[..., Window]
REASONS = ("microphone 2 is silent", "two things seem to touch")
MEMORY = (2.0, 0.2)


def with_detector(
    model: Model,
    bias: tuple[float, ...],
    limit: float = 0.0,
    brief: tuple[str, ...] = (),
    contact_holds: tuple[str, ...] = (),
) -> Model:
    """Return a model whose detector has the same logits for every window."""
    record = AnomalyRecord(
        hidden=(4,), reasons=REASONS, memory=MEMORY, limit=limit, brief=brief, contact_holds=contact_holds
    )
    definition = dataclasses.replace(model.definition, known=record)
    shapes = {name: shape for name, shape in definition.shapes().items() if name.startswith(f"{DETECTOR}.")}
    weights = {name: np.zeros(shape, np.float32) for name, shape in shapes.items()}
    weights[f"{DETECTOR}.1.bias"][:] = bias
    return Model(definition=definition, weights={**model.weights, **weights})


@pytest.mark.parametrize(
    ("bias", "reason"),
    [
        ((0.0, 4.0, 0.0), REASONS[0]),
        ((0.0, 0.0, 4.0), REASONS[1]),
        ((0.0, 4.0, 4.0), UNLIKE),
    ],
)
def test_every_head_abstains_with_the_likely_reason(
    drawn: Model, sound: Sound, bias: tuple[float, ...], reason: str
) -> None:
    _, estimates = with_detector(drawn, bias).step(ModelState(), sound(0))
    assert {each.reason for each in estimates.values()} == {reason}
    assert set(estimates) == set(drawn.definition.heads)


def test_contact_is_estimated_beside_a_reason_that_leaves_it_right(drawn: Model, sound: Sound) -> None:
    expected = drawn.step(ModelState(), sound(0))[1]["contact"]
    for bias, reason in (((0.0, 4.0, 0.0), REASONS[0]), ((0.0, 0.0, 4.0), REASONS[1])):
        model = with_detector(drawn, bias, contact_holds=REASONS[1:])
        estimates = model.step(ModelState(), sound(0))[1]
        withheld = Estimate.abstain("", reason)
        assert str(estimates["contact"]) == str(expected if reason == REASONS[1] else withheld)
        assert {each.reason for name, each in estimates.items() if name != "contact"} == {reason}
        silence = dataclasses.replace(sound(0), samples=np.zeros_like(sound(0).samples))
        assert not model.step(ModelState(), silence)[1]["contact"].valid
    misspelt = "two things seems to touch"
    with pytest.raises(InputError, match=misspelt):
        with_detector(drawn, (0.0, 0.0, 0.0), contact_holds=(misspelt,))
    with pytest.raises(InputError, match=misspelt):
        with_detector(drawn, (0.0, 0.0, 0.0), brief=(misspelt,))


@pytest.mark.parametrize("touched", [True, False])
def test_contact_abstains_where_it_denies_a_touch_that_the_reason_speaks_of(
    drawn: Model, sound: Sound, *, touched: bool
) -> None:
    model = with_detector(drawn, (0.0, 0.0, 4.0), brief=REASONS[1:])
    gate = model.definition.gate
    last = max(name for name in model.weights if name.startswith(f"{gate}.") and name.endswith("bias"))
    sure = np.full_like(model.weights[last], 60.0 if touched else -60.0)
    model = dataclasses.replace(model, weights={**model.weights, last: sure})
    contact = model.step(ModelState(), sound(0))[1][gate]
    assert (contact.valid, contact.reason) == ((True, "") if touched else (False, REASONS[1]))


def test_known_sound_is_estimated_as_without_a_detector(drawn: Model, sound: Sound) -> None:
    model = with_detector(drawn, (9.0, 0.0, 0.0))
    state, other = ModelState(), ModelState()
    for k in range(20):
        state, estimates = model.step(state, sound(k))
        other, expected = drawn.step(other, sound(k))
        assert str(estimates) == str(expected)
    assert state.median is not None
    np.testing.assert_array_equal(state.median, other.median)


def test_the_limit_decides(drawn: Model, sound: Sound) -> None:
    bias = (0.0, 1.0, 0.0)
    for limit, is_valid in ((1.0, False), (2.0, True)):
        _, estimates = with_detector(drawn, bias, limit).step(ModelState(), sound(0))
        assert estimates["contact"].valid is is_valid


def test_what_windows_say_is_averaged_over_time_whatever_the_hop() -> None:
    plain, odd = np.array([0.0, -6.0]), np.array([0.0, 6.0])
    for hop in (0.1, 0.01):
        state = AnomalyState()
        for k in range(round(5.5 / hop)):
            state = step(state, plain if k < round(5.0 / hop) else odd, k * hop, (0.5,))
        assert state.odds is not None
        assert state.odds[0] == pytest.approx(6.0 - 12.0 * np.exp(-1.0), abs=1e-3)
    forgetful = step(step(AnomalyState(), plain, 0.0, (0.0,)), odd, 0.1, (0.0,))
    assert forgetful.odds is not None
    assert forgetful.odds[0] == 6.0


def test_what_touched_windows_tell_stays_as_it_is_until_the_next_touch() -> None:
    record = AnomalyRecord(reasons=REASONS, memory=(2.0, 2.0), touched=REASONS[1:])
    nothing = Layers.of([0], [(np.zeros((3, 1), np.float32), np.zeros(3, np.float32))])
    detector = Detector(record=record, layers=nothing)
    said, state = np.array([0.0, -6.0, 6.0]), AnomalyState()
    for k in range(10):
        state = detector.step(state, said, 0.1 * k, touched=False)
    assert state.odds is not None
    assert state.odds == pytest.approx([-6.0, -10.0])
    averaged = list[float]()
    for k in range(10, 40):
        touched = k % 2 == 0
        state = detector.step(
            state, said if touched else np.array([0.0, 6.0, -6.0]), 0.1 * k, touched=touched
        )
        assert state.odds is not None
        averaged.append(state.odds[1])
    assert averaged == pytest.approx([6.0] * 30)
    with pytest.raises(InputError, match="two things seems to touch"):
        dataclasses.replace(record, touched=("two things seems to touch",))


@pytest.mark.parametrize("untouched", [0, 3])
def test_the_first_window_that_counts_says_no_more_than_others(untouched: int) -> None:
    counts, state = np.array([True]), AnomalyState()
    for k in range(-untouched, 0):
        state = step(state, np.zeros(2), 0.01 * k, (2.0,), ~counts)
    state = step(state, np.array([0.0, 6.0]), 0.0, (2.0,), counts)
    for k in range(1, 10):
        state = step(state, np.array([0.0, -6.0]), 0.01 * k, (2.0,), counts)
    assert state.odds is not None
    assert state.odds[0] == pytest.approx(-6.0 * 8.0 / 10.0, abs=0.05)


def test_another_stream_begins_without_what_was_said(drawn: Model, sound: Sound) -> None:
    model = with_detector(drawn, (0.0, 4.0, 0.0))
    state, _ = model.step(ModelState(), sound(5))
    again, _ = model.step(state, sound(0))
    assert again.anomaly.odds is not None
    np.testing.assert_array_equal(again.anomaly.odds, [4.0, 0.0])
    assert again.anomaly.time == 0.0


def test_unlike_sound_is_never_a_reference(drawn: Model, sound: Sound) -> None:
    model, state = with_detector(drawn, (0.0, 4.0, 0.0)), ModelState()
    for k in range(30):
        state, _ = model.step(state, sound(k))
    assert state.median is None
    assert not state.pending


@pytest.mark.parametrize(
    "options", [{"reasons": ()}, {"limit": float("nan")}, {"hidden": (4,) * 99}, {"memory": (1.0,)}]
)
def test_detectors_that_cannot_be(options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        AnomalyRecord(**{"reasons": REASONS, "memory": MEMORY, **options})  # pyright: ignore[reportArgumentType]
