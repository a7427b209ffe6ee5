"""The model on streams: equal bits however it is fed, its outputs beside torch, and its estimates."""

import dataclasses
import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Estimates, Signal, Window
from monochord.perception.model import Definition, Model, ModelState
from monochord.perception.model.definition import Calibration
from monochord.perception.model.network import (
    HeadNetwork,
    HeadOutput,
    Scaling,
    estimates_of,
    network_inputs,
    probability,
    quantity,
)
from monochord.perception.training.examples import Examples
from monochord.physics.strings import load_string

Sound = Callable[..., Window]
CONFIDENT = HeadOutput(value=9.0)


def predict(model: Model, windows: Iterable[Window], state: ModelState | None = None) -> list[Estimates]:
    """Return the estimates of windows of one stream."""
    state, results = state or ModelState(), list[Estimates]()
    for window in windows:
        state, estimates = model.step(state, window)
        results.append(estimates)
    return results


def bits(results: Iterable[Estimates]) -> list[str]:
    """Return estimates as text with every digit, in which NaN equals itself."""
    return [str(dict(each)) for each in results]


def test_a_window_that_does_not_follow_begins_another_stream(drawn: Model, sound: Sound) -> None:
    windows = [sound(k) for k in range(20)]
    both = bits(predict(drawn, windows + windows))
    assert both[20:] == both[:20]


def test_a_gap_or_silence_is_an_abstention_and_keeps_the_state(drawn: Model, sound: Sound) -> None:
    model = dataclasses.replace(drawn, definition=dataclasses.replace(drawn.definition, quietest=1e-3))
    state = ModelState()
    for k in range(5):
        state, _ = model.step(state, sound(k))
    for window, reason in (
        (dataclasses.replace(sound(5), samples=5e-3 * sound(5).samples), Reason.SILENCE),
        (sound(5, has_gap=True), Reason.GAP),
        (dataclasses.replace(sound(5), samples=np.zeros((2, 800), np.float32)), Reason.SILENCE),
        (
            dataclasses.replace(sound(5), samples=np.full((2, 800), np.nan, np.float32)),
            Reason.NOT_NUMBERS,
        ),
    ):
        after, estimates = model.step(state, window)
        assert {each.reason for each in estimates.values()} == {reason}
        assert after._replace(start=state.start) == state
        assert estimates["force"].unit == "N"


def test_another_signal_is_refused(drawn: Model, signal: Signal, sound: Sound) -> None:
    with pytest.raises(InputError, match=r"44100 Hz.*8000 Hz"):
        drawn.check(Signal(sample_rate=44100, channels=2))
    with pytest.raises(InputError, match="microphone"):
        drawn.check(Signal(sample_rate=8000, channels=1))
    short = dataclasses.replace(sound(0), samples=sound(0).samples[:, :700])
    with pytest.raises(InputError, match=r"700 frames.*800 frames"):
        drawn.step(ModelState(), short)
    with pytest.raises(InputError, match=r"700 frames.*800 frames"):
        drawn.check(signal, 700)
    own = load_string("prototype").string
    known = dataclasses.replace(drawn, definition=dataclasses.replace(drawn.definition, string=own))
    known.check(dataclasses.replace(signal, string=dataclasses.replace(own, tension=1.01 * own.tension)))
    with pytest.raises(InputError, match=r"0\.65 m.*0\.2 m"):
        known.check(dataclasses.replace(signal, string=load_string("appendix").string))


def test_a_feature_that_changed_is_refused(drawn: Model, signal: Signal) -> None:
    trained = drawn.definition
    fewer = dataclasses.replace(trained.feature, options={"count": 23})
    with pytest.raises(InputError, match=r"'bands'.*48.*50"):
        dataclasses.replace(drawn, definition=dataclasses.replace(trained, feature=fewer)).check(signal)
    weights = {**drawn.weights, "scaler.probe": drawn.weights["scaler.probe"] + 3.0}
    with pytest.raises(InputError, match="'bands'"):
        dataclasses.replace(drawn, weights=weights).check(signal)


def row() -> Audio:
    """Return features (1, 50)."""
    return np.random.default_rng(1).normal(size=(1, 50)).astype(np.float32)


def test_outputs_are_what_torch_computes(drawn: Model) -> None:
    torch = pytest.importorskip("torch")
    definition = drawn.definition
    (outputs,) = HeadNetwork.of(definition, drawn.weights).outputs(row())
    inputs = network_inputs(row(), Scaling.of(drawn.weights), definition.clip)
    for name, record in definition.heads.items():
        values = torch.from_numpy(inputs[0, list(definition.columns_of(name))])
        for number in range(len(record.task.hidden) + 1):
            weight, bias = (
                torch.from_numpy(drawn.weights[f"{name}.{number}.{kind}"]) for kind in ("weight", "bias")
            )
            values = torch.nn.functional.linear(values, weight, bias)
            values = values.relu() if number < len(record.task.hidden) else values
        result = [outputs[name].value, outputs[name].log_spread][: len(values)]
        np.testing.assert_allclose(result, values.numpy(), rtol=1e-4, atol=1e-5)


def test_scaling_is_bounded_and_no_number_stays_that(drawn: Model) -> None:
    definition, scaling = drawn.definition, Scaling.of(drawn.weights)
    inputs = network_inputs(np.full((1, 50), 1e30, np.float32), scaling, definition.clip)
    assert np.abs(inputs).max() == definition.clip
    (outputs,) = HeadNetwork.of(definition, drawn.weights).outputs(np.full((1, 50), np.nan, np.float32))
    assert all(math.isnan(output.value) for output in outputs.values())
    with pytest.raises(InputError, match="49 columns"):
        network_inputs(row()[:, :49], scaling, definition.clip)


def test_columns_that_are_no_inputs_do_not_matter(drawn: Model) -> None:
    definition = drawn.definition
    task = dataclasses.replace(definition.heads["force"].task, columns=definition.feature.columns[10:20])
    heads = {**definition.heads, "force": dataclasses.replace(definition.heads["force"], task=task)}
    definition = dataclasses.replace(definition, heads=heads)
    weights = dict(drawn.weights)
    weights["force.0.weight"] = weights["force.0.weight"][:, 10:20]
    network = HeadNetwork.of(definition, weights)
    base = row()
    before = network.outputs(base)[0]["force"]
    base[:, :10], base[:, 20:] = 0.0, 5.0
    assert network.outputs(base)[0]["force"] == before
    base[:, 12] += 1.0
    assert network.outputs(base)[0]["force"] != before


def test_training_sees_what_the_model_sees(drawn: Model) -> None:
    torch = pytest.importorskip("torch")
    from monochord.perception.training.network import TrainingTensors, heads_module

    rng, definition = np.random.default_rng(3), drawn.definition
    tasks = definition.heads
    examples = Examples(
        rows=np.arange(6),
        session=np.zeros(6, np.int64),
        touch=np.arange(6),
        base=rng.normal(size=(1, 6, 50)).astype(np.float32),
        labels={name: np.zeros(6) for name in tasks},
        masks={name: np.ones(6, bool) for name in tasks},
    )
    heads = heads_module(definition, 0)
    for tensor in heads["force"].parameters():
        tensor.data = torch.from_numpy(rng.normal(size=tuple(tensor.shape)).astype(np.float32))
    tensors = TrainingTensors(definition, drawn.weights, examples)
    output = next(output for name, output, _, _ in tensors.outputs(heads) if name == "force")
    arrays = {**drawn.weights, **{name: tensor.numpy() for name, tensor in heads.state_dict().items()}}
    for number, result in enumerate(HeadNetwork.of(definition, arrays).outputs(examples.base[0])):
        assert result["force"].value == pytest.approx(float(output[number, 0]), rel=1e-4, abs=1e-4)


def outputs(contact: float = 9.0, **others: HeadOutput) -> dict[str, HeadOutput]:
    usual = {name: HeadOutput(value=0.0) for name in ("slip", "position", "force")}
    return {"contact": HeadOutput(value=contact), **usual, **others}


def calibrated(definition: Definition, name: str, factor: float) -> Definition:
    record = dataclasses.replace(definition.heads[name], calibration=Calibration(factor=factor))
    return dataclasses.replace(definition, heads={**definition.heads, name: record})


def test_quantities_are_in_the_unit_of_their_label(drawn: Model) -> None:
    position = HeadOutput(value=2.0, log_spread=math.log(3.0))
    estimate = estimates_of(drawn.definition.heads, drawn.definition.gate, outputs(position=position))[
        "position"
    ]
    assert (estimate.value, estimate.unit, estimate.valid) == (pytest.approx(0.102), "m", True)
    assert estimate.std == pytest.approx(3e-3 * math.sqrt(2.0))


def test_calibration_scales_the_uncertainty_alone(drawn: Model) -> None:
    wider = calibrated(drawn.definition, "position", 2.5)
    before, after = (quantity(CONFIDENT, each.heads["position"]) for each in (drawn.definition, wider))
    assert after == (before[0], pytest.approx(2.5 * before[1]))
    softer = calibrated(drawn.definition, "slip", 4.0)
    assert probability(HeadOutput(value=4.0), softer.heads["slip"]) == pytest.approx(
        1.0 / (1.0 + math.exp(-1.0))
    )


def test_without_contact_the_other_heads_abstain(drawn: Model) -> None:
    estimates = estimates_of(drawn.definition.heads, drawn.definition.gate, outputs(contact=-0.1))
    abstained = {name for name, each in estimates.items() if each.reason is Reason.NO_CONTACT}
    assert abstained == {"slip", "position", "force"}
    assert estimates["contact"].valid
    assert estimates["contact"].value == pytest.approx(0.475, abs=1e-3)


@pytest.mark.parametrize("contact", [-1.0, 1.0])
def test_contact_that_is_uncertain_is_not_denied(drawn: Model, contact: float) -> None:
    record = drawn.definition.heads["contact"]
    careful = dataclasses.replace(record, task=dataclasses.replace(record.task, limit=0.3))
    definition = dataclasses.replace(drawn.definition, heads={**drawn.definition.heads, "contact": careful})
    estimates = estimates_of(definition.heads, definition.gate, outputs(contact=contact))
    assert estimates["contact"].reason is Reason.UNCERTAIN
    assert {each.reason for each in estimates.values()} == {Reason.UNCERTAIN}
    assert estimates_of(definition.heads, definition.gate, outputs(contact=9.0 * contact))["contact"].valid


@pytest.mark.parametrize(("share", "reason"), [(0.0, Reason.UNCERTAIN), (1.0, "")])
def test_an_error_may_be_as_large_as_a_share_of_the_value(drawn: Model, share: float, reason: str) -> None:
    record = drawn.definition.heads["force"]
    task = dataclasses.replace(record.task, limit=1e-6, limit_share=share)
    heads = {**drawn.definition.heads, "force": dataclasses.replace(record, task=task)}
    told = estimates_of(heads, drawn.definition.gate, outputs(force=HeadOutput(value=5.0, log_spread=-1.0)))
    assert told["force"].reason == reason


def test_too_large_an_uncertainty_is_an_abstention(drawn: Model) -> None:
    position = HeadOutput(value=0.0, log_spread=math.log(50.0))
    estimates = estimates_of(drawn.definition.heads, drawn.definition.gate, outputs(position=position))
    assert estimates["position"].reason is Reason.UNCERTAIN
    assert estimates["contact"].valid


@pytest.mark.parametrize(
    ("logit", "windows", "expected"), [(1e3, 98, 0.99), (-1e3, 98, 0.01), (1e9, 0, 1.0), (-1e9, 0, 0.0)]
)
def test_a_probability_is_bounded_by_the_windows_of_its_calibration(
    drawn: Model, logit: float, windows: int, expected: float
) -> None:
    record = dataclasses.replace(drawn.definition.heads["slip"], calibration=Calibration(windows=windows))
    assert probability(HeadOutput(value=logit), record) == pytest.approx(expected)
