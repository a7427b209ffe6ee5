"""Checks of the drivers: whether each starts the string, on which partial, how fast; and feed-through."""

import math
from dataclasses import dataclass, replace

import numpy as np

from monochord.bringup.check import MICROPHONES, Check, Take, left_out
from monochord.bringup.inputs import decibels, line_level, rms, steady, strongest_line
from monochord.core.reasons import Reason
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds

FRAME: Seconds = 0.005
"""Length of a frame of the envelope, in s."""
LOWEST_SHARE, HIGHEST_SHARE = 0.6, 8.0
"""Band of the envelope, over the open pitch: drivers hold the string on one of its first partials."""
SUSTAINED = 4.0
"""Level of a sustained line over that of the noise in its band, as an amplitude ratio."""
AUDIBLE = 3.0
"""Level of the driven string over the noise of its band from which growth can be told."""
STARTED, LOCKED = 0.1, 0.7
"""Shares of the final level between which the time to lock counts."""
GROWTH_FRAMES = 12
"""Frames over which growth is measured: a string that goes over from one partial to another rises twice."""
MIN_GROWTH = 0.7
"""Least growth of a driven partial, relative to its decay without driver: 0.8 to 5 in healthy simulated
drivers, zero at the threshold of oscillation."""
FEED_THROUGH = 0.4
"""Largest level with the string damped, relative to that of the ringing string."""
MIN_FEED = -46.0
"""Level in dBFS below which feed-through does not matter."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverLock:
    """What a driver brings the string to.

    `frequency` is in Hz, `level` in dBFS, the `time` to lock in s; `growth` is the largest rate at which the
    level rises, in 1/s, and `first` the frequency in Hz of the partial that rises.
    """

    frequency: Hertz
    level: float
    time: Seconds
    growth: float
    first: Hertz
    envelope: Floats


def lock_of(take: Take, pitch: Hertz, quiet: Take | None) -> DriverLock | None:
    """Return how the string locks in a take in which a driver is switched on; None if it is not sustained.

    Time counts from a tenth of the final level, or twice the noise where that is more, and is zero where the
    string was loud before. Growth counts from twice the noise: a string that first locks to one partial and
    then goes over to a louder one grows fastest at its first rise.
    """
    rate = take.sample_rate
    frequency, levels = strongest_line(steady(take), rate, LOWEST_SHARE * pitch)
    channel = int(levels.argmax())
    envelope = _envelope(take.samples[channel], pitch, rate)
    end = float(np.median(envelope[-100:]))
    rest = (quiet or take).samples[channel]
    noise = _envelope(rest, pitch, rate)
    floor = float(np.median(noise) if quiet else noise.min())
    narrow = line_level(rest[: rate // 2], rate, frequency)
    if levels[channel] < SUSTAINED * max(float(narrow) if quiet else 0.0, 1e-7) or end < 1.05 * floor:
        return None
    least = int(envelope[: envelope.size // 2].argmin())
    reached = least + int(np.argmax(envelope[least:] >= LOCKED * end))
    quietest = max(2.0 * floor, 1.1 * float(envelope[least]))
    begin = _last_below(envelope[:reached], max(STARTED * end, quietest))
    time = FRAME * (reached - begin)
    audible = _last_below(envelope[:reached], quietest)
    rise = np.log(envelope[audible : reached + 1])
    stretch = min(GROWTH_FRAMES, reached - begin)
    growth = float((rise[stretch:] - rise[:-stretch]).max()) / (stretch * FRAME) if stretch > 1 else math.inf
    hop = round(FRAME * rate)
    rising = take.samples[:, begin * hop : max(reached + 2, begin + 4) * hop]
    first, _ = strongest_line(rising, rate, LOWEST_SHARE * pitch)
    if end < AUDIBLE * floor:
        growth = 0.0
    return DriverLock(
        frequency=frequency,
        level=decibels(float(levels[channel])),
        time=time,
        growth=growth,
        first=first,
        envelope=envelope,
    )


def _last_below(envelope: Floats, level: float) -> int:
    """Return the last frame below a level; the envelope's end if there is none."""
    below = np.flatnonzero(envelope < level)
    return int(below[-1]) if below.size else envelope.size


def _envelope(samples: Floats, pitch: Hertz, sample_rate: int) -> Floats:
    """Return the rms level in the band of the string's partials, a frame every `FRAME`."""
    spectrum = np.fft.rfft(samples)
    frequency = np.fft.rfftfreq(samples.size, 1.0 / sample_rate)
    spectrum[(frequency < LOWEST_SHARE * pitch) | (frequency > HIGHEST_SHARE * pitch)] = 0.0
    size = round(FRAME * sample_rate)
    count = samples.size // size
    frames = np.fft.irfft(spectrum, samples.size)[: count * size].reshape(count, size)
    return np.sqrt((frames**2).mean(axis=1))


def driver_checks(step: str, lock: DriverLock | None, pitch: Hertz, decay: float | None) -> list[Check]:
    """Return whether a driver, or both, sustain the string: on which partial, how loud, and how fast.

    `pitch` is that of the open string; `decay` the decay rate of its fundamental in 1/s, from the pluck: that
    of a partial grows with its number.
    """
    which = {"driver_1": "driver 1", "driver_2": "driver 2"}.get(step, "both drivers")
    level = Check(step=step, name=f"level of {which}", unit="dBFS")
    if lock is None:
        if step == "both":
            reason = "the string is not sustained: see the single drivers"
            return [left_out(step, f"partial of {which}", reason)]
        advice = (
            f"{which} does not sustain the string: check its supply, the wire of both coils, and exchange "
            "the two ends of one coil (its sense may be reversed); then bring it nearer to the string"
        )
        return [level.failed(Reason.DRIVER_DEAD.with_detail(which), advice)]
    partial = Check(step=step, name=f"partial of {which}", value=round(lock.frequency / pitch, 2))
    time = Check(step=step, name=f"time of {which} to lock", value=lock.time, unit="s")
    slow = (
        step != "both"
        and decay is not None
        and lock.growth < MIN_GROWTH * decay * max(1.0, lock.first / pitch)
    )
    if slow:
        advice = (
            f"{which} hardly overcomes the string's losses: bring it nearer to the string, renew its "
            "battery, raise its gain"
        )
        time = time.failed(Reason.DRIVER_WEAK.with_detail(which), advice)
    return [partial, replace(level, value=lock.level), time]


def feed_checks(damped: Take, driven: Take, quiet: Take | None) -> list[Check]:
    """Return for each microphone what it hears of the drivers while the string is damped.

    The level is relative to the ringing string's. The noise of the quiet sensor is taken off.
    """
    ends = rms(steady(damped))
    if quiet is not None:
        ends = np.sqrt(np.maximum(ends**2 - rms(quiet.samples) ** 2, 1e-14))
    ringing = rms(steady(driven))
    checks: list[Check] = []
    for number, level, full in zip(MICROPHONES, ends, ringing, strict=True):
        name, share = f"feed-through into microphone {number}", float(level / max(full, 1e-9))
        check = Check(step="damped", name=name, value=decibels(share), unit="dB", microphone=number)
        if share > FEED_THROUGH and decibels(float(level)) >= MIN_FEED:
            advice = (
                "the microphone hears a coil without the string (or the string still rings: damp it all "
                "along): move the cable off the coils, twist the coils' leads, shield the piezo, separate "
                "the grounds"
            )
            check = check.failed(Reason.FEED_THROUGH.with_detail(number), advice)
        checks.append(check)
    return checks
