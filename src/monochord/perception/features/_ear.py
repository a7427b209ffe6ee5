"""What features by physics share: spectra of a window, its lines, and what they are read as."""

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal, StringParams
from monochord.core.units import Hertz, Metres, Samples
from monochord.perception.features._lines import powers, strongest, whole
from monochord.perception.features._reading import Reading, read
from monochord.physics.theory import open_frequency

LEAST_BINS = 14
"""Bins from 0 Hz to the open frequency that a window must have at least: lines must stand apart."""
LOWEST_SHARE = 0.8
"""Lines below this share of the open frequency are rumble and hum."""
TOP: Hertz = 20000.0
"""Highest frequency looked at."""


class Heard(NamedTuple):
    """One window: samples about their mean (2, n), transform and Hann power (2, bins), and the reading."""

    samples: Floats
    plain: NDArray[np.complex128]
    power: Floats
    reading: Reading


@dataclass(frozen=True, slots=True, kw_only=True)
class Ear:
    """Listens to windows of one size; made by `Ear.of`, which refuses what cannot be served."""

    string: StringParams
    sample_rate: int
    size: Samples
    nominal: Hertz
    beta: float

    @property
    def spacing(self) -> Hertz:
        """Distance of two bins."""
        return self.sample_rate / self.size

    @property
    def length(self) -> Metres:
        """Length of the string."""
        return self.string.length

    @classmethod
    def of(cls, signal: Signal, size: Samples) -> "Ear":
        """Return the ear for a signal, compiled; raises `InputError` for one that it cannot serve."""
        string = signal.string
        if signal.channels != 2 or string is None:
            given = f"{signal.channels} channel(s) of {'an unknown' if string is None else 'a known'} string"
            raise InputError(given, "two channels of a known string", "name it with --string")
        nominal, rate = open_frequency(string), signal.sample_rate
        if rate < 8.0 * nominal:
            raise InputError(f"sample rate {rate:g} Hz", f"from {8.0 * nominal:.0f} Hz on for this string")
        least = int(np.ceil(LEAST_BINS * rate / nominal))
        if size < least:
            raise InputError(f"a window of {size} frames", f"from {least} frames on for this string")
        bending = pi**3 * string.young_modulus * string.core_diameter**4 / 64.0
        ear = cls(
            string=string,
            sample_rate=rate,
            size=size,
            nominal=nominal,
            beta=bending / string.tension,
        )
        ear.hear(np.zeros((2, size), np.float32))
        return ear

    def hear(self, window: Audio) -> Heard:
        """Return what is heard in a window (2, size)."""
        samples = whole(np.array(window, np.float32, order="C"))
        plain = np.fft.rfft(samples)
        power = powers(plain, self.size)
        lines = strongest(plain, power, self.spacing, LOWEST_SHARE * self.nominal, TOP)
        told = read(*lines, power, self.spacing, (self.length, self.nominal, self.beta))
        return Heard(samples, plain, power, Reading(*told.tolist()))

    def partials(self, fundamental: Hertz, side: Metres, count: int) -> Floats:
        """Return the first partials in Hz of a stretch `side` m long whose flexible fundamental that is."""
        number = np.arange(1.0, count + 1.0)
        return number * fundamental * np.sqrt(1.0 + self.beta * (number / side) ** 2)

    def per_mille(self, frequency: Hertz) -> float:
        """Return by how many thousandths a frequency lies above the nominal open one; 0 for none."""
        return 1000.0 * (frequency / self.nominal - 1.0) if frequency > 0.0 else 0.0
