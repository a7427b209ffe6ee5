"""The string in each session of a dataset: features, positions and forces are relative to it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal, StringParams, Window
from monochord.core.units import Newtons, Seconds
from monochord.perception.tuning.tuner import Tuner, TunerState
from monochord.physics.sensors import refuse_other_length, with_length
from monochord.physics.theory import open_frequency

if TYPE_CHECKING:  # a live run has no dataset
    from monochord.datasets.manifest import DatasetSession
    from monochord.datasets.store import Dataset

BEGINNING: Seconds = 5.0
"""Length of a session's beginning that is analysed."""
WINDOW: Seconds = 0.1
LOWEST, HIGHEST = -0.015, 0.008
"""Relative deviations of a string's pitch within which a model reads it at its known pitch.

Within this range, readings at the known pitch are as accurate (docs/design/tuning-and-calibration.md), and a
model need not change with every drift. Outside, features use the measured tuning, offline and live."""


def estimate_tension(
    samples: Audio, sample_rate: int, string: StringParams | None, recorded: Newtons | None = None
) -> Newtons | None:
    """Return the tension of a session's string in N; None if it cannot be determined.

    A recorded tension takes precedence. Otherwise the tension is estimated from the untouched beginning of
    the sound (channels, n); touched windows are ignored. `string` is the design; None for a session that
    names none.
    """
    if string is None or recorded is not None:
        return recorded
    size = round(WINDOW * sample_rate)
    try:
        tuner = Tuner.of(Signal(sample_rate=sample_rate, channels=len(samples), string=string), size)
    except InputError:
        return None
    state = TunerState()
    for start in range(0, min(samples.shape[1], round(BEGINNING * sample_rate)) - size + 1, size):
        piece = samples[:, start : start + size]
        state = tuner.step(state, Window(samples=piece, start=start, sample_rate=sample_rate))
    return None if state.tuning is None else state.tuning.tension(string)[0]


def tension_estimator(
    design: StringParams | None,
) -> Callable[[Audio, int, StringParams | None, Newtons | None], Newtons | None]:
    """Return a variant of `estimate_tension` for sessions of a model's design; workers can receive it.

    A session that names no string has the design's string. A session with a string of another length is
    refused, beyond what a string may be off its design. The result is the tension that gives the design's
    wire the same pitch at the session's length, `monochord.datasets.manifest.DatasetSession.length`.
    """
    return partial(_tension_for, design)


def _tension_for(
    design: StringParams | None,
    samples: Audio,
    rate: int,
    string: StringParams | None,
    recorded: Newtons | None = None,
) -> Newtons | None:
    if string and design:
        refuse_foreign(string, design)
    tension = estimate_tension(samples, rate, string or design, recorded)
    if tension is None or string is None or design is None:
        return tension
    return tension * design.linear_density / string.linear_density


def refuse_foreign(string: StringParams, trained: StringParams) -> None:
    """Raise `InputError` if a string's length is too far off that of a model's training."""
    remedy = "train a model for this sensor"
    refuse_other_length(string.length, trained.length, "a model for a string", remedy)


def string_of(part: "DatasetSession", design: StringParams, *, measured: bool) -> StringParams:
    """Return a session's string: the design's wire at the session's tuning and length, where they are known.

    With `measured`, a length counts that was measured with a ruler but that the session's string does not
    have.
    """
    length = part.length or design.length
    string = with_length(design, length) if part.tension is None else replace(design, tension=part.tension)
    string = replace(string, length=length)
    return with_length(string, part.measured_length) if measured and part.measured_length else string


def retuned_strings(dataset: "Dataset", design: StringParams) -> Mapping[int, StringParams]:
    """Return the strings whose tuning or length differs from the design, by session number.

    A recorded tension counts however small its deviation. A tension that was estimated from sound counts only
    if a model would follow it: if its pitch deviates beyond `LOWEST` or `HIGHEST`. Smaller deviations are
    read at the design's pitch, as in the live loop. A length that was measured always counts.
    """
    strings: dict[int, StringParams] = {}
    for number, part in enumerate(dataset.manifest.parts):
        string = string_of(part, design, measured=True)
        off = open_frequency(string) / open_frequency(design) - 1.0
        if part.tuned != "recorded" and LOWEST <= off <= HIGHEST:
            string = with_length(design, string.length)
        if string != design:
            strings[number] = string
    return strings


def at_length_of(string: StringParams, design: StringParams) -> StringParams:
    """Return the string of the design's length with the pitch of `string`, to which features are relative."""
    return design if string == with_length(design, string.length) else with_length(string, design.length)


def force_scales(dataset: "Dataset", design: StringParams) -> Floats:
    """Return the divisor (n,) that converts the force in each window to the design's string."""
    scales = np.ones(len(dataset))
    for number, string in retuned_strings(dataset, design).items():
        scales[dataset.rows_of(number)] = force_scale(string, design)
    return scales


def length_scales(dataset: "Dataset", design: StringParams) -> Floats:
    """Return the divisor (n,) that converts the position in each window to the design's length."""
    scales = np.ones(len(dataset))
    for number, string in retuned_strings(dataset, design).items():
        scales[dataset.rows_of(number)] = string.length / design.length
    return scales


def force_scale(string: StringParams, design: StringParams) -> float:
    """Return the ratio of forces with the same relative rise of the pitch: on `string` over on `design`.

    A light press F at x raises the open frequency by the share E A F^2 x (L - x) / (4 L^2 T^3), see
    `physics.theory.geometric_tension`. So at the same x / L, F scales as T^(3/2), whatever the length. At the
    same pitch T is proportional to L^2, and F to L^3.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> from monochord.physics.theory import geometric_tension
    >>> design = load_string("prototype").string
    >>> longer = with_length(design, 1.01 * design.length)
    >>> round(force_scale(longer, design), 6), round(1.01**3, 6)
    (1.030301, 1.030301)
    >>> force = 0.5 * force_scale(longer, design)
    >>> rise = geometric_tension(design, 0.08, 0.5) / design.tension - 1.0
    >>> longer_rise = geometric_tension(longer, 0.0808, force) / longer.tension - 1.0
    >>> round(longer_rise / rise, 9)
    1.0
    """
    return (string.tension / design.tension) ** 1.5
