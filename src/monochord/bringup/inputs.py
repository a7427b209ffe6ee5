"""Checks of the inputs: silence, level, clipping, rate, which is which, and crosstalk."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from monochord.bringup.check import MICROPHONES, Check, Take, left_out
from monochord.bringup.steps import TAP_PLACE
from monochord.core.clipping import LOUD, LOUD_SHARE
from monochord.core.inputs import Inputs
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Seconds
from monochord.dsp.microphones import LOOK, inputs_of
from monochord.perception.tuning.pluck import LOWEST, onset

INPUT_FAULTS: Mapping[Inputs, str] = {
    Inputs.SAME: Reason.INPUT_COPIED,
    Inputs.FIRST: Reason.MICROPHONE_DEAD.with_detail(2),
    Inputs.SECOND: Reason.MICROPHONE_DEAD.with_detail(1),
    Inputs.APART: Reason.INPUTS_UNLIKE,
}
"""Fault for what two channels carry."""
TARGET_PEAK = 0.3
"""Peak in full scale that the gain is set to: a hard press is some 8 dB louder than the untouched string."""
MIN_PEAK = 0.03
"""Smallest peak of the driven string in full scale: healthy simulated builds reach 0.1 or more."""
DEAD_RATIO = 5.0
"""Level of a pluck's loudest line over the noise there, below which a microphone is dead: healthy ones reach
100."""
SWAP_MARGIN = 2.0
"""Least difference in dB between the microphones of a tap beside one: 5 to 10 in healthy simulated builds."""
MIN_SEPARATION = 4.0
"""Least difference in dB of a segment's line between the two microphones: 7 or more in healthy simulated
builds."""
LINE_RANGE = 30.0
"""Range in dB below the strongest line within which lines are compared."""
RATE_ERROR = 0.02
"""Relative deviation of a live source's frame count from the clock: starting and stopping cost some 10 ms."""
HUM_SPAN: Seconds = 0.3
"""Length of the sound before a tap from which its hum is known; a tap comes later."""
STEADY: Seconds = 1.0
"""Length of the end of a step that counts as steady, in s."""


def steady(take: Take) -> Audio:
    """Return the last second of a take."""
    return take.samples[:, -round(STEADY * take.sample_rate) :]


def decibels(ratio: float) -> float:
    """Return an amplitude ratio in dB; -200 for zero.

    >>> round(decibels(0.1)), decibels(0.0)
    (-20, -200.0)
    """
    return 20.0 * float(np.log10(max(ratio, 1e-10)))


def rms(samples: Floats | Audio) -> Floats:
    """Return the root mean square of each channel, without its mean."""
    return samples.astype(np.float64).std(axis=-1)


def silence_checks(pluck: Take, quiet: Take | None) -> list[Check]:
    """Return for each microphone whether it picks up a plucked string, as dB over its noise."""
    first, rate = onset(pluck.samples, pluck.sample_rate), pluck.sample_rate
    size = round(0.05 * rate)
    frequency, _ = strongest_line(pluck.samples[:, first : first + size], rate, LOWEST)
    loud = line_level(pluck.samples[:, first : first + size], rate, frequency)
    rest = quiet.samples if quiet else pluck.samples[:, -8 * size :]
    parts = np.array_split(rest, max(1, rest.shape[1] // size), axis=1)
    noise = np.median([line_level(part, rate, frequency) for part in parts], axis=0)
    checks: list[Check] = []
    for number, level, floor in zip(MICROPHONES, loud, noise, strict=True):
        name, ratio = f"microphone {number} over its noise", level / max(floor, 1e-9)
        check = Check(step="pluck", name=name, value=decibels(ratio), unit="dB", microphone=number)
        if ratio < DEAD_RATIO or level <= 1e-6:
            advice = (
                f"input {number} does not pick up the string: check plug, cable, phantom power or battery, "
                "gain, and that its piezo is glued on"
            )
            check = check.failed(Reason.MICROPHONE_DEAD.with_detail(number), advice)
        checks.append(check)
    return checks


def inputs_check(takes: Mapping[str, Take]) -> Check:
    """Return whether the inputs are two microphones: neither a copy of the other, nor unused, nor unlike."""
    name, step = "two microphones", next(iter(takes))
    rate = takes[step].sample_rate
    size = round(LOOK * rate)
    pieces = [
        take.samples[:, start : start + size]
        for take in takes.values()
        for start in range(0, take.samples.shape[1] - size + 1, size)
    ]
    inputs, check = inputs_of(pieces, rate), Check(step=step, name=name)
    if not inputs.reason:
        return check
    fault = INPUT_FAULTS[inputs]
    return check.failed(fault, f"{inputs.reason}: {Reason.of(fault).remedy}")


def level_checks(takes: Sequence[Take]) -> list[Check]:
    """Return for each microphone whether the driven string's peak fits the input, or how to change the gain.

    `takes` are of the driven string; the last second of each counts.
    """
    ends = [steady(take) for take in takes]
    checks: list[Check] = []
    for channel, number in enumerate(MICROPHONES):
        peak = max(float(np.abs(end[channel]).max()) for end in ends)
        clipped = max(float((np.abs(end[channel]) >= LOUD).mean()) for end in ends)
        value, gain = decibels(peak), decibels(TARGET_PEAK / max(peak, 1e-9))
        name = f"level of microphone {number}"
        note = "" if abs(gain) < 12.0 else f"gain {gain:+.0f} dB would be best"
        check = Check(step="both", name=name, value=value, unit="dBFS", advice=note, microphone=number)
        if clipped >= LOUD_SHARE:
            advice = f"{100.0 * clipped:.1f} % of samples clip: turn its gain down by 15 dB, run it again"
            check = check.failed(Reason.TOO_LOUD.with_detail(number), advice)
        elif peak < MIN_PEAK:
            check = check.failed(Reason.LOW.with_detail(number), f"turn its gain up by {gain:.0f} dB")
        checks.append(check)
    return checks


def rate_check(takes: Mapping[str, Take]) -> Check:
    """Return whether live frames come at the stated rate, by the machine's clock."""
    rate = next(iter(takes.values())).sample_rate
    check = Check(step=next(iter(takes)), name="sample rate", value=float(rate), unit="Hz")
    for step, take in takes.items():
        if take.elapsed is None:
            continue
        measured = (take.samples.shape[1] + take.dropped) / take.elapsed
        if abs(measured / rate - 1.0) > RATE_ERROR:
            advice = (
                f"{measured:.0f} frames a second arrive: set the interface, or the JACK server, to {rate} Hz"
            )
            return replace(check, step=step, value=measured).failed(Reason.WRONG_RATE, advice)
    return check


def dropped_check(takes: Mapping[str, Take]) -> Check:
    """Return whether frames were lost."""
    lost = sum(take.dropped for take in takes.values())
    step = next((step for step, take in takes.items() if take.dropped), next(iter(takes)))
    check = Check(step=step, name="lost frames", value=float(lost), unit="frames")
    advice = "use longer periods, close other programs, and run monochord doctor without --sensor"
    return check.failed(Reason.LOST_FRAMES, advice) if lost else check


def sensitivity(pluck: Take) -> float:
    """Return microphone 1's sensitivity over 2's: a freely ringing string pulls alike at both ends."""
    first = onset(pluck.samples, pluck.sample_rate)
    size = round(0.05 * pluck.sample_rate)
    for start in range(first + size // 5, pluck.samples.shape[1] - size, size // 2):
        part = pluck.samples[:, start : start + size]
        if np.abs(part).max() < LOUD:
            one, two = rms(part)
            return float(one / max(two, 1e-12))
    return 1.0


def order_check(tap: Take, relative: float) -> Check:
    """Return whether a tap beside microphone 1 is louder there than in microphone 2, at equal sensitivity.

    The first millisecond counts, in which the tap presses; what rings on is equal at both ends. `relative` is
    microphone 1's sensitivity over microphone 2's.
    """
    name, first = "tap beside microphone 1, over microphone 2", onset(tap.samples, tap.sample_rate, HUM_SPAN)
    size = round(1e-3 * tap.sample_rate)
    part = _without_hum(tap, first, size)
    if (np.abs(tap.samples[:, first : first + size]) >= LOUD).any():
        return left_out("tap", name, "the tap clips: tap more softly, or turn the gain down")
    one, two = np.sqrt((part**2).mean(axis=1))
    value = decibels(one / max(two, 1e-12)) - decibels(relative)
    check = Check(step="tap", name=name, value=value, unit="dB")
    if value >= SWAP_MARGIN:
        return check
    if value <= -SWAP_MARGIN:
        advice = (
            "input 1 carries microphone 2: exchange the plugs, or the ports, as in --device 'PORT_2,PORT_1'"
        )
        return check.failed(Reason.INPUTS_SWAPPED, advice)
    advice = f"no clear order: tap once, within {1e3 * TAP_PLACE:g} mm of microphone 1's end of the string"
    return check.failed(Reason.UNCLEAR_TAP, advice)


def separation_check(press: Take, relative: float) -> Check:
    """Return whether a pressed string's segments are told apart by their microphones.

    The strongest lines of both are compared; `relative` as in `order_check`. The value is the largest
    difference in favour of either microphone, in dB.
    """
    name, end = "separation of the microphones", steady(press)
    power = np.abs(np.fft.rfft(end * np.hanning(end.shape[1]))) ** 2
    power[0] /= relative**2
    both = power.max(axis=0)
    lines = np.flatnonzero((both[1:-1] > both[:-2]) & (both[1:-1] >= both[2:])) + 1
    frequency = lines * press.sample_rate / end.shape[1]
    strong = (both[lines] > both.max() * 10.0 ** (-LINE_RANGE / 10.0)) & (frequency > LOWEST)
    ratios = 10.0 * np.log10((power[0, lines] + 1e-20) / (power[1, lines] + 1e-20))[strong]
    if not ratios.size:
        return left_out("press", name, "the pressed string does not sound")
    value = float(max(ratios.max(), -ratios.min()))
    check = Check(step="press", name=name, value=value, unit="dB")
    advice = (
        "both microphones hear the same: mount each on its own block, with a damping layer between "
        "block and bar, and keep their cables apart"
    )
    return check if value >= MIN_SEPARATION else check.failed(Reason.CROSSTALK, advice)


def strongest_line(samples: Audio, sample_rate: int, lowest: Hertz) -> tuple[Hertz, Floats]:
    """Return the frequency of the strongest line above `lowest` in either channel, and its rms level in each.

    >>> tone = 0.1 * np.sin(2.0 * np.pi * 1000.0 * np.arange(44100) / 44100)
    >>> frequency, level = strongest_line(np.stack([tone, 0.5 * tone]).astype(np.float32), 44100, 300.0)
    >>> round(frequency), level.round(3).tolist()
    (1000, [0.071, 0.035])
    """
    size, spacing = line_levels(samples), sample_rate / samples.shape[1]
    size[:, : round(lowest / spacing)] = 0.0
    k = int(size.max(axis=0).argmax())
    return k * spacing, size[:, k]


def line_levels(samples: Audio) -> Floats:
    """Return the level (2, bins) of each line of the spectrum, rms in full scale."""
    taper = np.hanning(samples.shape[1])
    return np.abs(np.fft.rfft(samples * taper)) / taper.sum() * np.sqrt(2.0)


def line_level(samples: Floats | Audio, sample_rate: int, frequency: Hertz) -> Floats:
    """Return each channel's rms level at a frequency."""
    count = samples.shape[-1]
    taper = np.hanning(count)
    wave = taper * np.exp(-2j * np.pi * frequency * np.arange(count) / sample_rate) / taper.sum()
    return np.abs(samples @ wave) * np.sqrt(2.0)


def _without_hum(take: Take, first: int, size: int) -> Floats:
    """Return `size` frames from `first` on, without hum and offset as the sound before shows them."""
    before = min(first - size // 4, round(HUM_SPAN * take.sample_rate))
    part = take.samples[:, first : first + size].astype(np.float64)
    if before < 0.5 * HUM_SPAN * take.sample_rate:
        return part
    time = np.arange(-before - size // 4, size) / take.sample_rate
    phase = 2.0 * np.pi * np.outer(time, [mains * k for mains in (50.0, 60.0) for k in range(1, 6)])
    waves = np.concatenate([np.cos(phase), np.sin(phase), np.ones((time.size, 1))], axis=1)
    rest = take.samples[:, first - size // 4 - before : first - size // 4].T
    weights = np.linalg.lstsq(waves[:before], rest, rcond=None)[0]
    return part - (waves[-size:] @ weights).T
