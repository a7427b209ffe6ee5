"""An untouched string as its sound tells it: pitch, stiffness, ends, magnets, and how its partials die away.

One measurement for every command that asks. Each take of the string gives partials: those that last over its
windows, and of a pluck those at its beginning, too. `fit_string` fits the string, its drivers' magnets and
its yielding ends to all of them, so that takes with and without drivers agree.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan, sqrt
from typing import Any

import numpy as np

from monochord.core.reasons import Reason
from monochord.core.types import Audio, Estimate, Floats, Signal, StringParams, Window
from monochord.core.units import Hertz, KilogramsPerMetre, Metres, Samples, Seconds
from monochord.perception.tuning.lines import (
    GROWTH_STD,
    LAST_FREQUENCY,
    LAST_GROWTH,
    LAST_POWER_1,
    LAST_POWER_2,
    LAST_STD,
    PRESENCE,
    lasting_lines,
)
from monochord.perception.tuning.pluck import pluck_partials
from monochord.perception.tuning.reading import MIN_DECAY, SUSTAINED_DECADES, read_tuning
from monochord.perception.tuning.tuner import MIN_SHARE, Tuner, TunerState, Tuning
from monochord.physics.identification import DRIVEN_STD, FREE_STD, HELD_STD, NAMES, StringFit, fit_string
from monochord.physics.sensors import SensorTuning
from monochord.physics.twin import Sensor

LENGTH: Seconds = 0.1
HOP: Seconds = 0.025
"""Length and distance of the windows of a take: a pluck dies away within a few of them, so they overlap."""
MIN_PARTIALS = 3
"""Partials at a pluck's beginning from which they are taken for a string's."""
KEEP = 1000
"""Largest number of windows of a take."""
PLUCK_STD = 5e-4
"""Relative deviation of a partial at a pluck's beginning from the model: on 48 builds of the twin the stated
errors of pitch and stiffness are then 1.1 times the true ones."""
DECAY_STD = 0.3
"""Relative standard error up to which a decay rate is known."""
LENGTH_STD = 0.0058
"""Relative standard error of a length that nobody measured: evenly within 1 % of the design's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Partial:
    """A partial of the untouched string: number, frequency in Hz, decay rate in 1/s, their standard errors.

    `decay` is NaN at a pluck's beginning, whose high partials are gone before it can be told. `level` is the
    power in dB of full scale; `held` says that a driver sustains it, `used` that the fit of the string does
    not leave it out; `take` counts the recordings from 0.
    """

    number: int
    frequency: Hertz
    frequency_std: Hertz
    decay: float = nan
    decay_std: float = nan
    level: float = nan
    held: bool = False
    take: int = 0
    plucked: bool = False
    used: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class StringTake:
    """What one take tells: its partials, or none and the `reason`, from `windows` and `channels` (from 1)."""

    partials: tuple[Partial, ...] = ()
    reason: str = Reason.NONE
    windows: int = 0
    refused: int = 0
    channels: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class StringMeasurement:
    """A measured string: the fit with the covariance of its quantities, and the partials behind it."""

    fit: StringFit
    partials: tuple[Partial, ...]
    windows: int = 0
    channels: tuple[int, ...] = (1, 2)

    def estimate(self, name: str) -> Estimate:
        """Return a quantity of `NAMES` with its standard error."""
        at = NAMES.index(name)
        std = sqrt(self.fit.covariance[at, at])
        return Estimate(value=float(self.fit.values[at]), std=std, unit=UNITS[name])

    @property
    def tuning(self) -> Tuning:
        """Pitch, stiffness and losses, as a sensor's file holds them."""
        pitch, bend = self.estimate("open_frequency"), self.estimate("inharmonicity")
        decay, decay_std = self._decay()
        loudest = sorted(self.partials, key=lambda each: -np.nan_to_num(each.level, nan=-np.inf))
        return Tuning(
            frequency=pitch.value,
            frequency_std=pitch.std,
            inharmonicity=bend.value,
            inharmonicity_std=bend.std,
            decay=decay,
            decay_std=decay_std,
            partials=tuple(dict.fromkeys(each.number for each in loudest if each.used)),
            windows=self.windows,
            channels=self.channels,
        )

    def in_file(self, string: StringParams, **about: Any) -> SensorTuning:
        """Return the values as a sensor's file holds them; `about` has its other fields."""
        tuning = self.tuning
        tension, tension_std = tuning.tension(string)
        known = tuning.decay > 0.0
        return SensorTuning(
            open_frequency=tuning.frequency,
            open_frequency_std=tuning.frequency_std,
            tension=tension,
            tension_std=tension_std,
            inharmonicity=tuning.inharmonicity,
            inharmonicity_std=tuning.inharmonicity_std,
            decay=tuning.decay if known else None,
            decay_std=tuning.decay_std if known else None,
            partials=tuning.partials,
            microphones=tuning.channels,
            **about,
        )

    def _decay(self) -> tuple[float, float]:
        """Return the decay rate in 1/s of the lowest partial that rings freely, and its standard error."""
        free = [each for each in self.partials if not each.held and each.decay_std < DECAY_STD * each.decay]
        lowest = min(free, key=lambda each: each.number, default=None)
        return (nan, nan) if lowest is None else (lowest.decay, lowest.decay_std)


UNITS: Mapping[str, str] = dict(zip(NAMES, ("Hz", "1", "m", "kg/m", "N", "N/m", "N/m"), strict=True))
"""Unit of each quantity."""


def measured_string(
    sensor: Sensor,
    takes: Sequence[StringTake],
    *,
    length: tuple[Metres, Metres] | None = None,
    linear_density: tuple[KilogramsPerMetre, KilogramsPerMetre] | None = None,
) -> StringMeasurement:
    """Return the string that several takes of it tell; raises `InputError` if none of them has a partial.

    The `sensor` is the design. `length` in m and `linear_density` in kg/m come with their standard errors
    where they were measured.
    """
    partials = tuple(each for take in takes for each in take.partials)
    design = sensor.string.length
    fit = fit_string(
        sensor,
        np.array([each.number for each in partials], float),
        np.array([each.frequency for each in partials]),
        np.array([each.frequency_std for each in partials]),
        length=length or (design, LENGTH_STD * design),
        linear_density=linear_density,
    )
    return StringMeasurement(
        fit=fit,
        partials=tuple(replace(each, used=used) for each, used in zip(partials, fit.used, strict=True)),
        windows=sum(take.windows for take in takes),
        channels=tuple(sorted({channel for take in takes for channel in take.channels})),
    )


def string_take(
    windows: Iterable[Window],
    signal: Signal,
    string: StringParams,
    *,
    size: Samples,
    hop: Samples,
    take: int = 0,
) -> StringTake:
    """Return the partials in a take of an untouched string.

    Its windows have `size` frames, one every `hop` frames; touched ones may be among them. The `string` is
    the design's.
    """
    tuner = replace(Tuner.of(replace(signal, string=string), size), keep=KEEP, every=hop / signal.sample_rate)
    state, sound = TunerState(), list[Audio]()
    for window in windows:
        state = tuner.step(state, window)
        sound.append(window.samples[:, -hop:] if sound else window.samples)
    found = StringTake(windows=len(state.lines), refused=state.refusals, reason=state.reason)
    reason = tuner.reason_against(state)
    if state.tuning is None or reason:
        return replace(found, reason=reason or state.reason)
    share = MIN_SHARE if len(state.tuning.channels) > 1 else 0.0
    lasting = lasting_lines(state.lines, signal.sample_rate / size)
    numbers = read_tuning(lasting, tuner.nominal, tuner.stiffness, share).numbers
    partials, plucked = _lasting_partials(lasting, numbers, take)
    if plucked:
        known = {each.number for each in partials}
        more = pluck_partials(np.concatenate(sound, axis=1), signal.sample_rate, string)
        partials += [each for each in first_partials(*more, take=take) if each.number not in known]
    return replace(found, partials=tuple(partials), reason=Reason.NONE, channels=state.tuning.channels)


def pluck_take(samples: Audio, sample_rate: int, string: StringParams) -> StringTake:
    """Return the partials of a plucked string in one piece of sound (channels, n).

    Where the pitch is more than 10 % off the design's, they are those of the pluck's beginning.
    """
    signal = Signal(sample_rate=sample_rate, channels=len(samples))
    size, hop = round(LENGTH * sample_rate), round(HOP * sample_rate)
    parts = (
        Window(samples=samples[:, start : start + size], start=start, sample_rate=sample_rate)
        for start in range(0, samples.shape[1] - size + 1, hop)
    )
    found = string_take(parts, signal, string, size=size, hop=hop)
    if found.partials:
        return found
    first = first_partials(*pluck_partials(samples, sample_rate, string))
    return StringTake(partials=tuple(first) if len(first) >= MIN_PARTIALS else (), reason=found.reason)


def first_partials(numbers: Floats, frequencies: Floats, *, take: int = 0) -> list[Partial]:
    """Return partials (n,) of a pluck's beginning, from `pluck_partials`."""
    return [
        Partial(number=int(n), frequency=f, frequency_std=PLUCK_STD * f, take=take, plucked=True)
        for n, f in zip(numbers.tolist(), frequencies.tolist(), strict=True)
    ]


def _lasting_partials(lines: Floats, numbers: Floats, take: int) -> tuple[list[Partial], bool]:
    """Return the partials among lasting lines, and whether the take is a pluck that dies away."""
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    dying = (lines[:, LAST_GROWTH] < -MIN_DECAY) & (lines[:, LAST_GROWTH] < -3.0 * lines[:, GROWTH_STD])
    plucked = bool(dying[0])
    held = ~dying & (power > power[0] * 10.0**-SUSTAINED_DECADES) & (lines[:, PRESENCE] > 0.5)
    chosen = np.flatnonzero((numbers > 0.0) & (dying | (held & (not plucked))))
    model = np.where(held, HELD_STD, FREE_STD if plucked else DRIVEN_STD)
    return [
        Partial(
            number=int(numbers[i]),
            frequency=float(lines[i, LAST_FREQUENCY]),
            frequency_std=float(np.hypot(lines[i, LAST_STD], model[i] * lines[i, LAST_FREQUENCY])),
            decay=float(-lines[i, LAST_GROWTH]),
            decay_std=float(lines[i, GROWTH_STD]),
            level=float(10.0 * np.log10(power[i])),
            held=bool(held[i]),
            take=take,
            plucked=plucked,
        )
        for i in chosen.tolist()
    ], plucked
