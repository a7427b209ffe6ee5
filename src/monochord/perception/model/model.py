"""The model: feature, untouched reference, scaling and heads as one object, offline and live."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimates, Signal, StringParams, Window
from monochord.core.units import Samples
from monochord.perception.closed_form.usable import why_unusable
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.perception.model.context import Memory, context_row, step
from monochord.perception.model.definition import Definition, FeatureRecord
from monochord.perception.model.estimates import abstentions, estimates, probability
from monochord.perception.model.network import Answer, Network
from monochord.perception.model.probe import probed, refuse_another

LENGTHS_ALIKE = 0.02
"""Share by which the length of another string may differ from the one that was trained with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """What was learned, ready to be opened for a stream.

    `weights` are float32 arrays of the names and shapes that `definition.shapes` tells.
    """

    definition: Definition
    weights: Mapping[str, Audio]

    def open(self, signal: Signal) -> "Listening":
        """Return what perceives one stream of such a signal, from its begin on.

        Raises
        ------
        InputError
            If rate, channels or string are not those of the training, or the feature is not what it was
            then.
        """
        return Listening(self.prepare(signal))

    def prepare(self, signal: Signal) -> "Prepared":
        """Return the part of it that does not change as a stream goes on; raises as `open` does."""
        told = self.definition
        _refuse_other_signal(told, signal)
        # The string as designed, as in training: what a source knows of its own must not tell more.
        own = dataclasses.replace(signal, string=told.string)
        return Prepared(
            definition=told,
            feature=self._extractor(told.feature, own, "scaler"),
            reference=self._extractor(told.reference.feature, own, "context") if told.reference else None,
            network=Network.of(told, self.weights),
        )

    def _extractor(self, record: FeatureRecord, own: Signal, part: str) -> Extractor:
        """Return a feature made ready, having made sure that it is what it was in training."""
        told = self.definition
        found = extractor(record, own, told.window)
        kept = self.weights[f"{part}.probe"]
        scale = self.weights[f"{part}.scale"][: kept.shape[1]]
        refuse_another(record.name, probed(found, told.channels, told.window), kept, scale)
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """A model made ready for a signal: it holds no state, which is passed in and out."""

    definition: Definition
    feature: Extractor
    reference: Extractor | None
    network: Network

    def answers(self, memory: Memory, window: Window) -> tuple[Memory, Mapping[str, Answer]]:
        """Return the memory after a window, and what each head answers for it, before any calibration.

        A window is read against the reference of the windows before it. One that cannot be used leaves the
        memory as it is and has no answers.
        """
        if self.why_not(window):
            return memory, {}
        told, network = self.definition, self.network
        samples = window.samples[None]
        base = network.scaled(self.feature(samples)[0])
        context = network.scaled_context(context_row(memory, told.widths[1]))
        found = {name: network.answer(name, base, context) for name in told.heads}
        reference = self.reference
        if reference is not None and told.reference is not None:
            contact = probability(found[told.gate], told.heads[told.gate])
            time = window.start / window.sample_rate
            memory = step(memory, told.reference, time, contact, lambda: reference(samples)[0])
        return memory, found

    def perceive(self, memory: Memory, window: Window) -> tuple[Memory, Estimates]:
        """Return the memory after a window, and what is estimated of it.

        Raises
        ------
        InputError
            If the window's length is not that of the training.
        """
        size = window.samples.shape[-1]
        if size != self.definition.window:
            given, rate = f"windows of {size} frames for a model", self.definition.sample_rate
            remedy = f"take --window {self.definition.window / rate:g}"
            raise InputError(given, f"{self.definition.window} frames", remedy)
        memory, found = self.answers(memory, window)
        if not found:
            return memory, abstentions(self.definition, self.why_not(window))
        return memory, estimates(self.definition, found)

    def why_not(self, window: Window) -> str:
        """Return why a window cannot be used, or an empty string."""
        why = why_unusable(window)
        if why in UNUSABLE:
            return why
        samples = window.samples
        power = float(np.vdot(samples, samples)) / samples.size
        return "silence" if power < self.definition.quietest**2 else ""


UNUSABLE = ("gap", "silence", "samples that are not numbers")
"""What a model cannot use; it was trained on clipped windows as on others."""


class Listening:
    """A model on one stream: it keeps the memory between windows, which come in order."""

    def __init__(self, prepared: Prepared) -> None:
        self._prepared = prepared
        self._memory = Memory()
        self._start: Samples = -1

    def predict(self, window: Window) -> Estimates:
        """Return what is estimated of the next window.

        One that does not begin after the one before it is the first of another stream, and nothing that was
        heard before counts.
        """
        if window.start <= self._start:
            self._memory = Memory()
        self._start = window.start
        self._memory, found = self._prepared.perceive(self._memory, window)
        return found


def extractor(record: FeatureRecord, signal: Signal, size: Samples) -> Extractor:
    """Return the feature of a record made ready, having made sure that its columns are those recorded."""
    found = FEATURES.build(record.name, record.options).prepare(signal, size)
    if found.columns != record.columns:
        given = f"feature '{record.name}' of {len(found.columns)} columns"
        unlike = [
            (one, other) for one, other in zip(found.columns, record.columns, strict=False) if one != other
        ]
        was = f"the {len(record.columns)} columns that were trained with"
        first = f", '{unlike[0][1]}' where there is '{unlike[0][0]}'" if unlike else ""
        raise InputError(given, was + first, "train again")
    return found


def _refuse_other_signal(told: Definition, signal: Signal) -> None:
    if signal.sample_rate != told.sample_rate:
        given = f"sound at {signal.sample_rate} Hz for a model"
        raise InputError(given, f"{told.sample_rate} Hz, as it was trained", "record at that rate")
    if signal.channels != told.channels:
        given = f"sound of {signal.channels} channel(s) for a model"
        raise InputError(given, f"{told.channels}, as it was trained", "connect both microphones")
    if told.string and signal.string and not _alike(told.string, signal.string):
        given = f"a string of {signal.string.length:g} m for a model"
        raise InputError(given, f"{told.string.length:g} m, as it was trained", "train one for this sensor")


def _alike(one: StringParams, other: StringParams) -> bool:
    return abs(other.length / one.length - 1.0) <= LENGTHS_ALIKE
