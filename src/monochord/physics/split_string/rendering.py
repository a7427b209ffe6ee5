"""Simulates a setup by one of three routes through the same physics, and finds its two peaks."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil, nan
from typing import Literal, TypeAlias, get_args

import numpy as np

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Floats
from monochord.core.units import Hertz, Samples, Seconds
from monochord.physics.split_string import feedback, stream
from monochord.physics.split_string.feedback import lines
from monochord.physics.split_string.grid import Kernel, lay_out, leapfrog, time_step
from monochord.physics.split_string.segments import split
from monochord.physics.split_string.setup import SplitString
from monochord.physics.theory import mixing_matrix

Route: TypeAlias = Literal["fdtd", "modal", "reference"]

MIN_DRIVER_RATE = 40e3
"""In Hz: the drivers sense velocity at the lowest integer fraction of the grid's rate from this on.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedSound:
    """Two segments' velocities, and what the microphones pick up of them.

    Parameters
    ----------
    segments
        Velocities A (2, n) in m/s at the pickups.
    microphones
        B = mixing A, (2, n), in m/s.
    sample_rate
        Sample rate in Hz.
    mixing
        (2, 2), Eq. 5.
    drive_frequencies
        (2, intervals) in Hz: frequency of each driver during each interval; NaN while silent.
    drive_interval
        Length of an interval in s.
    """

    segments: Floats
    microphones: Floats
    sample_rate: int
    mixing: Floats
    drive_frequencies: Floats
    drive_interval: Seconds

    @property
    def duration(self) -> Seconds:
        """Length of the recording."""
        return self.segments.shape[1] / self.sample_rate


def simulate(
    setup: SplitString, seconds: Seconds, *, route: Route = "fdtd", sample_rate: int = 44100
) -> SimulatedSound:
    """Simulate a split string from time zero.

    Parameters
    ----------
    setup
        String, touch, drive and grid.
    seconds
        Duration in s, above 0.
    route
        "fdtd": the paper's leapfrog on N nodes per segment, compiled. "reference": the same in NumPy, over a
        hundred times slower, equal to rounding. "modal": each mode as a damped oscillator solved exactly over
        each interval of constant drive; a finer grid converges to it.
    sample_rate
        Of the recording, in Hz. The grid runs at 1 / dt; its velocities are brought to this rate by a
        linear-phase resampler (soxr, "HQ": flat to 0.01 dB up to 0.456 of the rate, more than 120 dB
        down from 0.5), so nothing folds back. The modal route follows the modes up to the
        same 0.456 of the rate.

    Returns
    -------
    SimulatedSound
        Velocities and microphones.

    Raises
    ------
    InputError
        If the route is unknown, the duration is not above zero, the sample rate is out of range, or the time
        step is not below alpha dxi / v on every segment.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, Eq. 3-13 and appendix.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> appendix = load_string("appendix")
    >>> setup = SplitString(string=appendix.string, contact=appendix.contact)
    >>> simulate(setup, 0.1, route="modal").microphones.shape
    (2, 4410)
    """
    if route not in get_args(Route):
        raise InputError(f"route '{route}'", ", ".join(get_args(Route)), did_you_mean(route, get_args(Route)))
    if not 0.0 < seconds <= 3600.0:
        raise InputError(f"{seconds:g} seconds", "above 0, at most 3600")
    if not 8000 <= sample_rate <= 384000:
        raise InputError(f"sample rate {sample_rate} Hz", "8000 to 384000 Hz")
    count = max(1, round(seconds * sample_rate))
    velocity, tones = _ROUTES[route](setup, count, sample_rate)
    mixing = mixing_matrix(*setup.mixing)
    intervals = ceil(seconds / setup.drive.hop - 1e-9)
    return SimulatedSound(
        segments=velocity,
        microphones=mixing @ velocity,
        sample_rate=sample_rate,
        mixing=mixing,
        drive_frequencies=np.array(tones[:intervals]).T,
        drive_interval=setup.drive.hop,
    )


def peaks(recording: SimulatedSound, *, settle: Seconds = 0.15) -> tuple[Hertz, Hertz]:
    """Return the dominant frequency of each segment from the microphones, after the transient.

    The mixing of Eq. 5 is inverted, since the louder segment would otherwise dominate both microphones; then
    each channel's strongest line under a Hann window is interpolated.

    A driver that closes its phase sustains a segment slightly above its own frequency f, since its other
    modes answer the drive too: by about f / (2 Q^2), with Q = 2 pi f mu / d. That is 0.01 % on the appendix's
    string, and 0.3 % on the longer side of a bass string whose Q is 13; it is the same however long the
    recording is.

    Parameters
    ----------
    recording
        From `simulate`.
    settle
        Time to skip at the beginning, in s; at most half of a short recording.

    Returns
    -------
    f1, f2
        In Hz; NaN for a silent segment.

    Raises
    ------
    InputError
        If the mixing cannot be inverted (l1 + l2 = 1), or the recording is shorter than 10 ms.

    References
    ----------
    Yi, Xing, Manchester and Fazeli, Sound of Touch, "Predicted frequency trends and feature
    extraction".

    Examples
    --------
    >>> from monochord.physics.split_string import SplitString, simulate
    >>> from monochord.physics.strings import load_string
    >>> appendix = load_string("appendix")
    >>> setup = SplitString(string=appendix.string, contact=appendix.contact)
    >>> f1, f2 = peaks(simulate(setup, 0.4, route="modal"))
    >>> round(f1), round(f2)
    (695, 374)
    """
    if abs(np.linalg.det(recording.mixing)) < 1e-6:
        raise InputError("mixing l1 + l2 = 1", "microphones that pick up the segments differently")
    if recording.duration < 0.01:
        raise InputError(f"recording of {recording.duration:g} s", "0.01 s or more")
    skip = round(min(settle, recording.duration / 2.0) * recording.sample_rate)
    unmixing: Floats = np.linalg.inv(recording.mixing).astype(np.float64)
    frequency, _ = lines(unmixing @ recording.microphones[:, skip:], recording.sample_rate)
    return float(frequency[0]) or nan, float(frequency[1]) or nan


def _modal(setup: SplitString, count: Samples, sample_rate: int) -> tuple[Floats, list[Floats]]:
    ringing = stream.begin(setup, sample_rate)
    hop = max(1, round(setup.drive.hop * sample_rate))
    parts: list[Floats] = []
    tones: list[Floats] = []
    for start in range(0, count, hop):
        tones.append(ringing.drivers.tone)
        velocity, ringing = stream.advance(ringing, min(hop, count - start))
        parts.append(velocity)
    return np.concatenate(parts, axis=1), tones


def _fdtd(setup: SplitString, count: Samples, sample_rate: int) -> tuple[Floats, list[Floats]]:
    from monochord.physics.split_string import kernels  # noqa: PLC0415  (numba loads on use)

    return _on_grid(setup, count, sample_rate, kernels.leapfrog)


def _reference(setup: SplitString, count: Samples, sample_rate: int) -> tuple[Floats, list[Floats]]:
    return _on_grid(setup, count, sample_rate, leapfrog)


def _on_grid(
    setup: SplitString, count: Samples, sample_rate: int, kernel: Kernel
) -> tuple[Floats, list[Floats]]:
    tones: list[Floats] = []
    # A little longer than needed, so that the resampler's end effect is cut off.
    seconds = count / sample_rate + 0.005
    velocity = _resample(step_grid(setup, seconds, kernel, tones), 1.0 / time_step(setup), sample_rate)
    return np.ascontiguousarray(velocity[:, :count]), tones


def step_grid(setup: SplitString, seconds: Seconds, kernel: Kernel, tones: list[Floats]) -> Iterator[Floats]:
    """Yield the velocities A (2, steps) in m/s at every time step, one driver interval at a time.

    The last interval may be incomplete. `kernel` is `leapfrog` of `grid` (NumPy) or of `kernels` (compiled);
    `tones` receives the drivers' frequencies (2,) of each interval.
    """
    grids = [lay_out(setup, segment) for segment in split(setup)]
    dt = time_step(setup)
    steps = max(1, round(setup.drive.hop / dt))
    stride = max(
        s for s in range(1, steps + 1) if steps % s == 0 and (s == 1 or 1.0 / (s * dt) >= MIN_DRIVER_RATE)
    )
    driver_rate = 1.0 / (stride * dt)
    drivers = feedback.begin(setup.drive, driver_rate)
    total = ceil(seconds / dt)
    for start in range(0, total, steps):
        part = min(steps, total - start)
        tones.append(drivers.tone)
        signals = np.ascontiguousarray(drivers.phasor(part, dt).imag)
        velocity = np.empty((2, part))
        for grid in grids:
            grid.step(kernel, signals, velocity)
        velocity /= 2.0 * dt
        yield velocity
        drivers = feedback.advance(feedback.sense(drivers, velocity[:, ::stride]), steps * dt)
        drivers = feedback.retune(drivers, setup, driver_rate, (start + steps) * dt)


def _resample(blocks: Iterator[Floats], rate: float, sample_rate: int) -> Floats:
    import soxr  # noqa: PLC0415  (loads its library on use)

    resampler = soxr.ResampleStream(rate, sample_rate, 2, dtype="float64", quality="HQ")
    parts = [resampler.resample_chunk(np.ascontiguousarray(block.T)) for block in blocks]
    parts.append(resampler.resample_chunk(np.zeros((0, 2)), last=True))
    return np.concatenate(parts).T


_ROUTES: dict[Route, Callable[[SplitString, Samples, int], tuple[Floats, list[Floats]]]] = {
    "fdtd": _fdtd,
    "reference": _reference,
    "modal": _modal,
}
