"""Checksums of the world `ideal`: two revisions of the twin that print the same lines are equal to the bit.

``PYTHONPATH=src:. python -m tests.physics.twin.fingerprint`` prints one line a sensor. The lines of two
revisions can be compared on one machine alone: another processor may round differently.
"""

from hashlib import sha256

import numpy as np

from monochord.physics.twin.virtual_sensor import VirtualSensor

SENSORS = ("prototype", "prototype_one_driver", "gauge_012", "gauge_013", "long")


def fingerprint(sensor: str) -> str:
    """Return the checksum of a sensor's sound and labels: untouched, pressed, sliding, released, pressed."""
    twin = VirtualSensor(sensor, seed=3, build=5, day=2)
    length = twin.sensor.string.length
    taken = [twin.advance(0.3)]
    twin.press(0.37 * length, 1.0, material="plastic")
    taken.append(twin.advance(0.4))
    twin.slide(0.3, along=0.02, across=0.01)
    taken.append(twin.advance(0.4))
    twin.release()
    taken.append(twin.advance(0.3))
    twin.press(0.6 * length, 0.7, material="metal_tube")
    taken.append(twin.advance(0.3))
    digest = sha256()
    for sound, labels in taken:
        for values in (sound, *(labels[name] for name in sorted(labels))):
            digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()


if __name__ == "__main__":
    for sensor in SENSORS:
        print(sensor, fingerprint(sensor))  # noqa: T201
