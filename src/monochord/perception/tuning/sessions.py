"""The strings of a dataset's sessions, each as it is tuned: what features and forces are relative to."""

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
"""How much of a session is listened to."""
WINDOW: Seconds = 0.1
LOWEST, HIGHEST = -0.015, 0.008
"""Shares by which a string may lie off its known pitch for a model that reads it as of that pitch.

Beyond, features are of the string as tuned, offline and live. Within, modes are read as well by the known
pitch (docs/design/tuning-and-calibration.md), and a model need not change with every drift."""

LENGTH_TOLERANCE = 0.02
"""Share by which a string's length may differ from that of the training."""


def estimate_tension(
    samples: Audio, sample_rate: int, string: StringParams | None, recorded: Newtons | None = None
) -> Newtons | None:
    """Return the tension in N of a session's string: as recorded, or by the untouched beginning of its sound.

    None where neither shows it.

    Parameters
    ----------
    samples
        Sound (channels, n), untouched at its beginning; touched windows do not count.
    sample_rate
        In Hz.
    string
        The string as designed; None of a session that does not name it.
    recorded
        The tension with which it was recorded as tuned; None where it was not.
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
    """Return `estimate_tension` for sessions that a model of this design reads; workers can have it too.

    Those that name no string are of the design; those on a string of another length are refused. Of another
    wire the tension is that at which the design's wire has the same pitch.
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
    """Raise `InputError` where a string is longer or shorter than that of a model's training."""
    if abs(string.length / trained.length - 1.0) > LENGTH_TOLERANCE:
        given = f"a string of {string.length:g} m for a model"
        raise InputError(given, f"{trained.length:g} m, as it was trained", "train one for this sensor")


def retuned_strings(dataset: "Dataset", design: StringParams) -> Mapping[int, StringParams]:
    """Return the strings that are tuned otherwise than the design, by the number of their session.

    One that was recorded as tuned counts as such. One whose tension was estimated from sound counts where
    it lies so far off that a model follows it: nearer ones are read as of the design, live too.
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
    """Return (n,) by what a force of each window is divided to be as of the design's tension.

    A light press F raises the open frequency by the share E A F^2 x (L - x) / (4 L^2 T^3): what sounds alike
    in relative terms is a force that goes as T^(3/2). It is `physics.theory.geometric_tension`.
    """
    scales = np.ones(len(dataset))
    for number, string in retuned_strings(dataset, design).items():
        scales[dataset.session == number] = force_scale(string, design)
    return scales


def force_scale(string: StringParams, design: StringParams) -> float:
    """Return a force on a string over the one that sounds alike, in relative terms, on the design."""
    return (string.tension / design.tension) ** 1.5
