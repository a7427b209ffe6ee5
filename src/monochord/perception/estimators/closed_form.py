"""The closed-form estimator: position and force from pitch, with the exact inverse of the clamped string."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Prepared, Signal, StringParams, Window
from monochord.core.units import Hertz, KilogramsPerMetre, Metres, Newtons, Samples
from monochord.dsp.microphones import Microphones
from monochord.perception.closed_form import both_segments, far_segment
from monochord.perception.closed_form.both_segments import MIN_CONTACT, MIN_UNTOUCHED, BothSegments
from monochord.perception.closed_form.explanations import RANGE
from monochord.perception.closed_form.far_segment import FarSegment, FollowedNote
from monochord.perception.closed_form.one_note import NO_SIDES, SidesReader
from monochord.perception.estimators.base import Estimator
from monochord.perception.tuning import Tuner, TunerState
from monochord.perception.tuning.tuner import detuned
from monochord.perception.usable import UntouchedStringCheck, unusable_reason
from monochord.perception.watching import Condition, Watching
from monochord.physics.theory import TensionLaw, open_frequency, position_from_far_segment

FAR_ONLY = ("calibration", "length", "open_frequency", "reach")
"""Options of the far form only."""
EXPECTED_PITCH = "its known pitch"
DENSITY: KilogramsPerMetre = 4.0e-4
"""Placeholder for an unknown string's density, that of plain steel of 0.25 mm; the position does not depend
on it, but how far a soft contact may lower the pitch does."""
BOTH_ONLY = ("tension_law", "most_force")
"""Options of the two-sided form only."""
OPEN_NOTE = 0.02
"""Relative distance from the open frequency within which a note at both channels may be the open note."""
SAME_POSITION = 0.01
"""Largest difference of two agreeing positions, as a share of the length."""
MIN_LEAD, MAX_LEAD = -2, 5
"""Bounds of the count that decides between one note (negative) and two segments (positive), in windows."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm(Estimator):
    """Position and force from pitch, with the exact inverse of the clamped string.

    The far form uses the pitch of one segment, as on a fretted instrument: x = L (1 - f_open / f). The
    two-sided form uses both segments, as the sensor does: x = L f2 / (f1 + f2), and f1 f2 / (f1 + f2) gives
    tension, hence force. It weighs all that may have made the lines of a window: partials of two stiff
    segments, or of one, or of the untouched string (`monochord.perception.closed_form`). A position is given
    where it is 7 times as likely as all others. The give of contact and mount is unknown, so the error of
    force is large. No form has learned from a recording or a simulation.

    The estimator abstains, with the reason, from a window that is silent, clipped, interrupted by a gap,
    without harmonic structure, or has two candidates. The two-sided form follows the string's tuning with
    untouched windows, within 10 % of the known tuning. Apart from the tuning, each window is judged alone.

    Parameters
    ----------
    length
        Length of the string between nut and bridge, in m; by default the known string's.
    open_frequency
        Frequency of the untouched string in Hz, as recorded; by default the known string's.
    calibration
        Calibration takes for the far form: (frequency in Hz, position in m from the nut), optionally with the
        take's inharmonicity B as a third number. Position 0 is the open note.
    sides
        "far", "both" or "auto". With "auto", a signal with two channels of a known string and no
        `open_frequency` uses the two-sided form. With two channels and `open_frequency`, the windows decide:
        two segments, each louder at its own microphone, start the two-sided form; one note at both channels,
        as in a stereo recording, selects the far form, and so does a single microphone: a channel that is a
        copy of the other, or carries nothing, is left out. Force and tension then require a known string, for
        its density.
    reach
        Largest position of the far form as a share of the length.
    tension_law, most_force
        For the two-sided form: how force raises tension, and the largest expected force in N.
    """

    length: Metres | None = None
    open_frequency: Hertz | None = None
    calibration: tuple[tuple[float, ...], ...] = ()
    sides: Literal["auto", "far", "both"] = "auto"
    reach: float = 0.8
    tension_law: TensionLaw = "linear"
    most_force: Annotated[Newtons, Meta(gt=0.0)] = 2.5

    def __post_init__(self) -> None:
        Estimator.__post_init__(self)
        refuse_other_units(length=self.length)

    @property
    def string_length(self) -> Metres | None:
        """The option `length`."""
        return self.length

    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Prepare the form that `sides` and the signal select."""
        both = signal.channels == 2 and signal.string is not None and self.open_frequency is None
        if self.sides == "both" or (self.sides == "auto" and both):
            self._refuse_set(FAR_ONLY, "both segments", "one segment with --open-frequency")
            if signal.string is None or signal.channels != 2:
                known = "an unknown" if signal.string is None else "a known"
                given = f"two-sided form on {signal.channels} channel(s) of {known} string"
                raise InputError(given, "two channels of a known string", "name the string with --string")
            return _TwoSegmentStream(self, signal, size)
        self._refuse_set(
            BOTH_ONLY, "the far segment alone", "both segments with two microphones and --string"
        )
        far = self._far_segment(signal)
        estimate = FollowedNote(far.prepare(signal.sample_rate, size))
        if signal.channels != 2:
            return estimate
        if self.sides == "far":
            return _FarSegmentStream(estimate)
        with suppress(InputError):  # windows too short or a rate too low for two segments
            string = _string_of(far, signal.string)
            both_sides = _TwoSegmentStream(self, replace(signal, string=string), size, is_known=True)
            reader = SidesReader(sample_rate=signal.sample_rate, size=size)
            return _EitherStream(estimate, both_sides, reader, knows_density=signal.string is not None)
        return _FarSegmentStream(estimate)

    def _refuse_set(self, names: Sequence[str], form: str, remedy: str) -> None:
        """Refuse options that the selected form does not use."""
        usual = {each.name: each.default for each in fields(self)}
        given = [name for name in names if getattr(self, name) != usual[name]]
        if given:
            raise InputError(
                f"{given[0]} with the form for {form}",
                f"no {given[0]}",
                f"leave it out, or use {remedy}",
            )

    def _far_segment(self, signal: Signal) -> FarSegment:
        string = signal.string
        length = self.length if self.length is not None or string is None else string.length
        known = self.open_frequency
        if known is None and string is not None:
            known = open_frequency(string)
        if length is None or known is None:
            missing = "length" if length is None else "open frequency"
            remedy = "give --length and --open-frequency"
            raise InputError(f"a string of unknown {missing}", "a known string", remedy)
        return FarSegment(
            length=length,
            open_frequency=known,
            calibration=self.calibration,
            reach=self.reach,
        )


class _TwoSegmentStream(Watching):
    """The two-sided form on one stream of windows; it follows the tuning of untouched windows.

    Where the pitch `is_known`, as one that the user gave, touches are stated before that tuning is measured.

    `opposed` says whether the last window had two segments, each louder at its own microphone. `detuned` says
    whether it came from a detuned string.
    """

    def __init__(self, options: ClosedForm, signal: Signal, size: Samples, *, is_known: bool = False) -> None:
        self._may_state, self._is_known = UntouchedStringCheck(signal.sample_rate), is_known
        self._microphones = Microphones()
        self._tuner, self._state = Tuner.of(signal, size), TunerState()
        self._untuned = self._reader = BothSegments.of(
            self._tuner.string,
            signal.sample_rate,
            law=options.tension_law,
            most_force=options.most_force,
            sensing_range=signal.sensing_range,
        )
        self.opposed = self.detuned = False
        turns = 2.0 * np.pi * self._tuner.nominal / signal.sample_rate * np.arange(size)
        self._reader.read(np.sin(np.outer((2.5, 5.0 / 3.0), turns)).astype(np.float32))  # compiles

    def __call__(self, window: Window) -> Estimates:
        before, self._state = self._state.tuning, self._tuner.step(self._state, window)
        tuning, self.opposed, self.detuned = self._state.tuning, False, False
        if tuning is None:
            self._reader = self._untuned
        elif tuning is not before:
            string = tuning.tuned(self._tuner.string)
            self._reader = self._untuned.tuned(string, tuning.frequency_std / tuning.frequency)
        may_state = self._may_state(window.start, heard=self._is_known or tuning is not None)
        inputs = self._microphones(window)
        reason = unusable_reason(window) or inputs.reason
        if reason:
            return both_segments.abstain(reason)
        reading = self._reader.read(window.samples)
        if reading is not None and reading.detuning and reading.contact > -MIN_UNTOUCHED:
            self.detuned = True
            return both_segments.abstain(detuned(reading.detuning, EXPECTED_PITCH))
        self.opposed = reading is not None and reading.is_opposed and reading.contact > MIN_CONTACT
        if reading is not None and reading.contact > MIN_CONTACT and not may_state:
            return both_segments.abstain(Reason.UNTOUCHED_MISSING)
        return self._reader.estimates(reading)

    @property
    def condition(self) -> Condition:
        """The pitch of the string, and its deviation from the known pitch."""
        tuning, inputs = self._state.tuning, self._microphones.inputs
        if tuning is None:
            return Condition(inputs=inputs)
        deviation = tuning.deviation(self._tuner.string)
        return Condition(open_frequency=tuning.open_frequency, deviation=deviation, inputs=inputs)


class _FarSegmentStream:
    """The far form on two channels: on both, or on one where the other is a copy or carries nothing."""

    def __init__(self, far: FollowedNote) -> None:
        self._far, self._microphones = far, Microphones()

    def __call__(self, window: Window) -> Estimates:
        one = self.single(window)
        return self._far(window) if one is None else self._far(one)

    def single(self, window: Window) -> Window | None:
        """Return the window of the only microphone in a stream; None where there may be two."""
        channel = self._microphones(window).channel
        return None if channel is None else replace(window, samples=window.samples[[channel]])


class _EitherStream:
    """The far form or the two-sided form, selected by the windows of a stream.

    The far form reads a single microphone.

    A window with two clear segments starts the two-sided form. The far form locates one note at both
    channels; it takes over once such windows outnumber windows with two segments. If a window may be either
    and the two forms disagree, there is no position.
    """

    def __init__(
        self, far: FollowedNote, both: _TwoSegmentStream, sides: SidesReader, *, knows_density: bool
    ) -> None:
        self._far, self._both, self._sides = far, both, sides
        self._one = _FarSegmentStream(far)
        self._knows_density = knows_density
        self._start, self._lead = -1, 0

    def __call__(self, window: Window) -> Estimates:
        if window.start <= self._start:
            self._lead = 0
        self._start, one = window.start, self._one.single(window)
        if one is not None:
            self._lead = 0
            return self._far(one)
        two_sided, one_sided = self._two_sided(window), self._far(window)
        if unusable_reason(window):
            return two_sided if self._lead > 0 else one_sided
        series = self._far.strongest
        sides = self._sides.read(window.samples, series) if series else NO_SIDES
        agree = series is not None and self._agree(series.frequency, two_sided)
        if series and sides.one_note and self._far.reader.is_inside(series.frequency):
            either = agree or self._is_open_note(series.frequency)
            self._count(0 if either else -1)
            if self._lead <= 0:
                return two_sided if agree and not self._same(one_sided, two_sided) else one_sided
            return two_sided if either else far_segment.abstain(Reason.NOTE_OR_SEGMENTS)
        if self._both.opposed:
            undecided = sides.undecided and one_sided["position"].valid
            self._count(0 if undecided else 1)
            if self._lead <= 0 and not agree:
                return far_segment.abstain(Reason.NOTE_OR_SEGMENTS)
        return two_sided if self._lead > 0 or self._both.detuned else one_sided

    def _two_sided(self, window: Window) -> Estimates:
        estimates = self._both(window)
        if self._knows_density:
            return estimates
        unknown = Estimate.abstain("N", Reason.UNKNOWN_DENSITY)
        return {**estimates, "tension": unknown, "force": unknown}

    def _agree(self, frequency: Hertz, two_sided: Estimates) -> bool:
        """Return whether a note at both channels is at the position of the two-sided form."""
        reader, position = self._far.reader, two_sided["position"]
        one_sided = position_from_far_segment(frequency, reader.open_frequency, reader.length)
        return position.valid and abs(one_sided - position.value) < SAME_POSITION * reader.length

    def _same(self, one_sided: Estimates, two_sided: Estimates) -> bool:
        distance = abs(one_sided["position"].value - two_sided["position"].value)
        return distance < SAME_POSITION * self._far.reader.length

    def _is_open_note(self, frequency: Hertz) -> bool:
        """Return whether a note may be the open string's, at its known or its measured tuning."""
        deviation, measured = (
            frequency / self._far.reader.open_frequency - 1.0,
            self._both.condition.deviation,
        )
        if measured is None:
            return abs(deviation) < RANGE
        return min(abs(deviation), abs(deviation - measured)) < OPEN_NOTE

    def _count(self, change: int) -> None:
        """Count one window for two segments or against them."""
        self._lead = min(max(self._lead + change, MIN_LEAD), MAX_LEAD)


def _string_of(far: FarSegment, known: StringParams | None) -> StringParams:
    """Return the string with a far form's pitch; an unknown string is ideally flexible."""
    string = known or StringParams(length=far.length, linear_density=DENSITY, tension=1.0)
    ratio = far.open_frequency * far.length / (open_frequency(string) * string.length)
    return replace(string, length=far.length, tension=string.tension * ratio**2)
