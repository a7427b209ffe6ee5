"""Checks of the quiet sensor, drivers off: hum with its likely cause, noise, and the rate by the mains."""

import numpy as np

from monochord.bringup.check import MICROPHONES, Check, Take
from monochord.bringup.inputs import decibels, line_levels, rms
from monochord.core.clock import RATES
from monochord.core.reasons import Reason
from monochord.core.types import Floats
from monochord.core.units import Hertz

STEP = "quiet"
MAINS: tuple[Hertz, Hertz] = (50.0, 60.0)
HARMONICS = 1, 2, 3, 4, 5
REACH: Hertz = 1.0
"""Distance within which a line is the mains': its frequency wanders by 0.2 Hz, five times that at its fifth
harmonic."""
MAX_HUM = -45.0
"""Largest hum in dBFS: that of a string at the target level is 30 dB louder. Healthy simulated builds:
-50."""
MAX_NOISE = -42.0
"""Largest noise in dBFS: healthy simulated builds stay below -50."""
MIN_SNR = 15.0
"""Smallest ratio in dB of the driven string to the noise, over the whole band."""
FUNDAMENTAL = 3.0
"""Prominence, in nats of power, from which the mains' fundamental counts as there."""
RATE_MARGIN = 4.0
"""By how much, in nats of power, lines at another rate's places must stand higher than at the stated
rate's."""


def _spectrum(take: Take) -> tuple[Floats, float]:
    """Return the line levels (2, bins), rms in full scale, and the bins' spacing in Hz."""
    return line_levels(take.samples), take.sample_rate / take.samples.shape[1]


def _line(size: Floats, spacing: float, frequency: Hertz, reach: Hertz = REACH) -> Floats:
    """Return the largest level of each channel near a frequency."""
    low, high = int((frequency - reach) / spacing), int((frequency + reach) / spacing) + 2
    return size[:, max(low, 1) : high].max(axis=1)


def _prominence(size: Floats, spacing: float, frequency: Hertz) -> float:
    """Return by how many nats of power, 0 to 8, a line stands out of the spectrum in the better channel."""
    low, high = int((frequency - 15.0) / spacing), int((frequency + 15.0) / spacing)
    floor = np.median(size[:, max(low, 1) : high], axis=1)
    line = _line(size, spacing, frequency, 0.5)
    return float(np.clip(2.0 * np.log((line + 1e-12) / (2.0 * floor + 1e-12)), 0.0, 8.0).max())


def mains_of(quiet: Take) -> Hertz:
    """Return the mains' frequency that stands out more, 50 or 60 Hz."""
    size, spacing = _spectrum(quiet)
    return max(MAINS, key=lambda mains: sum(_prominence(size, spacing, k * mains) for k in HARMONICS))


def true_rate(quiet: Take) -> int | None:
    """Return the rate at which the mains' hum has its frequency; None where that is the stated one."""
    size, spacing = _spectrum(quiet)
    scores: dict[int, float] = {}
    for rate in {quiet.sample_rate, *RATES}:
        scores[rate] = 0.0
        for mains in MAINS:
            scale = mains * quiet.sample_rate / rate
            parts = [_prominence(size, spacing, k * scale) for k in (1, 3, 5)]
            if parts[0] >= FUNDAMENTAL:
                scores[rate] = max(scores[rate], sum(parts))
    best = max(scores, key=lambda rate: scores[rate])
    return best if scores[best] > scores[quiet.sample_rate] + RATE_MARGIN else None


def mains_rate_check(quiet: Take) -> Check | None:
    """Return a failed check where the hum's frequency shows another sample rate than stated; else None."""
    rate = true_rate(quiet)
    if rate is None:
        return None
    advice = (
        f"the mains hum lies where sound of {rate} Hz stated as {quiet.sample_rate} Hz would have it: "
        "set recorder, interface and --rate to one sample rate"
    )
    check = Check(step=STEP, name="sample rate by the mains", value=float(rate), unit="Hz")
    return check.failed(Reason.WRONG_RATE, advice)


def hum_checks(quiet: Take) -> list[Check]:
    """Return for each microphone whether it picks up the mains, and the likely cause."""
    size, spacing = _spectrum(quiet)
    mains = mains_of(quiet)
    lines = np.stack([_line(size, spacing, k * mains) for k in HARMONICS])
    total = np.sqrt((lines**2).sum(axis=0))
    checks: list[Check] = []
    for channel, number in enumerate(MICROPHONES):
        value, name = decibels(float(total[channel])), f"hum of microphone {number}"
        check = Check(step=STEP, name=name, value=value, unit="dBFS", microphone=number)
        if value <= MAX_HUM:
            checks.append(check)
            continue
        shared = decibels(float(total[1 - channel])) > MAX_HUM
        even = float(lines[1, channel]) > float(lines[[0, 2], channel].max())
        cause = (
            f"{2.0 * mains:g} Hz is the loudest: ripple of a power supply; use another, or a battery"
            if even
            else "in both microphones: a ground loop or a shared supply; run on a battery, and "
            "ground it at one place"
            if shared
            else "in this microphone alone: an open or unshielded cable; check its shield, and move "
            "it off supplies and coils"
        )
        checks.append(check.failed(Reason.HUMMING, f"{mains:g} Hz and its harmonics, {cause}"))
    return checks


def noise_checks(quiet: Take, driven: Take | None) -> list[Check]:
    """Return for each microphone its noise without hum, and the driven string's ratio to it."""
    size, spacing = _spectrum(quiet)
    levels = rms(quiet.samples)
    mains = mains_of(quiet)
    hum = sum(_line(size, spacing, k * mains) ** 2 for k in HARMONICS)
    floor = np.sqrt(np.maximum(levels**2 - hum, 1e-12))
    checks: list[Check] = []
    for channel, number in enumerate(MICROPHONES):
        value, name = decibels(float(floor[channel])), f"noise of microphone {number}"
        check = Check(step=STEP, name=name, value=value, unit="dBFS", microphone=number)
        advice = "turn the gain down, keep the room still, and check the preamplifier's supply"
        checks.append(check.failed(Reason.NOISE, advice) if value > MAX_NOISE else check)
        if driven is None:
            continue
        tail = driven.samples[channel, -driven.sample_rate :]
        ratio = decibels(float(rms(tail) / floor[channel]))
        name = f"string over noise, microphone {number}"
        check = Check(step="both", name=name, value=ratio, unit="dB", microphone=number)
        advice = "raise the string's level (drivers nearer, fresh batteries), not the gain"
        checks.append(check.failed(Reason.NOISE, advice) if ratio < MIN_SNR else check)
    return checks
