"""How long should the string be, and what limits it? Sensitivity and bounds of the error by length.

Run it: python examples/design_a_sensor.py
"""

from dataclasses import replace
from functools import partial

import numpy as np

import monochord as mc
from monochord.capture.sources.twin import ScriptedTouch, TwinSource
from monochord.physics.theory import frequency_sensitivities

SHARE, FORCE = 1 / 3, 1.0  # the touch: share of the length, and N
SNR = 10.0 ** (20 / 10)  # 20 dB, of each partial to white noise, in a window of 0.1 s
TENSION, ENDS, PITCH = 0.01, 1e-4, 7e-4  # known to 1 %, to 0.1 mm, and the untouched pitch to 0.07 %
LENGTHENING = 1e-4  # m, of each segment by contact and mount, not known: T / K of some 6e5 N/m


def main() -> None:
    """Print three bounds of the standard error for each length, and what the bundled model achieves."""
    print("Least standard errors of position and force, by two lines and the untouched pitch. Not known are:")
    print("length  by position  by force |  white noise alone   | tuning and ends too  | contact, mount too")
    for length in np.arange(0.1, 0.45, 0.1):
        string = replace(mc.load_string("prototype").string, length=float(length))
        touch = mc.Contact(position=SHARE * string.length, force=FORCE)
        by_position, by_force = frequency_sensitivities(string, touch, "geometric")[0]
        noise = partial(mc.contact_bound, string, touch, SNR, duration=0.1, sample_rate=44100.0)
        noise = partial(noise, highest=16000.0, law="geometric")
        built = partial(noise, tension_std=TENSION * string.tension, end_std=ENDS)
        built = partial(built, open_frequency_std=PITCH * mc.open_frequency(string))
        print(f"{1e3 * length:3.0f} mm {1e-3 * by_position:7.1f} Hz/mm {by_force:5.2f} Hz/N", end="")
        for bound in (noise, built, partial(built, lengthening_std=LENGTHENING)):
            x, force = bound()
            print(f" | {1e6 * x:6.2f} um {1e3 * force:6.2f} mN", end="")
        print()
    x, force = achieved()
    print(f"Simulated: the bundled model on 8 unseen builds of 200 mm: {x:.0f} um, {force:.0f} mN (rms)")


def achieved() -> tuple[float, float]:
    """Return the bundled model's errors in um and mN for the same touch of builds that it never learned."""
    place, errors = SHARE * 0.2, list[tuple[float, float]]()
    press = ScriptedTouch(start=0.8, position=place, force=FORCE)
    for build in range(321, 329):
        twin = TwinSource(world="plausible", build=build, seed=build, script=(press,), speed=0.0)
        for update in mc.listen(twin, "demo", seconds=1.6, hop=0.05):
            x, force = update.position, update.force
            if update.time > 1.2 and x.valid and force.valid:
                errors.append((1e6 * (x.value - place), 1e3 * (force.value - FORCE)))
    return tuple(np.sqrt(np.mean(np.square(errors), axis=0)).tolist())


if __name__ == "__main__":
    main()
