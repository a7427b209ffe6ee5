"""``python -m hardware.signal_cost``: what a weaker driver costs, simulated, with the bundled model.

A wound coil gives less force than the preset's driver. A level is the share of its largest force; the gain,
which an amplifier sets, stays.
"""

from dataclasses import replace

import numpy as np

import monochord as mc
from monochord.physics.sensors import load_sensor

CASES = ((1.0, 1.0), (0.5, 1.0), (0.25, 1.0), (0.125, 1.0), (0.25, 4.0))
"""Shares of the driver's force, and factors on the microphones' gain."""
POSITIONS = (0.06, 0.08, 0.1, 0.12, 0.14)
FORCES = (0.3, 0.8, 1.6)
BUILDS = (1, 2)


def errors(level: float, gain: float) -> tuple[float, float, float, float]:
    """Return the loudness of a settled touch in dB, share answered, and MAE in mm and in N."""
    design = load_sensor("prototype")
    first, second = (replace(each, limit=level * each.limit) for each in design.drivers)
    one, two = design.pickups.gain
    pickups = replace(design.pickups, gain=(gain * one, gain * two))
    sensor = replace(design, drivers=(first, second), pickups=pickups)
    model = mc.load("demo")
    power: list[float] = []
    places: list[float] = []
    forces: list[float] = []
    asked = 0
    for build in BUILDS:
        twin = mc.VirtualSensor(sensor, seed=build, build=build, world="plausible")
        for index, position in enumerate(POSITIONS):
            force = FORCES[(index + build) % len(FORCES)]
            untouched, _ = twin.advance(0.4)
            twin.press(position, force, material="plastic")
            touched, _ = twin.advance(0.6)
            twin.release()
            table = model.predict(np.concatenate([untouched, touched], axis=1), sensor="prototype")
            power.append(float(np.mean(touched[:, -8820:] ** 2)))
            late = slice(-20, None)
            asked += 20
            places += [abs(each - position) for each in table.position.value[late] if np.isfinite(each)]
            forces += [abs(each - force) for each in table.force.value[late] if np.isfinite(each)]
            twin.advance(0.3)
    return (
        10.0 * float(np.log10(np.mean(power))),
        len(places) / asked,
        1e3 * float(np.mean(places)),
        float(np.mean(forces)),
    )


def main() -> None:
    """Print a row for each level."""
    print("level  gain   dB FS   answered   position mm   force N")
    for level, gain in CASES:
        loudness, share, place, force = errors(level, gain)
        print(
            f"{level:5.3f}  {gain:4.1f}  {loudness:6.1f}  {100.0 * share:7.0f} %  {place:12.2f}  {force:8.2f}"
        )


if __name__ == "__main__":
    main()
