"""Touch a simulated string, listen to it, and find the touch: by physics alone, then as the live loop does.

Run it: python examples/locate_a_touch.py
"""

import numpy as np

from monochord.core.types import Contact, Signal, Window
from monochord.perception.estimators import ESTIMATORS
from monochord.physics.split_string import SplitString, peaks, simulate
from monochord.physics.strings import load_string
from monochord.physics.theory import locate_from_segments

WINDOW = 4410  # frames: 0.1 s


def main() -> None:
    """Print the true position, what two spectral peaks tell, and what the estimator says of each window."""
    string = load_string("appendix").string
    touch = Contact(position=0.35 * string.length, force=0.5)
    sound = simulate(SplitString(string=string, contact=touch), 0.6, route="modal")
    print(f"touched at {1e3 * touch.position:.2f} mm")

    f1, f2 = peaks(sound)
    x = locate_from_segments(string.length, f1, f2)
    print(f"peaks at {f1:.2f} and {f2:.2f} Hz: {1e3 * x:.2f} mm")

    signal = Signal(sample_rate=sound.sample_rate, channels=2, string=string)
    estimate = ESTIMATORS.build("closed_form").prepare(signal, WINDOW)
    microphones = sound.microphones.astype(np.float32)
    for start in range(0, microphones.shape[1] - WINDOW + 1, WINDOW):
        samples = microphones[:, start : start + WINDOW]
        window = Window(samples=samples, start=start, sample_rate=sound.sample_rate)
        position = estimate(window)["position"]
        answer = f"{1e3 * position.value:.2f} +- {1e3 * position.std:.2f} mm"
        print(f"{start / sound.sample_rate:.1f} s: {answer if position.valid else position.why_not}")


if __name__ == "__main__":
    main()
