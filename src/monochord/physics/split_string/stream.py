"""The modal route as a stream: from a ringing string to a block of samples and the string after it."""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats
from monochord.core.units import Samples
from monochord.physics.split_string import feedback
from monochord.physics.split_string.feedback import Complexes, Drivers
from monochord.physics.split_string.modes import ModalString, find_modes, plucked, response
from monochord.physics.split_string.segments import Segment
from monochord.physics.split_string.setup import PluckShape, SplitString


@dataclass(frozen=True, slots=True, kw_only=True)
class Ringing:
    """State of a ringing split string: everything its next sample depends on. Immutable.

    Between changes of the drive a mode's motion is a steady response and a free remainder. `q` in m and `v`
    in m/s (modes,) are the free part now; `steady` (2, modes) the complex response to each driver; `driven`
    (2, n) its velocity at the pickups, in m/s, for the whole interval of `n` samples, of which `elapsed` are
    past. `start` is the index of the next sample.
    """

    setup: SplitString
    sample_rate: int
    string: ModalString
    q: Floats
    v: Floats
    steady: Complexes
    driven: Floats
    drivers: Drivers
    elapsed: Samples
    start: Samples


def begin(setup: SplitString, sample_rate: int = 44100) -> Ringing:
    """Return the string at time zero, plucked or at rest according to the setup.

    Parameters
    ----------
    setup
        The setup; its nodes and time step are not used, except by the "printed" options, which depend on the
        node spacing.
    sample_rate
        Sample rate in Hz, 8 kHz to 384 kHz.

    Returns
    -------
    Ringing
        The state to pass to `advance`.

    Raises
    ------
    InputError
        If the sample rate is out of range.
    """
    if not 8000 <= sample_rate <= 384000:
        raise InputError(f"sample rate {sample_rate} Hz", "8000 to 384000 Hz")
    string = find_modes(setup, sample_rate)
    q = plucked(setup.pluck if setup.initial == "plucked" else None, string)
    drivers = feedback.begin(setup.drive, sample_rate)
    return _drive(setup, sample_rate, string, q, np.zeros_like(q), drivers, 0)


def advance(ringing: Ringing, samples: Samples) -> tuple[Floats, Ringing]:
    """Return the next `samples` velocities A, (2, samples) in m/s, and the state after them.

    The samples are identical, bit for bit, for any block size.
    """
    parts = [np.zeros((2, 0))]
    while samples > 0:
        part = min(samples, ringing.driven.shape[1] - ringing.elapsed)
        velocity, ringing = _ring_on(ringing, part)
        parts.append(velocity)
        samples -= part
        if ringing.elapsed == ringing.driven.shape[1]:
            ringing = _follow_and_drive(ringing)
    return np.concatenate(parts, axis=1), ringing


def touch(ringing: Ringing, contact: Contact | None, *, pluck: PluckShape | None = None) -> Ringing:
    """Return the same string under another touch, or none, from its next sample on.

    Shape and velocity are projected onto the modes of the new segments; see `project_motion`. A finger that
    comes or goes quickly also plucks the string: `pluck` is added to each new segment. The drivers keep their
    tone until they sense another one at the next whole hop of the sample clock.
    """
    setup = replace(ringing.setup, contact=contact)
    string = find_modes(setup, ringing.sample_rate)
    drivers = feedback.advance(ringing.drivers, ringing.elapsed / ringing.sample_rate)
    q, v = project_motion(ringing.string, *_motion(ringing, drivers), string)
    return _drive(setup, ringing.sample_rate, string, q + plucked(pluck, string), v, drivers, ringing.start)


def project_motion(old: ModalString, q: Floats, v: Floats, new: ModalString) -> tuple[Floats, Floats]:
    """Return the modal motion of a string whose segments have just changed.

    Shape and velocity of the whole string are sampled and projected onto the new modes. Where a touch newly
    clamps the string, it first brings it to zero there along the static triangle (a straight ramp to either
    support), as under a finger that presses slowly against the vibration; the remaining shape and the whole
    velocity are unchanged. A release adds nothing. Motion above the audible modes is lost.

    Both strings are of equal length. `q` in m and `v` in m/s are (modes,) of the old one, then of the new.
    """
    parts: list[tuple[Floats, Floats]] = []
    for segment, count in zip(new.segments, new.counts, strict=True):
        # At midpoints the sine sum is an exact quadrature for all that the modes can hold.
        size = max(8 * count, 1)
        local = (np.arange(size, dtype=np.float64) + 0.5) * (segment.length / size)
        shape, velocity = _sampled(old, q, v, segment.origin + segment.direction * local)
        tip, _ = _sampled(old, q, v, np.array([segment.origin + segment.direction * segment.length]))
        waves = _waves(segment, count, local) * (2.0 / size)
        parts.append(((shape - tip * local / segment.length) @ waves, velocity @ waves))
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _sampled(string: ModalString, q: Floats, v: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return displacement and velocity at positions along the whole string."""
    shape, velocity = np.zeros(places.size), np.zeros(places.size)
    first = 0
    for segment, count in zip(string.segments, string.counts, strict=True):
        local = (places - segment.origin) * segment.direction
        inside = (local >= 0.0) & (local <= segment.length)
        waves = _waves(segment, count, local[inside])
        shape[inside] = waves @ q[first : first + count]
        velocity[inside] = waves @ v[first : first + count]
        first += count
    return shape, velocity


def _waves(segment: Segment, count: int, local: Floats) -> Floats:
    return np.sin(np.outer(local, np.arange(1, count + 1)) * (pi / segment.length))


def _drive(
    setup: SplitString,
    sample_rate: int,
    string: ModalString,
    q: Floats,
    v: Floats,
    drivers: Drivers,
    start: Samples,
) -> Ringing:
    """Begin an interval of constant drive: split the motion into steady response and free remainder."""
    hop = max(1, round(setup.drive.hop * sample_rate))
    steady = response(string.audible, drivers.frequency)
    omega = 2j * pi * drivers.frequency * drivers.active
    at_pickups = (
        string.audible.shape @ steady.T
        + string.ultrasonic.shape @ response(string.ultrasonic, drivers.frequency).T
    )
    driven = (at_pickups * omega) @ drivers.phasor(hop - start % hop, 1.0 / sample_rate)
    q_steady, v_steady = _steady_motion(steady, drivers)
    return Ringing(
        setup=setup,
        sample_rate=sample_rate,
        string=string,
        q=q - q_steady,
        v=v - v_steady,
        steady=steady,
        driven=np.ascontiguousarray(driven.imag),
        drivers=drivers,
        elapsed=0,
        start=start,
    )


def _steady_motion(steady: Complexes, drivers: Drivers) -> tuple[Floats, Floats]:
    """Return displacement and velocity of the steady response at the drivers' phase."""
    turned = np.exp(1j * drivers.phase) @ np.stack((steady, (2j * pi * drivers.frequency)[:, None] * steady))
    return turned[0].imag, turned[1].imag


def _motion(ringing: Ringing, drivers: Drivers) -> tuple[Floats, Floats]:
    """Return the present displacement and velocity, free and steady together.

    `drivers` are the present ones.
    """
    q_steady, v_steady = _steady_motion(ringing.steady, drivers)
    return ringing.q + q_steady, ringing.v + v_steady


def _ring_on(ringing: Ringing, samples: Samples) -> tuple[Floats, Ringing]:
    """Continue ringing within an interval of constant drive."""
    from monochord.physics.split_string.kernels import ring  # noqa: PLC0415  (numba loads on use)

    q, v = ringing.q.copy(), ringing.v.copy()
    velocity = ringing.driven[:, ringing.elapsed : ringing.elapsed + samples].copy()
    ring(ringing.string.propagator, ringing.string.audible.shape, q, v, velocity)
    after = replace(
        ringing,
        q=q,
        v=v,
        drivers=feedback.sense(ringing.drivers, velocity),
        elapsed=ringing.elapsed + samples,
        start=ringing.start + samples,
    )
    return velocity, after


def _follow_and_drive(ringing: Ringing) -> Ringing:
    drivers = feedback.advance(ringing.drivers, ringing.elapsed / ringing.sample_rate)
    q, v = _motion(ringing, drivers)
    time = ringing.start / ringing.sample_rate
    drivers = feedback.retune(drivers, ringing.setup, ringing.sample_rate, time)
    return _drive(ringing.setup, ringing.sample_rate, ringing.string, q, v, drivers, ringing.start)
