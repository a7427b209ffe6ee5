"""Checks of the string, from a pluck with the drivers off: pitch, wire, and ends."""

import math
from dataclasses import replace

import numpy as np

from monochord.bringup.check import Check, Take, left_out
from monochord.core.clock import mistaken_rates
from monochord.core.reasons import Reason
from monochord.core.types import StringParams
from monochord.core.units import Seconds
from monochord.perception.tuning.measurement import StringMeasurement, measured_string, pluck_take
from monochord.perception.tuning.pluck import SEARCHED, onset
from monochord.physics.sensors import retuned
from monochord.physics.theory import (
    decay_rates,
    inharmonicity,
    open_frequency,
    stretch_stiffness,
)
from monochord.physics.twin import Sensor

STEP = "pluck"
FRAME: Seconds = 0.005
KNOWN_STIFFNESS = 0.1
"""Relative standard error of the inharmonicity from which it says nothing about the wire."""
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


def measure_pluck(take: Take, sensor: Sensor) -> StringMeasurement | None:
    """Return what a plucked string of about this design does; None where no series of partials is found."""
    found = pluck_take(take.samples, take.sample_rate, sensor.string)
    return measured_string(sensor, [found]) if found.partials else None


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

    >>> from monochord.physics.strings import load_string
    >>> string = load_string("prototype").string
    >>> round(tuner_turns(string, 0.94 * open_frequency(string)), 2)
    0.11
    """
    missing = string.tension - retuned(string, frequency).tension
    if not string.core_diameter:
        return math.nan
    return missing * string.length / stretch_stiffness(string) * TUNER_RATIO / (math.pi * POST_DIAMETER)


def pitch_check(pluck: StringMeasurement | None, string: StringParams) -> Check:
    """Return whether the open pitch is the design's, and how far to turn the tuner."""
    check = Check(step=STEP, name="open pitch", unit="Hz")
    if pluck is None:
        searched = f"within {100.0 * SEARCHED:.0f} % of the design's pitch"
        return check.failed(Reason.NO_STRING, f"no string {searched}: pluck it once, harder, drivers off")
    nominal, pitch = open_frequency(string), pluck.estimate("open_frequency").value
    off, check = pitch / nominal - 1.0, replace(check, value=pitch)
    if abs(off) <= PITCH_TOLERANCE:
        return check
    turns = tuner_turns(string, pitch)
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
    return check.failed(Reason.WRONG_PITCH, advice)


def wire_check(pluck: StringMeasurement | None, string: StringParams) -> Check:
    """Return whether the stiffness is that of the design's wire at the measured pitch."""
    name = "stiffness over the design's"
    stiffness = None if pluck is None else pluck.estimate("inharmonicity")
    if pluck is None or stiffness is None or stiffness.std > KNOWN_STIFFNESS * stiffness.value:
        return left_out(
            STEP, name, "too few partials: pluck near microphone 1 with a plectrum or a fingernail"
        )
    expected = inharmonicity(retuned(string, pluck.estimate("open_frequency").value))
    ratio = stiffness.value / expected
    check = Check(step=STEP, name=name, value=ratio, unit="times")
    if abs(ratio - 1.0) <= STIFFNESS_TOLERANCE:
        return check
    thicker = math.sqrt(max(ratio, 0.0))
    advice = (
        f"the wire sounds {thicker:.2f} times as thick as the design's {1e3 * string.core_diameter:.3f} mm: "
        "measure it, string it with the design's, or name another preset"
    )
    return check.failed(Reason.OTHER_STRING, advice)


def decay_check(decay: float | None, sensor: Sensor) -> Check:
    """Return whether the plucked string rings as long as the design's: loose ends take up its energy."""
    name = "decay rate"
    if decay is None:
        return left_out(STEP, name, "no pluck that stands out of the noise")
    pitch = open_frequency(sensor.string)
    expected = float(decay_rates(sensor.string, sensor.losses, np.array([pitch]))[0])
    check = Check(step=STEP, name=name, value=decay, unit="1/s")
    advice = (
        f"it dies {decay / expected:.1f} times as fast as the design's ({expected:.0f} 1/s): an end is "
        "loose, or something touches the string; tighten saddle, anchor and blocks, and look for what buzzes"
    )
    return check if decay <= DECAY_FACTOR * expected else check.failed(Reason.LOOSE_END, advice)
