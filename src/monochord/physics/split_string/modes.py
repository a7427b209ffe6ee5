"""A split string as modes: damped oscillators, solved exactly between changes of the drive."""

from dataclasses import dataclass
from math import pi

import numpy as np

from monochord.core.types import Floats
from monochord.physics.split_string.feedback import Complexes
from monochord.physics.split_string.segments import (
    Segment,
    drive_density,
    gaussian_modes,
    pluck_amplitudes,
    split,
    support,
)
from monochord.physics.split_string.setup import PluckShape, SplitString

MAX_AUDIBLE_SHARE = 0.456
"""Share of the sample rate up to which modes are audible: the cutoff of the FDTD route's resampler."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Modes:
    """Modes of all segments: q'' + decay q' + frequency^2 q = push of driver 1 + push of driver 2.

    `frequency` and `decay` (modes,) are in rad/s and 1/s. `push` (2, modes) is the acceleration in m/s^2 by
    each driver at full swing, `shape` (2, modes) the mode's value at each pickup; both are zero on another
    segment.
    """

    frequency: Floats
    decay: Floats
    push: Floats
    shape: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalString:
    """The relevant modes: `audible` ones advance in time, `ultrasonic` ones only respond to the drive.

    `propagator` is one sample's `free_motion` of the audible modes; `counts` is the number per segment, zero
    for a segment too short to be audible.
    """

    segments: tuple[Segment, ...]
    counts: tuple[int, ...]
    audible: Modes
    ultrasonic: Modes
    propagator: Floats


def find_modes(setup: SplitString, sample_rate: int) -> ModalString:
    """Return the relevant modes at a sample rate.

    These are the modes in the audio band, and the few above it that the drivers excite, since a driver's
    profile is a Gaussian.
    """
    segments = split(setup)
    fundamentals = [segment.speed / (2.0 * segment.length) for segment in segments]
    counts = tuple(int(MAX_AUDIBLE_SHARE * sample_rate / f) for f in fundamentals)
    ends = [gaussian_modes(setup.drive.width, segment.length) for segment in segments]
    audible = _join([_modes(setup, s, 1, count) for s, count in zip(segments, counts, strict=True)])
    ultrasonic = [_modes(setup, s, n + 1, end) for s, n, end in zip(segments, counts, ends, strict=True)]
    return ModalString(
        segments=segments,
        counts=counts,
        audible=audible,
        ultrasonic=_join(ultrasonic),
        propagator=free_motion(audible.frequency, audible.decay, 1.0 / sample_rate),
    )


def free_motion(frequency: Floats, decay: Floats, time: float) -> Floats:
    """Return the free motion of damped oscillators over `time` s, (4, modes): q of q, q of v, v of q, v of v.

    It solves q'' + g q' + w^2 q = 0 for any `decay` g >= 0 and `frequency` w > 0 in rad/s: underdamped,
    overdamped and critically damped.

    A quarter period turns a displacement into velocity:

    >>> free_motion(np.array([2 * np.pi]), np.zeros(1), 0.25).round(6)[:, 0]
    array([ 0.      ,  0.159155, -6.283185,  0.      ])
    """
    half = decay / 2.0
    turn = np.sqrt(np.asarray(frequency**2 - half**2, dtype=complex))
    # Both roots decay, so neither exponential can overflow, however overdamped.
    one: Complexes = np.exp((1j * turn - half) * time)
    other: Complexes = np.exp((-1j * turn - half) * time)
    critical = np.abs(turn) * time < 1e-6
    sine = (one - other) / np.where(critical, 1.0, 2j * turn)
    sine = np.where(critical, time * np.exp(-half * time), sine.real)
    cosine = (one.real + other.real) / 2.0
    return np.array([cosine + half * sine, sine, -(frequency**2) * sine, cosine - half * sine])


def response(modes: Modes, frequencies: Floats) -> Complexes:
    """Return the steady response (2, modes) of each mode to each driver, complex, in m.

    q = Im(Q exp(i theta)), Q = push / (w_n^2 - w^2 + i g w), for a drive sin(theta) with theta' = w. It is
    zero for a driver at 0 Hz.
    """
    w = 2.0 * pi * frequencies[:, None]
    amplitude = modes.push / (modes.frequency**2 - w**2 + 1j * modes.decay * w)
    return amplitude * np.sign(w)


def plucked(pluck: PluckShape | None, string: ModalString) -> Floats:
    """Return the displacements (audible,) in m of modes with every segment plucked, or at rest."""
    if pluck is None:
        return np.zeros(sum(string.counts))
    amplitudes = zip(string.segments, string.counts, strict=True)
    return np.concatenate([pluck_amplitudes(pluck, *each) for each in amplitudes])


def _modes(setup: SplitString, segment: Segment, first: int, last: int) -> Modes:
    wavenumbers: Floats = np.arange(first, last + 1, dtype=np.float64) * (pi / segment.length)
    push, shape = np.zeros((2, wavenumbers.size)), np.zeros((2, wavenumbers.size))
    push[segment.channels] = [_push(setup, segment, place, wavenumbers) for place in segment.drivers]
    shape[segment.channels] = np.sin(np.outer(segment.pickups, wavenumbers))
    frequency = wavenumbers * segment.speed
    return Modes(
        frequency=frequency, decay=np.full_like(frequency, segment.decay_rate), push=push, shape=shape
    )


def _push(setup: SplitString, segment: Segment, place: float, wavenumbers: Floats) -> Floats:
    nodes, weights = support(setup.drive, segment, place)
    density = weights * drive_density(setup.drive, segment, place, nodes)
    return 2.0 / (segment.linear_density * segment.length) * (density @ np.sin(np.outer(nodes, wavenumbers)))


def _join(parts: list[Modes]) -> Modes:
    return Modes(
        frequency=np.concatenate([part.frequency for part in parts]),
        decay=np.concatenate([part.decay for part in parts]),
        push=np.concatenate([part.push for part in parts], axis=1),
        shape=np.concatenate([part.shape for part in parts], axis=1),
    )
