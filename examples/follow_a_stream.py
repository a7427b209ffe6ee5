"""The live loop written out: blocks, windows, estimates and truth. `mc.listen` is this loop in one line.

Run it: python examples/follow_a_stream.py
"""

from monochord.capture.sources import SOURCES
from monochord.core.clock import SampleClock
from monochord.core.windows import windows
from monochord.perception.estimators import ESTIMATORS

SECONDS = 4.0
LENGTH, HOP = 0.1, 0.05  # s, of a window


def main() -> None:
    """Follow touches of a simulated string, faster than real time; print truth beside estimate."""
    source = SOURCES.build("split_string", {"preset": "appendix", "speed": 0.0, "duration": SECONDS})
    estimator = ESTIMATORS.build("closed_form")
    with source.open() as stream:
        rate = stream.signal.sample_rate
        clock = SampleClock(sample_rate=rate)
        size, hop = clock.index(LENGTH), clock.index(HOP)
        estimate = estimator.prepare(stream.signal, size)
        for window in windows(stream, size=size, hop=hop, sample_rate=rate):
            position = estimate(window)["position"]
            truth = stream.truth(window.start, window.start + size)
            touched = f"{1e3 * truth['position']:6.1f} mm" if "position" in truth else "nothing"
            settling = "" if truth.get("settled", 0.0) > 0.99 else "  (settling)"
            print(f"{clock.time(window.start):5.2f} s  truth: {touched:10}  estimate: {position}{settling}")


if __name__ == "__main__":
    main()
