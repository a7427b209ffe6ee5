"""The drivers' feedback: they take frequency and phase from the vibration that they sustain."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import pi
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Samples, Seconds
from monochord.physics.split_string.setup import Drive, Feedback, SplitString
from monochord.physics.theory import mixing_matrix

Complexes: TypeAlias = NDArray[np.complex128]

_SILENT_VELOCITY = 1e-12
"""Smallest line amplitude that a driver follows, in m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drivers:
    """Both drivers at the start of an interval of constant frequency.

    `frequency` in Hz, zero while silent; `phase` in rad at the start of the interval; `history` the
    latest velocities A in m/s, newest last, of which the last `count` are measured.
    """

    frequency: Floats
    phase: Floats
    history: Floats
    count: Samples

    @property
    def active(self) -> Floats:
        """1 for a driver with a frequency, else 0."""
        return np.sign(self.frequency)

    @property
    def tone(self) -> Floats:
        """The frequencies in Hz, NaN for a silent driver."""
        return np.where(self.frequency > 0.0, self.frequency, np.nan)

    def phases(self, times: Floats) -> Floats:
        """Return the phases (2, n) in rad at times in s since the start of the interval."""
        return self.phase[:, None] + (2.0 * pi * self.frequency)[:, None] * times

    def phasor(self, steps: Samples, step: Seconds) -> Complexes:
        """Return exp(i phase), (2, steps) complex, at every `step` s of the interval.

        Zero for a silent driver.

        Computed by the addition theorem from a coarse and a fine time grid: a sine for each of a million
        steps a second would take a tenth of the simulation's time.
        """
        fine = np.arange(min(steps, 128), dtype=np.float64) * step
        coarse = np.arange(-(-steps // fine.size), dtype=np.float64) * (fine.size * step)
        turns: Complexes = np.exp(1j * (self.phases(fine) - self.phase[:, None]))
        coarse_phasor: Complexes = np.exp(1j * self.phases(coarse))
        whole = (coarse_phasor[:, :, None] * turns[:, None, :]).reshape(2, -1)
        return np.where(self.frequency[:, None] > 0.0, whole[:, :steps], 0.0)


def begin(drive: Drive, rate: float) -> Drivers:
    """Return the drivers at time zero, sensing at `rate` samples per second."""
    silent = drive.amplitude == 0.0 or drive.start_frequencies is None
    frequency = np.array((0.0, 0.0) if silent else drive.start_frequencies)
    history = np.zeros((2, round(drive.window * rate)))
    return Drivers(frequency=frequency, phase=np.zeros(2), history=history, count=0)


def sense(drivers: Drivers, velocity: Floats) -> Drivers:
    """Return the drivers with the newest velocities (2, n) added to their history."""
    size = drivers.history.shape[1]
    history = np.concatenate((drivers.history, velocity), axis=1)[:, -size:]
    return replace(drivers, history=history, count=min(size, drivers.count + velocity.shape[1]))


def advance(drivers: Drivers, elapsed: Seconds) -> Drivers:
    """Return the drivers `elapsed` seconds later, at the same frequencies."""
    return replace(drivers, phase=drivers.phases(np.array([elapsed]))[:, 0] % (2.0 * pi))


def retune(drivers: Drivers, setup: SplitString, rate: float, time: Seconds) -> Drivers:
    """Return the drivers with frequencies from their history, at `time` in s since the start.

    Frequencies change only once the history fills a whole window.
    """
    drive = setup.drive
    if drive.amplitude != 0.0 and drivers.count == drivers.history.shape[1]:
        frequency, phase = _RULES[drive.feedback](drivers, setup, rate)
        joins = drivers.frequency == 0.0
        drivers = replace(drivers, frequency=frequency, phase=np.where(joins, phase, drivers.phase))
    if drive.phase == "printed":
        return replace(drivers, phase=2.0 * pi * drivers.frequency * time)
    return drivers


def lines(signals: Floats, rate: float) -> tuple[Floats, Floats]:
    """Return frequency and phase of the strongest spectral line of each signal.

    It is the maximum of the Hann-windowed spectrum, interpolated from the ratio of the two highest bins,
    which is exact for a single sinusoid. Of `signals` (channels, n), the frequency (channels,) in Hz is zero
    for silence, otherwise at least some two bins above zero; the phase (channels,) in rad is that of
    sin(phase) at the time just after the last sample.

    >>> t = np.arange(2205) / 44100
    >>> frequency, phase = lines(np.sin(2 * np.pi * 695.0 * t)[None] + 0.1, 44100)
    >>> frequency.round(2), np.cos(phase - 2 * np.pi * 695.0 * 0.05).round(2)
    (array([695.]), array([1.]))
    """
    size = signals.shape[1]
    spectrum = np.fft.rfft(signals * _hann(size), axis=1)
    power = spectrum.real**2 + spectrum.imag**2
    rows = np.arange(len(signals))
    peak = 2 + np.argmax(power[:, 2:-1], axis=1)
    left, centre, right = np.sqrt(power[rows, peak + np.array([[-1], [0], [1]])])
    silent = centre < _SILENT_VELOCITY * size / 4.0
    ratio = np.maximum(left, right) / np.where(silent, 1.0, centre)
    offset = np.where(right > left, 1.0, -1.0) * (2.0 * ratio - 1.0) / (1.0 + ratio)
    frequency = np.where(silent, 0.0, (peak + offset) * rate / size)
    # The window is symmetric about n/2, so there the phase is that of the bin whatever the offset.
    middle = np.angle(spectrum[rows, peak]) + pi * (peak % 2) + pi / 2.0
    return frequency, middle + pi * frequency * size / rate


@cache
def _hann(size: Samples) -> Floats:
    return 0.5 - 0.5 * np.cos(2.0 * pi * np.arange(size) / size)


def _follow_own(drivers: Drivers, setup: SplitString, rate: float) -> tuple[Floats, Floats]:
    dominant, phase = lines(drivers.history, rate)
    lead = (phase - drivers.phase + pi) % (2.0 * pi) - pi
    closing = np.clip(setup.drive.pull * lead / (2.0 * pi * setup.drive.hop), -dominant / 8.0, dominant / 8.0)
    target = dominant + np.where(drivers.frequency == 0.0, 0.0, closing)
    return np.where(dominant == 0.0, drivers.frequency, target), phase


def _follow_first(drivers: Drivers, setup: SplitString, rate: float) -> tuple[Floats, Floats]:
    first = mixing_matrix(*setup.mixing)[:1] @ drivers.history
    dominant, phase = lines(first, rate)
    return np.where(dominant == 0.0, drivers.frequency, dominant), np.repeat(phase, 2)


def _stay(drivers: Drivers, setup: SplitString, rate: float) -> tuple[Floats, Floats]:  # noqa: ARG001
    return drivers.frequency, drivers.phase


_RULES: dict[Feedback, Callable[[Drivers, SplitString, float], tuple[Floats, Floats]]] = {
    "per-driver": _follow_own,
    "literal": _follow_first,
    "off": _stay,
}
