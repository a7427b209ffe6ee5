"""What the piezo buffer does to the signal, from its values. SI units; the JFET after the square law."""

from dataclasses import dataclass
from math import pi, sqrt

BIAS = 3.0
"""Voltage at the gate: 9 V over 200 k and 100 k."""
SOURCE_RESISTOR = 4.7e3
GATE_RESISTOR = 10e6
BOLTZMANN_T = 1.380649e-23 * 293.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Follower:
    """A source follower: voltage at its source, current, gain, and output impedance with R7."""

    voltage: float
    current: float
    gain: float
    impedance: float


def follower(*, cutoff: float, saturation: float) -> Follower:
    """Return the working point of a JFET of this gate cut-off voltage (negative) and saturation current.

    I = I_DSS (1 - V_GS / V_off)^2 with V_GS = V_bias - I R; gm = 2 sqrt(I I_DSS) / |V_off|.

    Examples
    --------
    >>> weak = follower(cutoff=-0.5, saturation=2e-3)
    >>> round(weak.voltage, 1), round(weak.gain, 2)
    (3.2, 0.96)
    """
    voltage, step = BIAS, -cutoff / 2.0
    for _ in range(60):  # bisection between the gate's voltage and that less the cut-off
        wanted = saturation * max(1.0 - (BIAS - voltage - step) / cutoff, 0.0) ** 2
        voltage += step if wanted > (voltage + step) / SOURCE_RESISTOR else 0.0
        step /= 2.0
    current = voltage / SOURCE_RESISTOR
    slope = 2.0 * sqrt(current * saturation) / -cutoff
    gain = slope * SOURCE_RESISTOR / (1.0 + slope * SOURCE_RESISTOR)
    return Follower(voltage=voltage, current=current, gain=gain, impedance=1.0 / slope + 100.0)


def low_corner(capacitance: float, resistance: float = GATE_RESISTOR) -> float:
    """Return the frequency in Hz below which a disc loses level into a resistance: 1 / (2 pi R C)."""
    return 1.0 / (2.0 * pi * resistance * capacitance)


def resistor_noise(capacitance: float, frequency: float) -> float:
    """Return the noise of the gate's resistor on a disc in V/sqrt(Hz): sqrt(4 k T / R) over omega C."""
    return sqrt(4.0 * BOLTZMANN_T / GATE_RESISTOR) / (2.0 * pi * frequency * capacitance)
