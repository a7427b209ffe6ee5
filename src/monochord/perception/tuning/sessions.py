"""The tuning of the string in each session of a dataset; features and forces are relative to it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal, StringParams, Window
from monochord.core.units import Newtons, Seconds
from monochord.perception.tuning.tuner import Tuner, TunerState
from monochord.physics.theory import open_frequency

if TYPE_CHECKING:  # a live run has no dataset
    from monochord.datasets.store import Dataset

BEGINNING: Seconds = 5.0
"""Length of a session's beginning that is analysed."""
WINDOW: Seconds = 0.1
LOWEST, HIGHEST = -0.015, 0.008
"""Relative deviations of a string's pitch within which a model reads it at its known pitch.

Within this range, readings at the known pitch are as accurate (docs/design/tuning-and-calibration.md), and a
model need not change with every drift. Outside, features use the measured tuning, offline and live."""
LENGTH_TOLERANCE = 0.02
"""Largest relative difference of a string's length from the training's."""


def estimate_tension(
    samples: Audio, sample_rate: int, string: StringParams | None, recorded: Newtons | None = None
) -> Newtons | None:
    """Return the tension of a session's string in N; None if it cannot be determined.

    A recorded tension takes precedence. Otherwise the tension is estimated from the untouched beginning of
    the sound.

    Parameters
    ----------
    samples
        Sound (channels, n) that begins untouched; touched windows are ignored.
    sample_rate
        In Hz.
    string
        The string's design; None for a session that does not name its string.
    recorded
        The tension in N that the session records; None without one.
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
    refused. For another wire, the result is the tension that gives the design's wire the same pitch.
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
        refuse_other_length(string, design)
    tension = estimate_tension(samples, rate, string or design, recorded)
    if tension is None or string is None or design is None:
        return tension
    return tension * design.linear_density / string.linear_density


def refuse_other_length(string: StringParams, trained: StringParams) -> None:
    """Raise `InputError` if a string's length differs from the string of a model's training."""
    if abs(string.length / trained.length - 1.0) > LENGTH_TOLERANCE:
        given = f"a string of {string.length:g} m for a model"
        raise InputError(given, f"{trained.length:g} m, as it was trained", "train a model for this sensor")


def retuned_strings(dataset: "Dataset", design: StringParams) -> Mapping[int, StringParams]:
    """Return the strings whose tuning differs from the design, by session number.

    A recorded tension counts however small its deviation. A tension that was estimated from sound counts only
    if a model would follow it: if its pitch deviates beyond `LOWEST` or `HIGHEST`. Smaller deviations are
    read at the design's pitch, as in the live loop.
    """
    strings: dict[int, StringParams] = {}
    for number, part in enumerate(dataset.manifest.parts):
        if part.tension is None or part.tension == design.tension:
            continue
        own = replace(design, tension=part.tension)
        off = open_frequency(own) / open_frequency(design) - 1.0
        if part.tuned == "recorded" or not LOWEST <= off <= HIGHEST:
            strings[number] = own
    return strings


def force_scales(dataset: "Dataset", design: StringParams) -> Floats:
    """Return the divisor (n,) that converts the force in each window to the design's tension.

    A light press F raises the open frequency by the share E A F^2 x (L - x) / (4 L^2 T^3), see
    `physics.theory.geometric_tension`. So forces with the same relative rise of the pitch scale as T^(3/2).
    """
    scales = np.ones(len(dataset))
    for number, string in retuned_strings(dataset, design).items():
        scales[dataset.session == number] = force_scale(string, design)
    return scales


def force_scale(string: StringParams, design: StringParams) -> float:
    """Return the ratio of forces with the same relative rise of the pitch: on `string` over on `design`."""
    return (string.tension / design.tension) ** 1.5
