"""Touch a simulated string and locate the touch: from two spectral peaks, then window by window.

Run it: python examples/locate_a_touch.py
"""

import numpy as np

import monochord as mc
from monochord.perception.estimators import ESTIMATORS

WINDOW = 4410  # frames: 0.1 s


def main() -> None:
    """Print the true position, that from two spectral peaks, and the estimate of each window."""
    string = mc.load_string("appendix").string
    position = 0.35 * string.length
    sound = mc.simulate("appendix", position=position, force=0.5, seconds=0.6, route="modal")
    print(f"touched at {1e3 * position:.2f} mm")

    f1, f2 = sound.summary["peaks"]
    x = mc.locate_from_segments(string.length, f1, f2)
    print(f"peaks at {f1:.2f} and {f2:.2f} Hz: {1e3 * x:.2f} mm")

    signal = mc.Signal(sample_rate=sound.sample_rate, channels=2, string=string)
    estimate = ESTIMATORS.build("closed_form").prepare(signal, WINDOW)
    microphones = sound.microphones.astype(np.float32)
    for start in range(0, microphones.shape[1] - WINDOW + 1, WINDOW):
        samples = microphones[:, start : start + WINDOW]
        x = estimate(mc.Window(samples=samples, start=start, sample_rate=sound.sample_rate))["position"]
        print(f"{start / sound.sample_rate:.1f} s: {x}")


if __name__ == "__main__":
    main()
