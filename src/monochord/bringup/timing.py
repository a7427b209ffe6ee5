"""Checks of time: latency by a loop-back, and drift of the pitch."""

import math

import numpy as np

from monochord.bringup.check import Check, Take, left_out
from monochord.bringup.inputs import strongest_line
from monochord.core.reasons import Reason
from monochord.core.types import Audio
from monochord.core.units import Hertz, Seconds

MIN_ECHO = 0.1
"""Least correlation of a returned click with the sent one."""
MAX_DRIFT = 20.0
"""Largest drift in cents a minute: a wire that warms up after switching on changes by some cents."""
DRIFT_FRAME: Seconds = 1.0


def latency_check(take: Take | None) -> Check:
    """Return the time from a click on channel 1, as sent, to its return on channel 2."""
    name = "latency by loop-back"
    if take is None:
        reason = (
            "no loop-back: connect an output to input 2 and record what is sent on channel 1 as loopback.wav"
        )
        return left_out("loopback", name, reason)
    sent, returned = take.samples.astype(np.float64)
    size = 2 * sent.size
    correlation = np.fft.irfft(np.fft.rfft(returned, size) * np.conj(np.fft.rfft(sent, size)), size)[
        : sent.size
    ]
    lag = int(np.abs(correlation).argmax())
    strength = float(
        np.abs(correlation[lag]) / math.sqrt(float(sent @ sent) * float(returned @ returned) + 1e-20)
    )
    if strength < MIN_ECHO:
        return left_out(
            "loopback", name, "no loop-back: what is sent on channel 1 does not return on channel 2"
        )
    return Check(step="loopback", name=name, value=1e3 * lag / take.sample_rate, unit="ms")


def drift_checks(take: Take | None, pitch: Hertz) -> list[Check]:
    """Return the drift of the driven string's strongest line, none where it was not asked for."""
    if take is None:
        return []
    size = round(DRIFT_FRAME * take.sample_rate)
    count = take.samples.shape[1] // size
    parts = [take.samples[:, i * size : (i + 1) * size] for i in range(count)]
    name = "drift"
    if count < 3:
        return [left_out("drift", name, "less than 3 s")]
    lines = np.array([_fine(part, take.sample_rate, pitch) for part in parts])
    cents = 1200.0 * np.log2(lines / np.median(lines))
    same = np.abs(cents) < 100.0  # the drivers may settle on another partial
    if same.sum() < 3:
        return [left_out("drift", name, "the drivers do not stay on one partial")]
    slope = 60.0 * float(np.polyfit(np.flatnonzero(same) * DRIFT_FRAME, cents[same], 1)[0])
    check = Check(step="drift", name=name, value=slope, unit="cents/min")
    advice = "let it warm up, keep drafts off the wire, tighten tuner and anchor"
    return [check if abs(slope) <= MAX_DRIFT else check.failed(Reason.DRIFT, advice)]


def _fine(samples: Audio, sample_rate: int, pitch: Hertz) -> float:
    """Return the frequency of the strongest line to a fraction of a bin, by the phase between two halves."""
    frequency, levels = strongest_line(samples, sample_rate, 0.6 * pitch)
    channel = samples[int(levels.argmax())].astype(np.float64)
    half = channel.size // 2
    wave = np.hanning(half) * np.exp(-2j * np.pi * frequency * np.arange(half) / sample_rate)
    first, second = channel[:half] @ wave, channel[half : 2 * half] @ wave
    turn = np.exp(-2j * np.pi * frequency * half / sample_rate)
    phase = float(np.angle(second * turn / first))
    return frequency + phase * sample_rate / (2.0 * np.pi * half)
