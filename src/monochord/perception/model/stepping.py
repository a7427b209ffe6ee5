"""From a window to a model's estimates: what its heads say, and the reasons to withhold it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from monochord.core.reasons import Reason
from monochord.core.shapes import sound
from monochord.core.types import (
    Audio,
    Estimate,
    Estimates,
    Floats,
    Indices,
    Window,
)
from monochord.core.units import Metres, Seconds
from monochord.metrics import DECISION
from monochord.perception.features.base import Extractor, SpectrumExtractor
from monochord.perception.model import faults
from monochord.perception.model.context import ModelState, context_row, step
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import Definition
from monochord.perception.model.faults import OF_REASON, fault_reason
from monochord.perception.model.network import Network, Output, estimates_of, probability, quantity
from monochord.perception.spectrum import Spectrum
from monochord.perception.tuning.sessions import force_scale
from monochord.perception.usable import unusable_reason

if TYPE_CHECKING:
    from monochord.perception.model.model import Model

EDGE_DEVIATIONS, MAX_EDGE = 2.0, 1e-3
"""Number of standard errors, and largest distance in m, by which the estimate of a touch at an end of the
sensing range may lie outside."""
RAISED_PITCH, RAISED_ODDS = 4.0, 5.0
"""Rise of the pitch since the string was untouched, in thousandths, and what it adds to the log odds of a
touch: 27 % of the touched windows in doubt have it, and 0.05 % of the untouched ones (20 builds)."""
HIDDEN_PITCH, HIDDEN_PARTIALS = 1.2, 3.0
"""Rises of the pitch and of the number of the lowest audible partial at which a window that sounds untouched
is in doubt: a touch at a node of the partial that the drivers hold leaves that partial alone. Of untouched
windows 0.03 % have both."""
RISE_MEMORY: Seconds = 60.0
"""How long the pitch of the untouched string counts. Then the string may have been tuned, and not touched."""
UNUSABLE = (Reason.GAP, Reason.SILENCE, Reason.NOT_NUMBERS)
"""Reasons that make a window unusable for a model. Clipped windows are usable: training includes them."""


class Entry(NamedTuple):
    """A window of a stream on its way into a model.

    `state` is the stream's state, of which the window has only changed `start`. `spectrum` is the window's;
    None where the model's feature needs none. `reason` is why the window is unusable; empty if it is usable.
    """

    stepper: "Stepper"
    state: ModelState
    window: Window
    spectrum: Spectrum | None
    reason: str


class WindowReading(NamedTuple):
    """A model's reading of a window, before it states estimates.

    `state` is the state after the window. `outputs` are the heads' outputs; empty for an unusable window.
    `reason` is the reason to abstain; empty for none.
    """

    state: ModelState
    outputs: Mapping[str, Output]
    reason: str


def step_all(entries: Sequence[Entry]) -> list[tuple[ModelState, Estimates]]:
    """Return the state after one window of each of several streams, and the estimates.

    All heads are computed at once. Therefore all models must come from one trained model; each may be tuned
    to another string.
    """
    readings = read_all(entries)
    return [
        (reading.state, entry.stepper.estimates(reading))
        for entry, reading in zip(entries, readings, strict=True)
    ]


def read_all(entries: Sequence[Entry]) -> list[WindowReading]:
    """Return the reading of each window; see `step_all`."""
    usable = [entry for entry in entries if not entry.reason]
    if not usable:
        return [WindowReading(entry.state, {}, entry.reason) for entry in entries]
    first = usable[0].stepper
    rows = np.stack([entry.stepper.row(entry) for entry in usable])
    known = np.stack([context_row(entry.state, first.context) for entry in usable])
    outputs = iter(zip(first.network.outputs(rows, known), rows, known, strict=True))
    return [
        WindowReading(entry.state, {}, entry.reason)
        if entry.reason
        else entry.stepper.reading(entry, *next(outputs))
        for entry in entries
    ]


@dataclass(frozen=True, eq=False)
class Stepper:
    """A model made ready for windows: all that its windows need is derived once."""

    model: "Model"

    def entry(self, state: ModelState, window: Window, spectrum: Spectrum | None = None) -> Entry:
        """Return a window's entry.

        Parameters
        ----------
        state
            The state before the window. A window that starts no later than its predecessor begins another
            stream.
        window
            A window of the training's length.
        spectrum
            The window's spectrum, as a model on another string has it; None to compute it.

        Raises
        ------
        InputError
            If the window has another length or number of channels.
        """
        if window.samples.shape != self._shape:
            self.model.check_size(window.samples.shape[1])
            sound(window.samples, *self._shape)
        state = (state if window.start > state.start else ModelState())._replace(start=window.start)
        reason, feature = self._unusable_reason(window), self._features[0]
        if reason or not isinstance(feature, SpectrumExtractor):
            return Entry(self, state, window, None, reason)
        analyser = feature.analyser
        own = analyser.analyse(window.samples) if spectrum is None else analyser.relisted(spectrum)
        return Entry(self, state, window, own, reason)

    def row(self, entry: Entry) -> Audio:
        """Return the features (columns,) of a window."""
        return _row(self._features[0], entry)

    def reading(self, entry: Entry, outputs: dict[str, Output], row: Audio, known: Audio) -> WindowReading:
        """Return the reading of a usable window: its state, outputs with variables, and reason to abstain.

        `row` is the window's features, and `known` the reference.
        """
        for name, (column, unit) in self._refined.items():
            outputs[name] = outputs[name]._replace(value=outputs[name].value + unit * float(row[column]))
        if self._variables:
            columns = np.concatenate([row, known[:-1], np.zeros(1, np.float32)]).astype(np.float64)
            for name, (of, less) in self._variables.items():
                values = tuple((columns[of] - columns[less]).tolist())
                outputs[name] = outputs[name]._replace(variables=values)
        trained, state, window = self._definition, entry.state, entry.window
        time, reason = window.start / window.sample_rate, ""
        gate, (pitch, partials) = outputs[self._gate], self._rise(row, known, time - state.accepted)
        if pitch >= HIDDEN_PITCH and partials >= HIDDEN_PARTIALS:
            gate = gate._replace(value=max(gate.value, 0.0))
        contact = probability(gate, trained.heads[self._gate])
        outputs[self._gate] = gate._replace(value=gate.value + RAISED_ODDS * (pitch >= RAISED_PITCH))
        if trained.faults is not None:
            values, lines = row[self._fault_columns].astype(np.float64), -len(faults.LINES)
            odds = faults.log_odds(values[:lines], values[lines:])
            state = state._replace(faults=faults.step(state.faults, odds, time, touched=contact > DECISION))
            reason = fault_reason(state.faults.odds, self._fault_limits)
        if trained.reference is not None:
            # A faulty window is no untouched string, whatever the contact head says.
            contact = 1.0 if reason else contact
            own = self._features[1]
            state = step(
                state, trained.reference, time, contact, lambda: row if own is None else _row(own, entry)
            )
        return WindowReading(state, outputs, reason)

    def estimates(self, reading: WindowReading) -> dict[str, Estimate]:
        """Return the estimates of a window.

        Outside the sensing range, every head that requires a touch abstains. Where the position is not
        certain, force is not either. With a fault, every head abstains, except contact where it stays
        reliable.
        """
        heads, gate, reason = self._definition.heads, self._gate, reading.reason
        if not reading.outputs:
            return {name: Estimate.abstain(record.task.unit, reason) for name, record in heads.items()}
        estimates = estimates_of(heads, gate, reading.outputs, self._corrections)
        estimates = self.with_length_error(self._at_string_tension(estimates))
        contact, fault = estimates[gate], OF_REASON.get(reason)
        touched, kept = contact.valid and contact.value >= DECISION, set[str]()
        place = self._no_place_reason(reading, estimates) if touched else ""
        if place is Reason.OUTSIDE_RANGE and (
            not reason or (fault and (fault.reason.brief or fault.of_touch))
        ):
            # Outside the sensing range one touch may sound soft, like two, or as if its driver were silent.
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

    def _rise(self, row: Audio, known: Audio, age: Seconds) -> tuple[float, float]:
        """Return by how much pitch and lowest partial are above those of the reference; 0 if it is old."""
        if not self._partials or not known[-1] or age > RISE_MEMORY:
            return 0.0, 0.0
        pitch, partials = (row[self._partials] - known[self._partials]).tolist()
        return pitch, partials

    def with_length_error(self, estimates: dict[str, Estimate]) -> dict[str, Estimate]:
        """Return estimates with positions on the string's own length, and its error in their standard error.

        A string that is longer than the training's by a share has its touches further from pickup 1 by the
        same share, and no sound tells. Its error is that of the measured length, or `Definition.length_std`
        where none was measured. A correction that has learned touches knows the length from them.
        """
        name, (scale, share) = self._place, self._length
        if (not share and scale == 1.0) or name is None or not estimates[name].valid:
            return estimates
        value, std = scale * estimates[name].value, scale * estimates[name].std
        position = replace(estimates[name], value=value, std=hypot(std, share * value))
        return {**estimates, name: position}

    def _no_place_reason(self, reading: WindowReading, estimates: Estimates) -> str:
        """Return why the position of a touch cannot be stated; empty if it can."""
        name, places = self._place, self._places
        if name is None:
            return ""
        # By its own standard error: how far a string's length is off its design moves the range's end, too.
        output, record = reading.outputs[name], self._definition.heads[name]
        place, std = quantity(output, record, self._corrections.get(name))
        edge = min(EDGE_DEVIATIONS * std, MAX_EDGE)
        if places is not None and not places[0] - edge <= place <= places[1] + edge:
            return Reason.OUTSIDE_RANGE
        return "" if estimates[name].valid else estimates[name].reason

    def _at_string_tension(self, estimates: dict[str, Estimate]) -> dict[str, Estimate]:
        """Return estimates with forces converted from the design's tension to the string's own.

        At another tension, the same relative change of the sound corresponds to another force. Training
        converts the labels in the opposite direction.
        """
        scale = self._force_scale
        if scale is None:
            return estimates
        return {
            name: replace(each, value=scale * each.value, std=scale * each.std) if each.unit == "N" else each
            for name, each in estimates.items()
        }

    def _unusable_reason(self, window: Window) -> Reason:
        """Return why a window cannot be used; empty if it can."""
        reason = unusable_reason(window)
        if reason in UNUSABLE:
            return reason
        samples = window.samples
        power = float(np.vdot(samples, samples)) / samples.size
        return Reason.SILENCE if power < self._definition.quietest**2 else Reason.NONE

    @cached_property
    def network(self) -> Network:
        """The network of all heads."""
        return self.model.network

    @cached_property
    def context(self) -> int:
        """Number of columns of the untouched reference with its mark."""
        return self._definition.widths[1]

    @cached_property
    def _definition(self) -> Definition:
        return self.model.definition

    @cached_property
    def _shape(self) -> tuple[int, int]:
        """The shape of a window."""
        return self._definition.channels, self._definition.window

    @cached_property
    def _features(self) -> tuple[Extractor, Extractor | None]:
        return self.model.extractors

    @cached_property
    def _corrections(self) -> dict[str, Correction]:
        return self.model.corrections

    @cached_property
    def _gate(self) -> str:
        return self._definition.gate

    @cached_property
    def _place(self) -> str | None:
        return self._definition.place

    @cached_property
    def _places(self) -> tuple[Metres, Metres] | None:
        return self.model.places

    @cached_property
    def _length(self) -> tuple[float, float]:
        """The string's length over that of the training, and its relative standard error."""
        share, name = self._definition.length_std, self._place
        scale, trained = self.model.length_scale, self._definition.string
        correction = self._definition.heads[name].correction if name else None
        if correction is not None and correction.touches:
            share = 0.0
        elif self.model.length_std is not None and trained is not None:
            share = self.model.length_std / (scale * trained.length)
        return scale, share

    @cached_property
    def _force_scale(self) -> float | None:
        """Forces on the string over those on the training's; None without a string of its own."""
        own, trained = self.model.string, self._definition.string
        return None if own is None or trained is None else force_scale(own, trained)

    @cached_property
    def _variables(self) -> dict[str, tuple[Indices, Indices]]:
        """Of each correction the columns whose difference is a variable; see `Definition.variables_of`."""
        variables: dict[str, tuple[Indices, Indices]] = {}
        for name, record in self._definition.heads.items():
            if record.correction:
                pairs = np.array(self._definition.variables_of(name), np.int64).reshape(-1, 2)
                variables[name] = pairs[:, 0], pairs[:, 1]
        return variables

    @cached_property
    def _refined(self) -> dict[str, tuple[int, float]]:
        """The column that each head refines, and the string's length in units of the head's scale."""
        refined: dict[str, tuple[int, float]] = {}
        for name, record in self._definition.heads.items():
            column, string = self._definition.refined(name), self._definition.string
            if column is not None and string is not None:
                refined[name] = column, string.length / record.scale
        return refined

    @cached_property
    def _partials(self) -> list[int]:
        """The columns of the pitch and of the lowest partial's number, in feature and reference alike."""
        trained, names = self._definition, ("rest", "lowest number")
        shared = (
            trained.reference is not None and trained.reference.feature.columns == trained.feature.columns
        )
        columns = trained.feature.columns
        return [columns.index(name) for name in names] if shared and {*names} <= {*columns} else []

    @cached_property
    def _fault_limits(self) -> Floats:
        return np.array(self._definition.faults.limits if self._definition.faults else ())

    @cached_property
    def _fault_columns(self) -> Indices:
        return np.array(self._definition.fault_columns, np.int64)


def _row(feature: Extractor, entry: Entry) -> Audio:
    if entry.spectrum is not None and isinstance(feature, SpectrumExtractor):
        return feature.row(entry.spectrum)
    return feature(entry.window.samples[np.newaxis])[0]
