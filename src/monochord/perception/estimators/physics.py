"""Physics alone: contact, place and force from the lines of a window, with nothing learned."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.types import OUTSIDE_RANGE, Estimate, Estimates, Prepared, Signal, Window
from monochord.core.units import Newtons, Samples
from monochord.perception.closed_form.usable import unusable_reason
from monochord.perception.estimators.base import Condition, Estimator, Watching
from monochord.perception.physics_reader.reader import UNKNOWN_PITCH_STD, PhysicsReader, Reading
from monochord.perception.tuning import Tuner, TunerState, Tuning
from monochord.physics.theory import TensionLaw

UNITS = {"contact": "", "frequency": "Hz", "position": "m", "force": "N", "tension": "N"}
MIN_CONTACT, MIN_LEAD = 1.5, 2.0
"""Least log odds of contact or none, and of a place over all others: 4 to 1, and 7 to 1."""
ONE_SEGMENT = "one segment alone does not tell force"


@dataclass(frozen=True, slots=True, kw_only=True)
class Physics(Estimator):
    """Contact, place and force by physics alone: no part of it has seen a recording or a simulation.

    The lines of a window are explained as partials of two stiff segments, or of one, or of the untouched
    string (`monochord.perception.physics_reader`). All explanations together give the odds of contact and of
    each place; the place with its error is given where it is 7 times as likely as all others. Force follows
    from the tension, with the give of contact and mount unknown, so its error is that of physics: what is
    left out are resonances of the mount at single lines, contacts that turn, and wide ones.

    Parameters
    ----------
    tension_law
        How force raises tension.
    most_force
        Largest force in N that is expected.
    """

    tension_law: TensionLaw = "linear"
    most_force: Annotated[Newtons, Meta(gt=0.0)] = 2.5

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Prepare it; raises `InputError` unless the signal has two channels of a known string."""
        if signal.channels != 2 or signal.string is None:
            known = "an unknown" if signal.string is None else "a known"
            given = f"{signal.channels} channel(s) of {known} string"
            raise InputError(given, "two channels of a known string", "name it with --string")
        return _Physics(self, signal, Tuner.of(signal, size))


class _Physics(Watching):
    """The estimator on one stream of windows, tuned by those that nothing touches."""

    def __init__(self, options: Physics, signal: Signal, tuner: Tuner) -> None:
        self._tuner, self._state = tuner, TunerState()
        self._range = signal.sensing_range or (0.0, tuner.string.length)
        self._unknown = PhysicsReader.of(
            tuner.string,
            signal.sample_rate,
            law=options.tension_law,
            most_force=options.most_force,
            pitch_std=UNKNOWN_PITCH_STD,
        )
        self._reader: PhysicsReader = self._unknown
        turns = np.outer(
            (2.5, 5.0 / 3.0), 2.0 * math.pi * tuner.nominal / signal.sample_rate * np.arange(tuner.size)
        )
        self._reader.read((np.array([[0.8, 0.2], [0.2, 0.8]]) @ np.sin(turns)).astype(np.float32))  # compiles

    def __call__(self, window: Window) -> Estimates:
        if window.start <= self._state.start:
            self._reader = self._unknown
        before, self._state = self._state.tuning, self._tuner.step(self._state, window)
        tuning = self._state.tuning
        if tuning is not None and tuning is not before:
            pitch_std = tuning.frequency_std / tuning.frequency
            self._reader = self._unknown.tuned(tuning.tuned(self._tuner.string), pitch_std)
        reason = unusable_reason(window)
        reading = None if reason else self._reader.read(window.samples)
        if reading is None:
            return _abstain(reason or "no harmonic structure")
        return self._estimates(reading)

    def _estimates(self, reading: Reading) -> Estimates:
        probability = 0.5 + 0.5 * math.tanh(0.5 * reading.contact)
        if abs(reading.contact) < MIN_CONTACT:
            return _abstain("two candidates")
        told = {
            "contact": Estimate(value=probability, std=math.sqrt(probability * (1.0 - probability)), unit=""),
            "frequency": Estimate(value=reading.strongest[0], std=reading.strongest[1], unit="Hz"),
        }
        if reading.contact < 0.0:
            return _abstain("no contact") | told
        if reading.lead < MIN_LEAD:
            return _abstain("two candidates") | told
        touch = self._reader.touch(reading)
        if not self._range[0] <= touch.position <= self._range[1]:
            return _abstain(OUTSIDE_RANGE) | told
        told["position"] = Estimate(value=touch.position, std=touch.position_std, unit="m")
        if not reading.both:
            return _abstain(ONE_SEGMENT) | told
        return told | {
            "force": Estimate(value=touch.force, std=touch.force_std, unit="N"),
            "tension": Estimate(value=touch.tension, std=touch.tension_std, unit="N"),
        }

    @property
    def condition(self) -> Condition:
        """The pitch of the string, and how far it is off the one that it was known at."""
        tuning: Tuning | None = self._state.tuning
        if tuning is None:
            return Condition()
        deviation = tuning.deviation(self._tuner.string)
        return Condition(open_frequency=tuning.open_frequency, deviation=deviation)


def _abstain(reason: str) -> dict[str, Estimate]:
    return {name: Estimate.abstain(unit, reason) for name, unit in UNITS.items()}
