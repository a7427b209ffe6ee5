"""The model on streams: equal bits however it is fed, its outputs beside torch, and its estimates."""

import dataclasses
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Estimates, Signal, Window
from monochord.perception.model import Definition, Model, ModelState
from monochord.perception.model.definition import Calibration
from monochord.perception.model.network import (
    Network,
    Output,
    Scaling,
    estimates_of,
    network_inputs,
    probability,
    quantity,
)
from monochord.perception.training.examples import Examples
from monochord.physics.strings import load_string
from monochord.physics.theory import geometric_tension

Sound = Callable[..., Window]
CONFIDENT = Output(value=9.0)


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


def test_the_state_is_all_that_earlier_windows_change(drawn: Model, sound: Sound) -> None:
    state, window = ModelState(), sound(40)
    quiet = ModelState(median=np.zeros(10, np.float32), rows=(np.zeros(10, np.float32),))
    alone, after = (dict(drawn.outputs(each, window)[1]) for each in (state, quiet))
    assert alone["contact"] == after["contact"]
    assert alone["force"] != after["force"]
    assert state == ModelState()


def test_a_window_that_does_not_follow_begins_another_stream(drawn: Model, sound: Sound) -> None:
    windows = [sound(k) for k in range(20)]
    both = bits(predict(drawn, windows + windows))
    assert both[20:] == both[:20]


def test_a_gap_or_silence_is_an_abstention_and_keeps_the_reference(drawn: Model, sound: Sound) -> None:
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


def rows() -> tuple[np.ndarray, np.ndarray]:
    """Return a feature row (1, 50) and a reference (1, 11) that is present."""
    rng = np.random.default_rng(1)
    base, context = (rng.normal(size=(1, width)).astype(np.float32) for width in (50, 11))
    context[:, -1] = 1.0
    return base, context


def test_outputs_are_what_torch_computes(drawn: Model) -> None:
    torch = pytest.importorskip("torch")
    definition = drawn.definition
    base, context = rows()
    (outputs,) = Network.of(definition, drawn.weights).outputs(base, context)
    inputs = network_inputs(base, context, Scaling.of(definition, drawn.weights), definition.clip)
    for name, record in definition.heads.items():
        row = torch.from_numpy(inputs[0, list(definition.input_columns(name))])
        for number in range(len(record.task.hidden) + 1):
            weight, bias = (
                torch.from_numpy(drawn.weights[f"{name}.{number}.{kind}"]) for kind in ("weight", "bias")
            )
            row = torch.nn.functional.linear(row, weight, bias)
            row = row.relu() if number < len(record.task.hidden) else row
        result = [outputs[name].value, outputs[name].log_spread][: len(row)]
        np.testing.assert_allclose(result, row.numpy(), rtol=1e-4, atol=1e-5)


def test_scaling_is_bounded_an_absent_reference_is_zeros_and_no_number_stays_that(drawn: Model) -> None:
    definition = drawn.definition
    scaling = Scaling.of(definition, drawn.weights)
    base, context = rows()
    inputs = network_inputs(np.full((1, 50), 1e30, np.float32), context, scaling, definition.clip)
    assert np.abs(inputs[:, :50]).max() == definition.clip
    assert inputs[:, 50:].any()
    absent = context.copy()
    absent[:, -1] = 0.0
    assert not network_inputs(base, absent, scaling, definition.clip)[:, 50:].any()
    unknown = np.full_like(base, np.nan)
    (outputs,) = Network.of(definition, drawn.weights).outputs(unknown, context)
    assert all(math.isnan(output.value) for output in outputs.values())
    with pytest.raises(InputError, match="49 columns"):
        network_inputs(base[:, :49], context, scaling, definition.clip)


def test_columns_that_are_no_inputs_do_not_matter(drawn: Model) -> None:
    definition = drawn.definition
    task = dataclasses.replace(definition.heads["force"].task, columns=definition.feature.columns[10:20])
    heads = {**definition.heads, "force": dataclasses.replace(definition.heads["force"], task=task)}
    definition = dataclasses.replace(definition, heads=heads)
    weights = dict(drawn.weights)
    weights["force.0.weight"] = weights["force.0.weight"][:, 10 : 20 + 11]
    network = Network.of(definition, weights)
    base, context = rows()
    before = network.outputs(base, context)[0]["force"]
    base[:, :10], base[:, 20:] = 0.0, 5.0
    assert network.outputs(base, context)[0]["force"] == before
    base[:, 12] += 1.0
    assert network.outputs(base, context)[0]["force"] != before


def rising(definition: Definition, **feature: Any) -> Definition:
    """Return a definition whose head of force has the rise of the pitch as an input."""
    record, reference = definition.heads["force"], definition.reference
    assert reference is not None
    task = dataclasses.replace(record.task, rise=True)
    columns = ("open", "position", *definition.feature.columns[2:])
    names = ("rest", "lowest", *reference.feature.columns[2:])
    untouched = dataclasses.replace(reference.feature, columns=names)
    return dataclasses.replace(
        definition,
        feature=dataclasses.replace(definition.feature, **{"columns": columns, **feature}),
        reference=dataclasses.replace(reference, feature=untouched),
        heads={**definition.heads, "force": dataclasses.replace(record, task=task)},
    )


@pytest.mark.parametrize("names", [(), ("rest", "mic 2 p*")])
def test_training_sees_the_rise_and_the_reference_that_the_model_sees(
    drawn: Model, names: tuple[str, ...]
) -> None:
    torch = pytest.importorskip("torch")
    from monochord.perception.training.network import TrainingTensors, heads_module

    definition = rising(drawn.definition)
    record = definition.heads["force"]
    record = dataclasses.replace(record, task=dataclasses.replace(record.task, reference=names))
    definition = dataclasses.replace(definition, heads={**definition.heads, "force": record})
    assert len(definition.reference_of("force")) == (3 if names else 11)
    rng = np.random.default_rng(3)
    base, context = rng.normal(size=(1, 6, 50)), rng.normal(size=(1, 6, 11))
    context[..., -1] = [1.0, 1.0, 1.0, 1.0, 1.0, 0.0]
    tasks = definition.heads
    examples = Examples(
        rows=np.arange(6),
        session=np.zeros(6, np.int64),
        touch=np.arange(6),
        base=base.astype(np.float32),
        context=context.astype(np.float32),
        labels={name: np.zeros(6) for name in tasks},
        masks={name: np.ones(6, bool) for name in tasks},
    )
    heads = heads_module(definition, 0)
    for tensor in heads["force"].parameters():
        tensor.data = torch.from_numpy(rng.normal(size=tuple(tensor.shape)).astype(np.float32))
    tensors = TrainingTensors(definition, drawn.weights, examples)
    output = next(output for name, output, _, _ in tensors.outputs(heads) if name == "force")
    arrays = {**drawn.weights, **{name: tensor.numpy() for name, tensor in heads.state_dict().items()}}
    network = Network.of(definition, arrays)
    for number in range(6):
        row, known = examples.base[0, number], examples.context[0, number]
        own = network.outputs(row[np.newaxis], known[np.newaxis])[0]["force"]
        assert own.value == pytest.approx(float(output[number, 0]), rel=1e-4, abs=1e-4)


def test_a_rise_without_its_columns_is_refused(drawn: Model) -> None:
    with pytest.raises(InputError, match=r"'force'.*'open'"):
        rising(drawn.definition, columns=drawn.definition.feature.columns).shapes()


def test_the_root_of_the_rise_is_a_light_press_anywhere() -> None:
    string = load_string("prototype").string
    place = np.array([0.1, 0.3, 0.5, 0.9])
    tension = np.asarray(geometric_tension(string, place * string.length, np.full(4, 0.5)))
    share = 1e3 * (np.sqrt(tension / string.tension) - 1.0)
    row = np.stack([share, place], axis=1).astype(np.float32)
    reference = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    one, three = np.ones(2, np.float32), np.ones(3, np.float32)
    scaling = Scaling(0.0 * one, one, 0.0 * three, three, np.array([0, 1, 0, 1]))
    roots = network_inputs(row, reference, scaling, 8.0)[:, 5 + 2]
    np.testing.assert_allclose(roots, roots[0], rtol=2e-3)


def outputs(contact: float = 9.0, **others: Output) -> dict[str, Output]:
    usual = {name: Output(value=0.0) for name in ("slip", "position", "force")}
    return {"contact": Output(value=contact), **usual, **others}


def calibrated(definition: Definition, name: str, factor: float) -> Definition:
    record = dataclasses.replace(definition.heads[name], calibration=Calibration(factor=factor))
    return dataclasses.replace(definition, heads={**definition.heads, name: record})


def test_quantities_are_in_the_unit_of_their_label(drawn: Model) -> None:
    position = Output(value=2.0, log_spread=math.log(3.0))
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
    assert probability(Output(value=4.0), softer.heads["slip"]) == pytest.approx(1.0 / (1.0 + math.exp(-1.0)))


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


def test_too_large_an_uncertainty_is_an_abstention(drawn: Model) -> None:
    position = Output(value=0.0, log_spread=math.log(50.0))
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
    assert probability(Output(value=logit), record) == pytest.approx(expected)
