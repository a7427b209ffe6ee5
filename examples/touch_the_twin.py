"""Press, slide and lift an object on the virtual sensor; read what it heard and what was true.

Run it: python examples/touch_the_twin.py
"""

import numpy as np

from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Key, Pluck, Scene, Touch, advance, begin

BLOCK = 4410  # frames: 0.1 s


def main() -> None:
    """Print level and labels every tenth of a second; the sound does not depend on the size of blocks."""
    sensor = load_sensor("prototype")
    motion = (
        Key(time=0.2, position=0.08, clearance=1e-3),
        Key(time=0.25, position=0.08, force=1.0),  # pressed
        Key(time=0.6, position=0.08, force=1.0),
        Key(time=0.61, position=0.08, force=1.0, across=0.02),  # slides across the string at 20 mm/s
        Key(time=0.9, position=0.08, force=1.0, across=0.02),
        Key(time=0.91, position=0.08, force=1.0),
        Key(time=1.1, position=0.08, force=1.0),
        Key(time=1.15, position=0.08, clearance=1e-3),  # and is gone
    )
    touch = Touch(material=load_material("wood"), motion=motion)
    scene = Scene(touches=(touch,), pluck=Pluck(position=0.04, height=1e-4))
    twin = begin(sensor, scene, seed=1)
    print("          mic 1     mic 2   touched  slides   force   sliding  settled   (simulated)")
    for _ in range(13):
        take, twin = advance(twin, BLOCK)
        levels = 20.0 * np.log10(take.microphones.std(axis=1) + 1e-9)
        told = take.labels
        speed = 1e3 * np.hypot(told.across[0].mean(), told.along[0].mean())
        print(
            f"{twin.start / twin.sample_rate:4.1f} s {levels[0]:6.1f} dB {levels[1]:6.1f} dB"
            f"   {told.contact[0].mean():5.0%}   {told.slip[0].mean():5.0%}  {told.force[0].mean():5.2f} N"
            f"  {speed:4.1f} mm/s   {told.settled.mean():5.0%}"
        )


if __name__ == "__main__":
    main()
