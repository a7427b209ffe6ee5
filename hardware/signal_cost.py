"""``python -m hardware.signal_cost``: what the hardware's choices cost, simulated, with the bundled model.

A wound coil gives less force than the preset's driver; the gain, which an amplifier sets, stays. Two EBows
lie mirrored below the string, as in the preset `prototype_ebow`, and have their coils where they have them.
Ten touches on each of twenty builds of the world `plausible`; the model is told each build's length, as by
``monochord tune --length``. The table takes some ten minutes on one core.
"""

from dataclasses import dataclass, replace

import numpy as np

import monochord as mc
from monochord.physics.sensors import Sensor, load_sensor, with_length

FORCES_AND_GAINS = ((0.5, 1.0), (0.25, 1.0), (0.125, 1.0), (0.25, 4.0))
"""Shares of the driver's largest force, and factors on the microphones' gain."""
PLACES = (
    (0.015, 0.013),
    (0.015, 0.030),
    (0.015, 0.040),
    (0.015, 0.055),
    (0.020, 0.030),
    (0.027, 0.030),
)
"""Of a mirrored EBow: its sense coil from the end of the string, and its drive coil from that one, in m."""
POSITIONS = (0.06, 0.08, 0.1, 0.12, 0.14)
FORCES = (0.3, 0.8, 1.6)
BUILDS = tuple(range(1, 21))
LAST = 20
"""Windows of a settled touch that are scored."""
GROSS = 5e-3
"""Error of position in m above which an answer counts as wrong."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a sensor gives: a touch's `loudness` in dB FS, shares `answered` and `gross`, errors in m, N."""

    loudness: float
    answered: float
    position: float
    gross: float
    force: float


def weaker(share: float, gain: float) -> Sensor:
    """Return the prototype with weaker drivers and another gain of the microphones."""
    design = load_sensor("prototype")
    first, second = (replace(each, limit=share * each.limit) for each in design.drivers)
    one, two = design.pickups.gain
    return replace(
        design, drivers=(first, second), pickups=replace(design.pickups, gain=(gain * one, gain * two))
    )


def mirrored(sense: float, spacing: float) -> Sensor:
    """Return `prototype_ebow` with its coils elsewhere: the sense coils outside, as far from both ends."""
    design = load_sensor("prototype_ebow")
    first, second = design.drivers
    length = design.string.length
    return replace(
        design,
        drivers=(
            replace(first, sense=sense, drive=sense + spacing),
            replace(second, sense=length - sense, drive=length - sense - spacing),
        ),
    )


def cost(sensor: Sensor) -> Cost:
    """Return what a sensor gives, over all touches of all builds."""
    model = mc.load("demo")
    power, places, forces = list[float](), list[float](), list[float]()
    for build in BUILDS:
        twin = mc.VirtualSensor(sensor, seed=build, build=build, world="plausible")
        string = with_length(sensor.string, round(twin.sensor.string.length, 4))
        told = replace(sensor, string=string)
        for index, position in enumerate(POSITIONS * 2):
            force = FORCES[(index + build) % len(FORCES)]
            untouched, _ = twin.advance(0.4)
            twin.press(position, force, material="plastic")
            touched, _ = twin.advance(0.6)
            twin.release()
            table = model.predict(np.concatenate([untouched, touched], axis=1), sensor=told)
            power.append(float(np.mean(touched[:, -8820:] ** 2)))
            places += [abs(each - position) for each in table.position.value[-LAST:] if np.isfinite(each)]
            forces += [abs(each - force) for each in table.force.value[-LAST:] if np.isfinite(each)]
            twin.advance(0.3)
    return Cost(
        loudness=10.0 * float(np.log10(np.mean(power))),
        answered=len(places) / (LAST * len(BUILDS) * 2 * len(POSITIONS)),
        position=float(np.mean(places)),
        gross=float(np.mean(np.array(places) > GROSS)),
        force=float(np.mean(forces)),
    )


def main() -> None:
    """Print a row for each sensor."""
    sensors = {"prototype": load_sensor("prototype")}
    sensors |= {f"force {share:g}, gain {gain:g}": weaker(share, gain) for share, gain in FORCES_AND_GAINS}
    sensors |= {
        f"mirrored, coils at {1e3 * sense:g} and {1e3 * (sense + spacing):g} mm": mirrored(sense, spacing)
        for sense, spacing in PLACES
    }
    print("Simulated.")
    print(f"{'sensor':34s}   dB FS   answered   position mm   > {1e3 * GROSS:g} mm   force N")
    for name, sensor in sensors.items():
        row = cost(sensor)
        print(
            f"{name:34s}  {row.loudness:6.1f}  {row.answered:7.1%}  {1e3 * row.position:12.2f}  "
            f"{row.gross:7.2%}  {row.force:8.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
