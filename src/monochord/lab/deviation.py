"""Deviations of a sensor and its object, one quantity each: faults and test conditions, set by hand.

The plausible world draws many effects at once. A deviation sets single effects, for sessions that differ only
in them.
"""

from dataclasses import dataclass, replace
from typing import Annotated

from msgspec import Meta

from monochord.core.ranges import Checked
from monochord.core.units import Hertz
from monochord.physics.setup import ContactLaw, End, Mount, Pickups
from monochord.physics.twin import Sensor, Touch
from monochord.physics.twin.variation import tension_per_kelvin
from monochord.physics.twin.world import SIGNAL

END_COMPLIANCE, END_ADMITTANCE = 1e-6, 5e-3
"""Of an end that yields, in m/N and s/kg: within the plausible world's range, towards the softer ones."""
END_RESONANCES: tuple[Hertz, Hertz] = (700.0, 1600.0)
"""Of the two ends: assumed, within the plausible world's range."""
MAX_TUNING = 0.3
"""Largest relative change of the pitch to which a string is tuned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation(Checked):
    """Deviations of a session's sensor and object; none by default.

    Parameters
    ----------
    distortion
        Second harmonic that the chain adds to a sine of half of full scale, as a share of it.
    snr
        Ratio in dB of a usual sound, `SIGNAL`, to the noise of preamplifier and converter; None for the
        sensor's own.
    warming
        Change of the temperature of frame and string, in K.
    pitch
        Relative change of the open string's frequency by a drift of its tension since it was tuned.
    tuning
        Relative change of the frequency to which the string is tuned: another tension from the start, which
        the design does not say. None for the design's.
    drive
        Factor of both drivers' gain and limit.
    ends
        Whether the string's ends yield.
    spring
        Stiffness in N/m of a spring in series with the object, below it; None for an object that is held
        rigidly.
    linear
        Whether the contact's force is proportional to its compression, as of a layered print.
    gauge
        Factor of the wire's diameter; it is tuned to the same pitch.
    dead_driver
        Number of a driver, 1 or 2, that gives no force; 0 for none.
    dead_microphone
        Number of a microphone, 1 or 2, that picks up nothing of the string; 0 for none.
    swapped
        Whether the microphones are connected the other way round.
    """

    distortion: Annotated[float, Meta(ge=-0.01, le=0.01)] = 0.0
    snr: Annotated[float, Meta(ge=0.0, le=120.0)] | None = None
    warming: Annotated[float, Meta(ge=-60.0, le=60.0)] = 0.0
    pitch: Annotated[float, Meta(ge=-0.1, le=0.1)] = 0.0
    tuning: Annotated[float, Meta(ge=-MAX_TUNING, le=MAX_TUNING)] | None = None
    drive: Annotated[float, Meta(ge=0.05, le=20.0)] = 1.0
    ends: bool = False
    spring: Annotated[float, Meta(ge=1e3, le=1e12)] | None = None
    linear: bool = False
    gauge: Annotated[float, Meta(ge=0.5, le=2.0)] = 1.0
    dead_driver: Annotated[int, Meta(ge=0, le=2)] = 0
    dead_microphone: Annotated[int, Meta(ge=0, le=2)] = 0
    swapped: bool = False

    def of_sensor(self, sensor: Sensor) -> Sensor:
        """Return a sensor with this deviation.

        Examples
        --------
        >>> from monochord.physics.sensors import load_sensor
        >>> sensor = load_sensor("prototype")
        >>> Deviation().of_sensor(sensor) == sensor
        True
        >>> round(Deviation(pitch=0.02).of_sensor(sensor).drift, 2)
        2.63
        """
        first, second = (replace(each, level=self.drive * each.level) for each in sensor.drivers)
        if self.dead_driver:
            dead = replace((first, second)[self.dead_driver - 1], limit=0.0)
            first, second = (dead, second) if self.dead_driver == 1 else (first, dead)
        pickups = self._connected(sensor.pickups)
        if self.distortion:
            pickups = replace(pickups, distortion=(self.distortion, pickups.distortion[1]))
        if self.snr is not None:
            pickups = replace(pickups, hiss=SIGNAL * 10.0 ** (-self.snr / 20.0))
        if self.gauge != 1.0:
            string = sensor.string
            heavier = replace(
                string,
                linear_density=self.gauge**2 * string.linear_density,
                tension=self.gauge**2 * string.tension,
                core_diameter=self.gauge * string.core_diameter,
            )
            sensor = replace(sensor, string=heavier, drift=self.gauge**2 * sensor.drift)
        if self.tuning is not None:
            share, string = (1.0 + self.tuning) ** 2, sensor.string
            string = replace(string, tension=share * string.tension)
            sensor = replace(sensor, string=string, drift=share * sensor.drift)
        drift = sensor.string.tension * ((1.0 + self.pitch) ** 2 - 1.0)
        drift += self.warming * tension_per_kelvin(sensor)
        changed = replace(sensor, drivers=(first, second), pickups=pickups, drift=sensor.drift + drift)
        return replace(changed, ends=_yielding_ends()) if self.ends else changed

    def _connected(self, pickups: Pickups) -> Pickups:
        """Return the microphones as they are connected."""
        if self.swapped:
            shares, gain, hum = pickups.own, pickups.gain, pickups.hum
            pickups = replace(
                pickups,
                own=(1.0 - shares[1], 1.0 - shares[0]),
                gain=(gain[1], gain[0]),
                hum=(hum[1], hum[0]),
                feed=(pickups.feed[1], pickups.feed[0]),
                air=(pickups.air[1], pickups.air[0]),
            )
        if self.dead_microphone:
            gain = pickups.gain
            pickups = replace(pickups, gain=(0.0, gain[1]) if self.dead_microphone == 1 else (gain[0], 0.0))
        return pickups

    def of_touch(self, touch: Touch) -> Touch:
        """Return a touch with this deviation of its object."""
        if self.spring is not None:
            touch = replace(touch, mount=Mount(modes=touch.mount.modes, compliance=1.0 / self.spring))
        return replace(touch, law=ContactLaw(exponent=1.0)) if self.linear else touch


NONE = Deviation()


def _yielding_ends() -> tuple[End, End]:
    first, second = (
        End(compliance=END_COMPLIANCE, admittance=END_ADMITTANCE, frequency=frequency)
        for frequency in END_RESONANCES
    )
    return first, second
