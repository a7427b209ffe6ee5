"""How long should the string be? Pitch, sensitivity and the lower bound of the error, for some lengths.

Run it: python examples/design_a_sensor.py
"""

from dataclasses import replace

import numpy as np

from monochord.core.types import Contact
from monochord.physics.strings import load_string
from monochord.physics.theory import (
    contact_bound,
    frequency_sensitivities,
    geometric_tension,
    segment_frequencies,
)

SNR = 10.0 ** (20 / 10)  # 20 dB, of each partial to the noise
WINDOW = 0.1  # s


def main() -> None:
    """Print one line per length, for a press of 1 N at a third of the prototype's string."""
    preset = load_string("prototype").string
    print("length  pitches         by position  by force  tension rise  Cramer-Rao bound of a 0.1 s window")
    for length in np.arange(0.1, 0.45, 0.1):
        string = replace(preset, length=float(length))
        touch = Contact(position=string.length / 3, force=1.0)
        f1, f2 = segment_frequencies(string, touch, "geometric")
        by_position, by_force = frequency_sensitivities(string, touch, "geometric")[0]
        rise = geometric_tension(string, touch.position, touch.force) - string.tension
        x_error, force_error = contact_bound(
            string, touch, SNR, duration=WINDOW, sample_rate=44100.0, highest=16000.0, law="geometric"
        )
        print(
            f"{1e3 * length:3.0f} mm  {f1:5.0f} {f2:5.0f} Hz  {1e-3 * by_position:6.1f} Hz/mm"
            f"  {by_force:5.2f} Hz/N  {rise:10.2f} N"
            f"  {1e6 * x_error:8.2f} um, {1e3 * force_error:.2f} mN"
        )


if __name__ == "__main__":
    main()
