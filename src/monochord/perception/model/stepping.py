"""From a window to a model's estimates: what its heads say, and the reasons to withhold it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import hypot
from typing import NamedTuple

import numpy as np

from monochord.core.reasons import Reason
from monochord.core.shapes import sound
from monochord.core.types import Audio, Estimate, Estimates, Floats, Window
from monochord.metrics import DECISION
from monochord.perception.features.base import RecurrentExtractor, SpectrumExtractor
from monochord.perception.model.faults import OF_REASON, fault_reason, log_odds
from monochord.perception.model.network import HeadOutput, estimates_of, probability, quantity
from monochord.perception.model.prepared import PreparedModel
from monochord.perception.model.state import ModelState
from monochord.perception.spectrum import Spectrum
from monochord.perception.usable import unusable_reason

EDGE_DEVIATIONS, MAX_EDGE = 2.0, 1e-3
"""Number of standard errors, and largest distance in m, by which the estimate of a touch at an end of the
sensing range may lie outside."""


class ModelInput(NamedTuple):
    """A window of a stream, and the model that reads it with the state before it.

    `state` is the stream's state, of which the window has only changed `start`. `spectrum` is the window's;
    None where the model's feature needs none. `reason` is why the window is unusable; empty if it is usable.
    """

    model: PreparedModel
    state: ModelState
    window: Window
    spectrum: Spectrum | None
    reason: str


class WindowReading(NamedTuple):
    """A model's reading of a window, before it states estimates.

    `state` is the state after the window. `outputs` are the heads' outputs; empty for an unusable window.
    `reason` is the reason to abstain; empty for none. `odds` (faults,) are the log odds of faults; None for a
    model that reports none.
    """

    state: ModelState
    outputs: Mapping[str, HeadOutput]
    reason: str
    odds: Floats | None = None


def step_all(inputs: Sequence[ModelInput]) -> list[tuple[ModelState, Estimates]]:
    """Return the state after one window of each of several streams, and the estimates.

    All heads are computed at once. Therefore all models must come from one trained model; each may be tuned
    to another string.
    """
    readings = zip(inputs, read_all(inputs), strict=True)
    return [(reading.state, estimates_in(each.model, reading)) for each, reading in readings]


def read_all(inputs: Sequence[ModelInput]) -> list[WindowReading]:
    """Return the reading of each window; see `step_all`."""
    usable = [each for each in inputs if not each.reason]
    if not usable:
        return [WindowReading(each.state, {}, each.reason) for each in inputs]
    states, rows = zip(*map(_row, usable), strict=True)
    outputs = iter(zip(states, usable[0].model.network.outputs(np.stack(rows)), rows, strict=True))
    return [
        WindowReading(each.state, {}, each.reason) if each.reason else _reading(each.model, *next(outputs))
        for each in inputs
    ]


def model_input(
    model: PreparedModel, state: ModelState, window: Window, spectrum: Spectrum | None = None
) -> ModelInput:
    """Return a window as a model reads it; raises `InputError` for another length or number of channels.

    A window that starts no later than its predecessor begins another stream. A given `spectrum`, as a model
    on another string has it, is not computed again.
    """
    if window.samples.shape != model.shape:
        model.check_size(window.samples.shape[1])
        sound(window.samples, *model.shape)
    state = (state if window.start > state.start else ModelState())._replace(start=window.start)
    reason, feature = _unusable_reason(model, window), model.extractor
    if reason or not isinstance(feature, SpectrumExtractor):
        return ModelInput(model, state, window, None, reason)
    analyser = feature.analyser
    spectrum = analyser.analyse(window.samples) if spectrum is None else analyser.relisted(spectrum)
    return ModelInput(model, state, window, spectrum, reason)


def _unusable_reason(model: PreparedModel, window: Window) -> Reason:
    """Return why a window cannot be used; empty if it can.

    A memory that heard a clipped window would take the ones after it for clipped, too.
    """
    if reason := unusable_reason(window):
        return reason
    samples = window.samples
    power = float(np.vdot(samples, samples)) / samples.size
    return Reason.SILENCE if power < model.definition.quietest**2 else Reason.NONE


def _row(window_input: ModelInput) -> tuple[ModelState, Audio]:
    """Return the state after a window, and its features (columns,)."""
    state, window, feature = window_input.state, window_input.window, window_input.model.extractor
    if window_input.spectrum is None or not isinstance(feature, SpectrumExtractor):
        return state, feature(window.samples[np.newaxis])[0]
    if not isinstance(feature, RecurrentExtractor):
        return state, feature.row(window_input.spectrum)
    before = feature.begin() if state.memory is None else state.memory
    memory, row = feature.step(before, window_input.spectrum, window.start / window.sample_rate)
    return state._replace(memory=memory), row


def _reading(
    model: PreparedModel, state: ModelState, outputs: dict[str, HeadOutput], row: Audio
) -> WindowReading:
    """Return the reading of a usable window: outputs with variables, and the reason to abstain.

    `state` is the state after it, and `row` its features.
    """
    for name, (column, unit) in model.refined.items():
        outputs[name] = outputs[name]._replace(value=outputs[name].value + unit * float(row[column]))
    for name, variables in model.variables.items():
        outputs[name] = outputs[name]._replace(variables=tuple(variables.of(row).tolist()))
    heads = model.definition.heads
    if model.definition.faults is None:
        return WindowReading(state, outputs, "")
    contact = probability(outputs[model.gate], heads[model.gate])
    odds = log_odds(row[model.fault_columns].astype(np.float64), touched=contact > DECISION)
    return WindowReading(state, outputs, fault_reason(odds, model.fault_limits), odds)


def estimates_in(model: PreparedModel, reading: WindowReading) -> dict[str, Estimate]:
    """Return the estimates of a window.

    Outside the sensing range, every head that requires a touch abstains. Where the position is not certain,
    force is not either. With a fault, every head abstains, except contact where it stays reliable; a silent
    driver withholds no position that is certain.
    """
    heads, gate, reason = model.definition.heads, model.gate, reading.reason
    if not reading.outputs:
        return {name: Estimate.abstain(record.task.unit, reason) for name, record in heads.items()}
    estimates = estimates_of(heads, gate, reading.outputs, model.corrections)
    estimates = with_length_error(model, _at_string_tension(model, estimates))
    contact, fault = estimates[gate], OF_REASON.get(reason)
    touched, kept = contact.valid and contact.value >= DECISION, set[str]()
    place = _no_place_reason(model, reading, estimates) if touched else ""
    if touched and not place and fault and fault.place_reliable:
        return estimates
    if place is Reason.OUTSIDE_RANGE and (not reason or (fault and (fault.reason.brief or fault.of_touch))):
        # Outside the sensing range one touch may sound like two, or as if its driver were silent.
        reason, kept = place, {name for name, record in heads.items() if not record.task.touched}
    elif place and not reason:
        reason, kept = place, {name for name, record in heads.items() if record.task.is_probability}
    elif not reason:
        return estimates
    elif fault and (fault.contact_reliable or (fault.reason.brief and touched)):
        kept = {gate}
    return {
        name: each if name in kept else Estimate.abstain(each.unit, reason)
        for name, each in estimates.items()
    }


def with_length_error(model: PreparedModel, estimates: dict[str, Estimate]) -> dict[str, Estimate]:
    """Return estimates with positions on the string's own length, and its error in their standard error.

    A string that is longer than the training's by a share has its touches further from pickup 1 by the same
    share, and no sound tells. Its error is that of the measured length, or `Definition.length_std` where none
    was measured. A correction that has learned touches knows the length from them.
    """
    name, (scale, share) = model.place, model.length_and_error
    if (not share and scale == 1.0) or name is None or not estimates[name].valid:
        return estimates
    value, std = scale * estimates[name].value, scale * estimates[name].std
    position = replace(estimates[name], value=value, std=hypot(std, share * value))
    return {**estimates, name: position}


def _no_place_reason(model: PreparedModel, reading: WindowReading, estimates: Estimates) -> str:
    """Return why the position of a touch cannot be stated; empty if it can."""
    name, places = model.place, model.places
    if name is None:
        return ""
    # By its own standard error: how far a string's length is off its design moves the range's end, too.
    output, record = reading.outputs[name], model.definition.heads[name]
    place, std = quantity(output, record, model.corrections.get(name))
    edge = min(EDGE_DEVIATIONS * std, MAX_EDGE)
    if places is not None and not places[0] - edge <= place <= places[1] + edge:
        return Reason.OUTSIDE_RANGE
    return "" if estimates[name].valid else estimates[name].reason


def _at_string_tension(model: PreparedModel, estimates: dict[str, Estimate]) -> dict[str, Estimate]:
    """Return estimates with forces converted from the design's tension to the string's own.

    At another tension, the same relative change of the sound corresponds to another force. Training converts
    the labels in the opposite direction.
    """
    scale = model.force_scale
    if scale is None:
        return estimates
    return {
        name: replace(each, value=scale * each.value, std=scale * each.std) if each.unit == "N" else each
        for name, each in estimates.items()
    }
