"""``python -m hardware.signal_cost``: what the hardware's choices cost, simulated, with the bundled model.

A wound coil gives less force than the preset's driver; the gain, which an amplifier sets, stays. Two EBows
of one coil spacing need other places: mirrored, their sense coils outside.
"""

from dataclasses import replace

import numpy as np

import monochord as mc
from monochord.physics.sensors import Sensor, load_sensor

FORCES_AND_GAINS = ((1.0, 1.0), (0.5, 1.0), (0.25, 1.0), (0.125, 1.0), (0.25, 4.0))
"""Shares of the driver's largest force, and factors on the microphones' gain."""
SPACINGS = (0.013, 0.025, 0.040, 0.055)
"""Between the coils of a mirrored EBow, in m."""
POSITIONS = (0.06, 0.08, 0.1, 0.12, 0.14)
FORCES = (0.3, 0.8, 1.6)
BUILDS = (1, 2)
LAST = 20
"""Windows of a settled touch that are scored."""


def weaker(share: float, gain: float) -> Sensor:
    """Return the prototype with weaker drivers and another gain of the microphones."""
    design = load_sensor("prototype")
    first, second = (replace(each, limit=share * each.limit) for each in design.drivers)
    one, two = design.pickups.gain
    return replace(
        design, drivers=(first, second), pickups=replace(design.pickups, gain=(gain * one, gain * two))
    )


def mirrored(spacing: float) -> Sensor:
    """Return the prototype with both sense coils 15 mm from their end and the drive coils inside them."""
    design = load_sensor("prototype")
    first, second = design.drivers
    outer = design.string.length - first.sense
    return replace(
        design,
        drivers=(
            replace(first, drive=first.sense + spacing),
            replace(second, sense=outer, drive=outer - spacing),
        ),
    )


def errors(sensor: Sensor) -> tuple[float, float, float, float]:
    """Return the loudness of a settled touch in dB, share answered, and MAE in mm and in N."""
    model = mc.load("demo")
    power: list[float] = []
    places: list[float] = []
    forces: list[float] = []
    for build in BUILDS:
        twin = mc.VirtualSensor(sensor, seed=build, build=build, world="plausible")
        for index, position in enumerate(POSITIONS):
            force = FORCES[(index + build) % len(FORCES)]
            untouched, _ = twin.advance(0.4)
            twin.press(position, force, material="plastic")
            touched, _ = twin.advance(0.6)
            twin.release()
            table = model.predict(np.concatenate([untouched, touched], axis=1), sensor=sensor)
            power.append(float(np.mean(touched[:, -8820:] ** 2)))
            places += [abs(each - position) for each in table.position.value[-LAST:] if np.isfinite(each)]
            forces += [abs(each - force) for each in table.force.value[-LAST:] if np.isfinite(each)]
            twin.advance(0.3)
    return (
        10.0 * float(np.log10(np.mean(power))),
        len(places) / (LAST * len(BUILDS) * len(POSITIONS)),
        1e3 * float(np.mean(places)),
        float(np.mean(forces)),
    )


def main() -> None:
    """Print a row for each sensor."""
    sensors = {f"force {share:g}, gain {gain:g}": weaker(share, gain) for share, gain in FORCES_AND_GAINS}
    sensors |= {f"mirrored, coils {1e3 * each:g} mm apart": mirrored(each) for each in SPACINGS}
    print(f"{'sensor':30s}   dB FS   answered   position mm   force N")
    for name, sensor in sensors.items():
        loudness, share, place, force = errors(sensor)
        print(f"{name:30s}  {loudness:6.1f}  {100.0 * share:7.0f} %  {place:12.2f}  {force:8.2f}", flush=True)


if __name__ == "__main__":
    main()
