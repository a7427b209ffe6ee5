"""Computing time per window of the features of the string's partials, singly and in a batch.

Makes what `docs/design/features.md` says of their cost, in some 30 seconds: ``python -m
studies.feature_speed``.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from studies._command import measure

from monochord.benchmarks import one_core
from monochord.benchmarks.base import Benchmark, Row
from monochord.capture.sources import SOURCES
from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Seconds
from monochord.core.windows import windows
from monochord.perception.features import FEATURES
from monochord.physics.sensors import load_sensor

WARM_UP = 20
"""Warm-up windows before the timing."""
HOP: Seconds = 0.01
"""Assumed hop of a stream of windows, in s, for the real-time comparison."""
BASELINE = "plain transform"


@dataclass(frozen=True, slots=True, kw_only=True)
class FeaturesBenchmark(Benchmark):
    """Time from a window of two microphones to a feature's row, on one core, and rows a second in a batch.

    The sound is the twin's, touched and untouched. Every feature processes every window in turn, with its own
    analysis, which features of one model would share. The baseline is the Fourier transform of the same
    window, the first step of all features; for batches it is real time, a window every 10 ms.

    Parameters
    ----------
    names
        Names of the features.
    count
        Number of timed windows.
    window
        Length of a window in s.
    """

    names: tuple[str, ...] = ("fft_harmonic", "reading", "log_mel")
    count: int = 1000
    window: Seconds = 0.1

    def __post_init__(self) -> None:
        if self.count < 1:
            raise InputError(f"{self.count} windows", "1 or more")
        if not 0.02 <= self.window <= 1.0:
            raise InputError(f"window {self.window:g} s", "0.02 to 1 s")

    def run(self) -> Iterator[Row]:
        """Prepare every feature, time them, and yield the rows of each."""
        sounds, rate = self._sounds()
        own = Signal(sample_rate=rate, channels=2, string=load_sensor("prototype").string)
        made: dict[str, Callable[[Audio], Audio]] = {
            name: FEATURES.build(name).prepare(own, sounds.shape[2]) for name in self.names
        }
        with one_core():
            alone: dict[str, list[Seconds]] = {name: [] for name in (BASELINE, *made)}
            for k in range(len(sounds)):
                alone[BASELINE].append(_duration(np.fft.rfft, sounds[k]))
                for behind, (name, extract) in enumerate(made.items()):
                    # A window that was just analysed for another feature would cost next to nothing; a
                    # quieter one is another.
                    own_sound = sounds[k : k + 1] * np.float32(0.999**behind)
                    alone[name].append(_duration(extract, own_sound))
            batch = {name: _duration(extract, sounds[WARM_UP:]) for name, extract in made.items()}
        base = float(np.median(alone[BASELINE][WARM_UP:]))
        for name in made:
            timed: Floats = np.array(alone[name][WARM_UP:])
            for what, share in (("p50", 0.50), ("p95", 0.95), ("p99", 0.99)):
                yield Row(
                    name=f"{name}, {what}",
                    value=float(np.quantile(timed, share)),
                    unit="s",
                    baseline=f"{BASELINE}, p50",
                    baseline_value=base,
                )
            yield Row(
                name=f"{name}, rows in a batch",
                value=self.count / batch[name],
                unit="1/s",
                baseline="real time, a window every 10 ms",
                baseline_value=1.0 / HOP,
            )

    def _sounds(self) -> tuple[Audio, int]:
        with SOURCES.build("twin", {"speed": 0.0, "seed": 1}).open() as stream:
            rate = stream.signal.sample_rate
            size, hop = round(self.window * rate), round(2.0 * HOP * rate)
            stream_windows = windows(stream, size=size, hop=hop, sample_rate=rate)
            return np.stack([window.samples for window in islice(stream_windows, WARM_UP + self.count)]), rate


def _duration(work: Callable[[Audio], object], sound: Audio) -> Seconds:
    start = time.perf_counter()
    work(sound)
    return time.perf_counter() - start


if __name__ == "__main__":
    measure(FeaturesBenchmark)
