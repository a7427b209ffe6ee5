"""Windows of rendered sessions, as the study `one_reader` learns from them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from studies._reader_network import Cells

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Indices, StringParams
from monochord.datasets import FAULTS, Augmentation, Fault
from monochord.dsp import NOISES
from monochord.lab import Assignment, Rendering, render
from monochord.perception.closed_form import SpectrumAnalyser, cells_of, prominences, string_model

KINDS = ("ordinary", *FAULTS, "two touches", "driver dead", "very soft")
GROUPS = {"two_touches": "two touches", "driver_": "driver dead", "foam": "very soft"}
"""Kinds of the windows of plan groups, by the beginning of the group's name."""
WINDOW, HOP = 4410, 1103
SETTLING = 0.3
"""Time after the drivers are switched on, in s, whose windows are left out."""
QUIETEST = 1.0e-3
"""Rms in full scale below which a window is silent."""
FAULTY_SHARE, NOISY_SHARE, RATIOS = 0.12, 0.4, (5.0, 30.0)
PITCH_STD, UNTUNED_SHARE, UNTUNED = 0.0015, 0.15, (-0.008, 0.015)
"""Error of the pitch that cells are relative to: deviation, share of windows with a larger one, its range."""
MAX_DETUNING, CLUSTER, MIN_LINES, MAX_PARTIAL = 0.04, 0.002, 8, 8
"""Pitch of a session: largest share off its design, width of the lines' cluster, fewest lines, partials."""
BANDS = ((20.0, 150.0), (150.0, 500.0)), ((500.0, 2e3), (2e3, 6e3), (6e3, 12e3), (12e3, 18e3))
"""Bands in Hz whose power is measured, and those whose floor between the lines is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Windows (n,) of sessions. Positions are over the length of the string, frequencies over its pitch.

    `cells` (n, 4, cells) as bytes, `lines` and `power` (n, 2, 8) of the strongest lines, `spectrum`
    (n, 2, bins) as log10 of the power, whose bins are `spacing` apart, and `levels` (n, 14).
    """

    cells: Cells
    lines: Floats
    power: Floats
    spectrum: NDArray[np.float16]
    spacing: Floats
    stiffness: Floats
    levels: Floats
    pitch_error: Floats
    contact: Floats
    position: Floats
    force: Floats
    slip: Floats
    kind: Indices
    build: Indices
    length: Floats
    mount: NDArray[np.str_]

    def of(self, rows: Indices) -> "Windows":
        """Return some of the windows."""
        return Windows(**{each.name: getattr(self, each.name)[rows] for each in fields(self)})

    @classmethod
    def joined(cls, parts: Sequence["Windows"]) -> "Windows":
        """Return the windows of all parts."""
        names = [each.name for each in fields(cls)]
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def windows_of(session: Assignment, count: int, seed: int) -> Windows | None:
    """Return up to `count` touched windows of a session, and a third as many untouched; None without any."""
    try:
        sound = render(session)
    except InputError:  # a pose that the object cannot take
        return None
    random = np.random.default_rng((seed, *session.name.encode()))
    starts = np.arange(round(SETTLING * sound.sample_rate), sound.microphones.shape[1] - WINDOW, HOP)
    share, spans = _touched(sound, starts)
    touched, free = np.flatnonzero(share == 1.0), np.flatnonzero(share == 0.0)
    rms = [float(np.sqrt(np.mean(sound.microphones[:, at : at + WINDOW] ** 2))) for at in starts[free]]
    free = free[np.array(rms) > QUIETEST]
    string = session.sensor().string
    pitch = _pitch(sound, starts[free], string)
    if pitch is None or not len(touched):
        return None
    string = replace(string, tension=string.tension * pitch**2)
    chosen = [
        random.choice(rows, min(most, len(rows)), replace=False)
        for rows, most in ((touched, count), (free, count // 3))
    ]
    rows = np.sort(np.concatenate(chosen))
    noise = Augmentation(kinds=tuple(NOISES), share=NOISY_SHARE, ratios=RATIOS)
    group = next((kind for name, kind in GROUPS.items() if session.group.name.startswith(name)), KINDS[0])
    parts = list[Windows]()
    for row in rows.tolist():
        at = int(starts[row])
        window = noise(sound.microphones[np.newaxis, :, at : at + WINDOW], [at], seed=seed)
        kind = group
        if group == KINDS[0] and random.random() < FAULTY_SHARE:
            kind = FAULTS[random.integers(len(FAULTS))]
            window = Fault(kind=kind)(window, [at], seed=seed)
        is_untuned = random.random() < UNTUNED_SHARE
        error = random.uniform(*UNTUNED) if is_untuned else random.normal(0.0, PITCH_STD)
        labels = _labels(sound, spans[row], string, touched=share[row] == 1.0)
        parts.append(
            Windows(
                **_spectra(window[0], string, sound.sample_rate, error),
                **labels,
                kind=np.array([KINDS.index(kind)]),
                build=np.array([session.build or 0]),
                mount=np.array([session.mount or "none"]),
            )
        )
    return Windows.joined(parts)


def _touched(sound: Rendering, starts: Indices) -> tuple[Floats, list[slice]]:
    """Return the touched share of each window (n,), and its labels."""
    time = sound.label_time - sound.begin
    first = np.searchsorted(time, starts / sound.sample_rate)
    last = np.searchsorted(time, (starts + WINDOW) / sound.sample_rate)
    total = np.concatenate(([0.0], np.cumsum(np.nan_to_num(sound.labels["contact"]))))
    share = (total[last] - total[first]) / np.maximum(last - first, 1)
    return share, [slice(*span) for span in zip(first.tolist(), last.tolist(), strict=True)]


def _labels(sound: Rendering, span: slice, string: StringParams, *, touched: bool) -> dict[str, Any]:
    labels = {name: values[span] for name, values in sound.labels.items()}
    position = float(np.nanmean(labels["position"])) / string.length if touched else np.nan
    return {
        "contact": np.array([1.0 if touched else 0.0]),
        "position": np.array([position]),
        "force": np.array([float(np.nanmean(labels["force"])) if touched else 0.0]),
        "slip": np.array([float(np.nanmean(labels["slip"]) > 0.5) if touched else 0.0]),
        "length": np.array([string.length]),
    }


def _analyser(string: StringParams, sample_rate: int) -> SpectrumAnalyser:
    model = string_model(string)
    return SpectrumAnalyser(string=string, sample_rate=sample_rate, size=WINDOW, model=model)


def _pitch(sound: Rendering, starts: Indices, string: StringParams) -> float | None:
    """Return the pitch that the untouched windows' lines agree on, over the design's; None without one."""
    analyser, found = _analyser(string, sound.sample_rate), list[float]()
    stiffness = analyser.model.stiffness / string.length**2
    for at in starts.tolist():
        _, _, _, (frequency, power) = analyser.transformed(sound.microphones[:, at : at + WINDOW])
        ratio = frequency[:, :4].ravel() / analyser.nominal
        loud = (power[:, :4] > 1e-3 * power[:, :1]).ravel() & (ratio > 0.0)
        number = np.maximum(np.round(ratio), 1.0)
        off = ratio / (number * np.sqrt(1.0 + stiffness * number**2)) - 1.0
        found += off[loud & (number <= MAX_PARTIAL) & (np.abs(off) < MAX_DETUNING)].tolist()
    values = np.sort(found)
    if len(values) < MIN_LINES:
        return None
    count = np.searchsorted(values, values + CLUSTER) - np.arange(len(values))
    first = int(count.argmax())
    return 1.0 + float(np.median(values[first : first + count[first]]))


def _spectra(window: Audio, string: StringParams, rate: int, error: float) -> dict[str, Any]:
    """Return what is measured of a window, relative to a pitch that is off by the share `error`."""
    analyser = _analyser(replace(string, tension=string.tension * (1.0 + error) ** 2), rate)
    _, _, power, (frequency, height) = analyser.transformed(window)
    above = prominences(power, height)
    cells = cells_of(power, height, above, analyser.bin_spacing, analyser.model)
    hertz = np.arange(power.shape[1]) * analyser.bin_spacing
    inside = [[power[:, (hertz >= low) & (hertz < high)] for low, high in bands] for bands in BANDS]
    levels = [np.log10(np.mean(window.astype(float) ** 2, axis=1) + 1e-12)]
    levels += [np.log10(band.sum(axis=1) + 1e-14) for band in inside[0]]
    levels += [np.log10(np.median(band, axis=1) + 1e-16) for band in inside[1]]
    return {
        "cells": np.round(255.0 * cells).astype(np.uint8)[np.newaxis],
        "lines": (frequency / analyser.nominal)[np.newaxis],
        "power": height[np.newaxis],
        "spectrum": np.log10(power + 1e-16).astype(np.float16)[np.newaxis],
        "spacing": np.array([analyser.bin_spacing / analyser.nominal]),
        "stiffness": np.array([analyser.model.stiffness / string.length**2]),
        "levels": np.concatenate(levels)[np.newaxis],
        "pitch_error": np.array([error]),
    }
