"""Checks of the string, from a pluck with the drivers off: pitch, wire, and ends."""

import math

import numpy as np

from monochord.bringup.check import Check, Pluck, Take, left_out
from monochord.core.clock import mistaken_rates
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Floats, StringParams
from monochord.core.units import Hertz, Seconds
from monochord.physics.sensors import retuned
from monochord.physics.theory import (
    decay_rates,
    inharmonicity,
    open_frequency,
    stiff_partials,
    stretch_stiffness,
)
from monochord.physics.twin import Sensor

STEP = "pluck"
LOWEST: Hertz = 300.0
"""Lowest frequency of a line that counts as the string's: hum lies below."""
ONSET = 0.4
"""Share of its peak that a tap or pluck first passes: noise and hum of simulated builds stay below 0.25."""
SEARCHED = 0.25
"""Relative range of pitches searched around the design's: what a sensor file may deviate by."""
WINDOW: Seconds = 0.1
"""Length of the analysed window. High partials last some 10 ms, so that its taper is largest at the pluck."""
START: Seconds = 1e-3
"""Time from the pluck to the window's start."""
FRAME: Seconds = 0.005
MAX_PARTIALS = 14
TOP = 0.34
"""Highest frequency of a partial, as a share of the sample rate: what preamplifiers pass."""
STEP_F0 = 5e-4
"""Relative step of the search in f0: half a line's width."""
B_FACTORS = np.geomspace(0.25, 4.0, 33)
"""Searched factors of the design's inharmonicity: half to twice its wire's diameter."""
NEAR = 4e-3
"""Relative distance within which a peak is a partial's; ends that yield move one by up to 2e-3."""
MIN_SALIENCE = 10.0
"""Power of a partial over the noise around it."""
MIN_STIFF_PARTIALS, MIN_HIGHEST = 7, 8
"""Partials needed to measure the stiffness: B n^2 of lower ones is below what yielding ends do to them."""
PITCH_BIAS = 1e-3
"""Relative standard error of f0 from what lies outside the series: magnets that pull, ends that yield."""
PITCH_TOLERANCE = 0.03
"""Relative deviation from the design's pitch, half a semitone: what the models are trained for."""
STIFFNESS_TOLERANCE = 0.25
"""Relative deviation of the inharmonicity, which goes with the square of the diameter: healthy simulated
builds stay within 0.15, the next gauge of plain strings (.010 to .011) gives 0.21 and .012 0.44."""
DECAY_FACTOR = 2.0
"""Decay rate over the design's, beyond which an end is loose: healthy simulated builds stay below 1.4."""
TUNER_RATIO, POST_DIAMETER = 14.0, 6e-3
"""Assumed: a guitar's tuner of ratio 14:1 whose post, 6 mm thick, winds up the wire. Turns are those of its
button."""


def onset(samples: Audio, sample_rate: int, after: Seconds = 0.0) -> int:
    """Return the first frame of the loudest sound in samples (channels, n), above 300 Hz.

    It is where the sound first passes 0.4 of its peak, not before the time `after`. Hum lies below.

    Examples
    --------
    >>> samples = np.zeros((1, 4410), dtype=np.float32)
    >>> samples[0, 2000:2020] = np.sin(np.arange(20))
    >>> abs(onset(samples, 44100) - 2000) < 5
    True
    """
    size = round(sample_rate / (2.0 * LOWEST)) | 1
    mean = np.lib.stride_tricks.sliding_window_view(samples, size, axis=1).mean(axis=2)
    envelope = np.zeros(samples.shape[1])
    half = size // 2
    envelope[half : half + mean.shape[1]] = np.abs(samples[:, half : half + mean.shape[1]] - mean).max(axis=0)
    envelope[: round(after * sample_rate)] = 0.0
    return int(np.argmax(envelope >= ONSET * envelope.max()))


def measure_pluck(take: Take, string: StringParams) -> Pluck | None:
    """Return what a plucked string of about this design does; None where no series of partials is found.

    The spectrum of both microphones is compared with f_n = n f0 sqrt(1 + B n^2) on a grid of f0 and B; a line
    through (f_n / n)^2 over n^2 then gives both, without the peaks that lie off it.
    """
    rate = take.sample_rate
    first = onset(take.samples, rate) + round(START * rate)
    size = round(WINDOW * rate)
    window = take.samples[:, first : first + size].astype(np.float64)
    if window.shape[1] < size:
        return None
    points = 4 * size
    taper = np.hanning(2 * size)[size:]
    power = (np.abs(np.fft.rfft(window * taper, points)) ** 2).sum(axis=0) + 1e-30
    spacing = rate / points
    frequency, b = _searched(np.log(power), spacing, string)
    numbers, peaks = _peaks(power, spacing, frequency, b, TOP * rate)
    if numbers.size < 3:
        return None
    keep, stiff = np.ones(numbers.size, dtype=bool), True
    intercept = slope = 0.0
    errors = np.zeros(numbers.size)
    squares = (peaks / numbers) ** 2
    for _ in range(4):
        n = numbers[keep].astype(float)
        stiff = n.size >= MIN_STIFF_PARTIALS and n[-1] >= MIN_HIGHEST
        if stiff:
            slope, intercept = (float(each) for each in np.polyfit(n**2, squares[keep], 1))
        else:
            intercept = float(np.median(squares[keep] / (1.0 + b * n**2)))
            slope = b * intercept
        errors = (squares - intercept - slope * numbers**2) / intercept
        kept = np.abs(errors) <= max(6.0 * float(np.median(np.abs(errors[keep]))), 1e-3)
        if kept.sum() < 3 or (kept == keep).all():
            break
        keep = kept
    n = numbers[keep].astype(float)
    std = float(np.std(errors[keep])) / max(1e-9, float(np.std(n**2)) * math.sqrt(n.size))
    f0 = math.sqrt(intercept)
    return Pluck(
        frequency=f0,
        frequency_std=f0 * PITCH_BIAS,
        inharmonicity=slope / intercept if stiff else None,
        inharmonicity_std=std if stiff else None,
        partials=tuple(int(each) for each in numbers[keep]),
        decay=decay_of(take),
    )


def _searched(logs: Floats, spacing: float, string: StringParams) -> tuple[float, float]:
    """Return f0 and B whose partials stand highest over the spectrum between them."""
    nominal = open_frequency(string)
    grid = nominal * np.exp(np.arange(math.log1p(-SEARCHED), math.log1p(SEARCHED), STEP_F0))
    numbers = np.arange(1, MAX_PARTIALS + 1)
    wide = np.maximum.reduce([np.roll(logs, shift) for shift in (-1, 0, 1)])
    top = logs.size - 2
    best, result = -np.inf, (nominal, inharmonicity(string))
    for factor in B_FACTORS:
        b = factor * inharmonicity(string)
        at = grid[:, None] * numbers * np.sqrt(1.0 + b * numbers**2)
        between = at - 0.5 * grid[:, None]
        height = wide[np.minimum((at / spacing).round().astype(int), top)]
        valley = wide[np.minimum((between / spacing).round().astype(int), top)]
        score = np.clip(height - valley, 0.0, 8.0).sum(axis=1)
        i = int(score.argmax())
        if score[i] > best:
            best, result = float(score[i]), (float(grid[i]), float(b))
    return result


def _peaks(power: Floats, spacing: float, f0: float, b: float, top: float) -> tuple[Floats, Floats]:
    """Return numbers and frequencies of the partials that show a peak near where the series has it."""
    numbers: list[int] = []
    peaks: list[float] = []
    frequencies = np.arange(power.size) * spacing
    for n in range(1, MAX_PARTIALS + 1):
        expected = float(stiff_partials(f0, b, n))
        if expected > top:
            break
        reach = max(NEAR * expected, 2.0 * spacing)
        low, high = int((expected - reach) / spacing), int((expected + reach) / spacing) + 2
        around = (frequencies > expected - 0.4 * f0) & (frequencies < expected + 0.4 * f0)
        k = low + int(power[low:high].argmax())
        if not low < k < high - 1 or power[k] < MIN_SALIENCE * np.median(power[around]):
            continue
        y0, y1, y2 = np.log(power[k - 1 : k + 2])
        bend = y0 - 2.0 * y1 + y2
        if bend < 0.0:
            numbers.append(n)
            peaks.append((k + 0.5 * (y0 - y2) / bend) * spacing)
    return np.array(numbers), np.array(peaks)


def decay_of(take: Take) -> float | None:
    """Return the decay rate of the sound's amplitude in 1/s, until it is a third over the noise."""
    size = round(FRAME * take.sample_rate)
    first = onset(take.samples, take.sample_rate)
    samples = take.samples[:, first:].astype(np.float64)
    count = samples.shape[1] // size
    if count < 10:
        return None
    frames = samples[:, : count * size].reshape(2, count, size)
    frames = frames - frames.mean(axis=2, keepdims=True)
    loud = np.abs(frames).max(axis=(0, 2)) > 0.9
    power = (frames**2).mean(axis=(0, 2))
    floor = float(np.median(power[-max(5, count // 5) :]))
    start = int(np.flatnonzero(loud)[-1]) + 1 if loud.any() else 0
    quiet = np.flatnonzero(power[start:] < 8.0 * floor)
    stop = start + (int(quiet[0]) if quiet.size else count - start)
    if stop - start < 3:
        return None
    time = np.arange(start, stop) * FRAME
    return float(-0.5 * np.polyfit(time, np.log(power[start:stop] - floor), 1)[0])


def tuner_turns(string: StringParams, frequency: float) -> float:
    """Return the turns of the tuner's button that bring a string from a pitch to its own; positive tightens.

    The wire lengthens by dT L / (E A) of its core; the post winds that up. Assumed: `TUNER_RATIO`,
    `POST_DIAMETER`, a wire that gives between its ends only, and a frame that does not.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> string = load_string("prototype").string
    >>> round(tuner_turns(string, 0.94 * open_frequency(string)), 2)
    0.11
    """
    missing = string.tension - retuned(string, frequency).tension
    if not string.core_diameter:
        return math.nan
    return missing * string.length / stretch_stiffness(string) * TUNER_RATIO / (math.pi * POST_DIAMETER)


def pitch_check(pluck: Pluck | None, string: StringParams) -> Check:
    """Return whether the open pitch is the design's, and how far to turn the tuner."""
    if pluck is None:
        searched = f"within {100.0 * SEARCHED:.0f} % of the design's pitch"
        advice = f"no string {searched}: pluck it once, harder, drivers off"
        return Check(
            step=STEP, name="open pitch", unit="Hz", passed=False, advice=advice, fault=Reason.NO_STRING
        )
    nominal = open_frequency(string)
    off = pluck.frequency / nominal - 1.0
    if abs(off) <= PITCH_TOLERANCE:
        return Check(step=STEP, name="open pitch", value=pluck.frequency, unit="Hz")
    turns = tuner_turns(string, pluck.frequency)
    cents = 1200.0 * math.log2(1.0 + off)
    way = "tighter" if turns > 0 else "looser"
    assumed = f"{TUNER_RATIO:g}:1, post of {1e3 * POST_DIAMETER:g} mm"
    advice = (
        f"{cents:+.0f} cents off the design's {nominal:.1f} Hz: turn the tuner's button "
        f"{abs(turns):.2f} turns {way} (assumed: {assumed})"
    )
    mistaken = mistaken_rates(1.0 + off)
    if mistaken:
        advice += "; or sound of {} Hz is stated as {} Hz".format(*mistaken)
    return Check(
        step=STEP,
        name="open pitch",
        value=pluck.frequency,
        unit="Hz",
        passed=False,
        advice=advice,
        fault=Reason.WRONG_PITCH,
    )


def wire_check(pluck: Pluck | None, string: StringParams) -> Check:
    """Return whether the stiffness is that of the design's wire at the measured pitch."""
    name = "stiffness over the design's"
    if pluck is None or pluck.inharmonicity is None:
        return left_out(
            STEP, name, "too few partials: pluck near microphone 1 with a plectrum or a fingernail"
        )
    expected = inharmonicity(retuned(string, pluck.frequency))
    ratio = pluck.inharmonicity / expected
    if abs(ratio - 1.0) <= STIFFNESS_TOLERANCE:
        return Check(step=STEP, name=name, value=ratio, unit="times")
    thicker = math.sqrt(max(ratio, 0.0))
    advice = (
        f"the wire sounds {thicker:.2f} times as thick as the design's {1e3 * string.core_diameter:.3f} mm: "
        "measure it, string it with the design's, or name another preset"
    )
    return Check(
        step=STEP,
        name=name,
        value=ratio,
        unit="times",
        passed=False,
        advice=advice,
        fault=Reason.OTHER_STRING,
    )


def decay_check(decay: float | None, sensor: Sensor) -> Check:
    """Return whether the plucked string rings as long as the design's: loose ends take up its energy."""
    name = "decay rate"
    if decay is None:
        return left_out(STEP, name, "no pluck that stands out of the noise")
    pitch = open_frequency(sensor.string)
    expected = float(decay_rates(sensor.string, sensor.losses, np.array([pitch]))[0])
    if decay <= DECAY_FACTOR * expected:
        return Check(step=STEP, name=name, value=decay, unit="1/s")
    advice = (
        f"it dies {decay / expected:.1f} times as fast as the design's ({expected:.0f} 1/s): an "
        f"end is loose, or "
        "something touches the string; tighten saddle, anchor and blocks, and look for what buzzes"
    )
    return Check(
        step=STEP, name=name, value=decay, unit="1/s", passed=False, advice=advice, fault=Reason.LOOSE_END
    )
