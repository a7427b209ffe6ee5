"""What a drive coil induces in the sense coil beside it, over what the string does. An estimate; SI units."""

from math import log10, pi, sin

import numpy as np

from hardware.cad.coil import VACUUM, pull, winding, window
from hardware.cad.parameters import Hardware
from monochord.physics.theory import decay_rates, open_frequency


def mutual_inductance(hardware: Hardware, spacing: float) -> float:
    """Return that of two bobbins side by side, in H, as of dipoles: mu0 (N A)^2 / (4 pi d^3), no cores."""
    inner, depth, _ = window(hardware)
    area = pi * (inner + depth / 2.0) ** 2
    return VACUUM * (winding(hardware).turns * area) ** 2 / (4.0 * pi * spacing**3)


def feedthrough(hardware: Hardware, driver: int) -> float:
    """Return the ratio of the voltage that a drive coil induces to that of the string it drives, in dB.

    At the untouched fundamental, for one ampere: omega M, against K^2 times the string's mobility between
    both coils, sin sin / (m 2 sigma). K is the force for an ampere, which is also the voltage for 1 m/s.
    Steel poles raise the first and are left out: this is the least.
    """
    string = hardware.sensor.string
    frequency = open_frequency(string)
    sense, drive = (1e-3 * each for each in hardware.coils[driver])
    sigma = float(decay_rates(string, hardware.sensor.losses, np.array([frequency]))[0])
    shape = sin(pi * sense / string.length) * sin(pi * drive / string.length)
    mobility = shape / (string.linear_density * string.length * sigma)
    force = pull(hardware, clearance=1e-3 * hardware.pole_clearance).per_ampere
    coupled = 2.0 * pi * frequency * mutual_inductance(hardware, abs(sense - drive))
    return 20.0 * log10(coupled / (force**2 * mobility))
