"""From a setup to a recording, by one of three routes through the same physics."""

from collections.abc import Callable, Iterator
from importlib import import_module
from math import ceil
from typing import Literal, TypeAlias, get_args

import numpy as np

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Floats
from monochord.core.units import Samples, Seconds
from monochord.physics.split_string import feedback, stream
from monochord.physics.split_string.grid import Kernel, lay_out, time_step
from monochord.physics.split_string.recording import Recording
from monochord.physics.split_string.segments import split
from monochord.physics.split_string.setup import SplitString
from monochord.physics.theory import mixing_matrix

Route: TypeAlias = Literal["fdtd", "modal", "reference"]

_EAR_RATE = 40e3
"""The drivers hear the grid's velocity at the lowest whole fraction of its rate that is not below this."""


def simulate(
    setup: SplitString, seconds: Seconds, *, route: Route = "fdtd", sample_rate: int = 44100
) -> Recording:
    """Simulate a split string from time zero.

    Parameters
    ----------
    setup
        String, touch, drive and grid.
    seconds
        How long, above 0.
    route
        "fdtd": the paper's leapfrog on N nodes a segment, compiled. "reference": the same in NumPy, over
        a hundred times slower, equal to rounding. "modal": each mode as a damped oscillator solved exactly
        over each interval of constant drive; the limit that the grid tends to as it is refined.
    sample_rate
        Of the recording, in Hz. The grid runs at 1 / dt; its velocities are brought to this rate by a
        linear-phase resampler (soxr, "HQ": flat to 0.01 dB up to 0.456 of the rate, more than 120 dB
        down from 0.5), so nothing folds back. The modal route follows the modes up to the
        same 0.456 of the rate.

    Returns
    -------
    Recording
        Velocities and microphones.

    Raises
    ------
    InputError
        For an unknown route, a duration that is not above zero, a sample rate out of range, or a time step
        that is not below alpha dxi / v on every segment.

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
    return Recording(
        segments=velocity,
        microphones=mixing @ velocity,
        sample_rate=sample_rate,
        mixing=mixing,
        drive_frequencies=np.array(tones[:intervals]).T,
        drive_interval=setup.drive.hop,
    )


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


def _on_grid(kernel_module: str) -> Callable[[SplitString, Samples, int], tuple[Floats, list[Floats]]]:
    def run(setup: SplitString, count: Samples, sample_rate: int) -> tuple[Floats, list[Floats]]:
        # On use, since one of the kernels brings numba with it.
        kernel: Kernel = import_module(f"monochord.physics.split_string.{kernel_module}").leapfrog
        tones: list[Floats] = []
        # A little more than asked, so that the resampler's end lies beyond what is kept.
        seconds = count / sample_rate + 0.005
        velocity = _resample(step_grid(setup, seconds, kernel, tones), 1.0 / time_step(setup), sample_rate)
        return np.ascontiguousarray(velocity[:, :count]), tones

    return run


def step_grid(setup: SplitString, seconds: Seconds, kernel: Kernel, tones: list[Floats]) -> Iterator[Floats]:
    """Yield the velocities A (2, n) in m/s at every time step, one driver interval at a time.

    Parameters
    ----------
    setup
        What to simulate.
    seconds
        How long; a part of an interval may be left at the end.
    kernel
        `leapfrog` of the reference or of the compiled module.
    tones
        Receives the drivers' frequencies (2,) of each interval.

    Yields
    ------
    array (2, steps)
        Velocities on the grid of time steps.
    """
    grids = [lay_out(setup, segment) for segment in split(setup)]
    dt = time_step(setup)
    steps = max(1, round(setup.drive.hop / dt))
    stride = max(s for s in range(1, steps + 1) if steps % s == 0 and (s == 1 or 1.0 / (s * dt) >= _EAR_RATE))
    ear_rate = 1.0 / (stride * dt)
    drivers = feedback.begin(setup.drive, ear_rate)
    total = ceil(seconds / dt)
    for start in range(0, total, steps):
        part = min(steps, total - start)
        tones.append(drivers.tone)
        signals = np.ascontiguousarray(drivers.swing(part, dt).imag)
        velocity = np.empty((2, part))
        for grid in grids:
            grid.step(kernel, signals, velocity)
        velocity /= 2.0 * dt
        yield velocity
        drivers = feedback.advance(feedback.listen(drivers, velocity[:, ::stride]), steps * dt)
        drivers = feedback.retune(drivers, setup, ear_rate, (start + steps) * dt)


def _resample(blocks: Iterator[Floats], rate: float, sample_rate: int) -> Floats:
    import soxr  # noqa: PLC0415  (loads its library on use)

    resampler = soxr.ResampleStream(rate, sample_rate, 2, dtype="float64", quality="HQ")
    parts = [resampler.resample_chunk(np.ascontiguousarray(block.T)) for block in blocks]
    parts.append(resampler.resample_chunk(np.zeros((0, 2)), last=True))
    return np.concatenate(parts).T


_ROUTES: dict[Route, Callable[[SplitString, Samples, int], tuple[Floats, list[Floats]]]] = {
    "fdtd": _on_grid("compiled"),
    "reference": _on_grid("reference"),
    "modal": _modal,
}
