"""The time per window of a frozen encoder, with each installed back end.

Makes what `docs/design/features.md` says of their cost, in some two minutes: ``python -m
studies.encoder_speed``.
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from studies._command import measure

from monochord.benchmarks import one_core
from monochord.benchmarks.base import Benchmark, Row
from monochord.core.errors import DeviceError, InputError, did_you_mean
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor

RATE = 44100
WARM_UP = 3
"""Warm-up windows before the timing."""
BASELINE = "log_mel"
VARIANTS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    BASELINE: ("log_mel", {}),
    "ast_torch": ("ast", {"random": True, "backend": "torch"}),
    "ast_onnx": ("ast", {"random": True, "backend": "onnx"}),
    "ast_int8": ("ast", {"random": True, "backend": "int8"}),
    "ast_openvino": ("ast", {"random": True, "backend": "openvino"}),
    "ast_cuda": ("ast", {"random": True, "backend": "cuda"}),
    "yamnet": ("yamnet", {}),
}
"""Features and their options. Random weights take as long as trained ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders(Benchmark):
    """Time from a window of two microphones to a feature's row, on one core.

    All variants process each window in turn, under the same machine load. The baseline is the log-mel
    spectrogram, pooled, without a network. The transformer has random weights, which take as long as learned
    ones. Variants that are not installed are left out.

    Parameters
    ----------
    windows
        Number of timed windows.
    window
        Length of a window in s.
    variants
        Any of log_mel, ast_torch, ast_onnx, ast_int8, ast_openvino, ast_cuda (a GPU) and yamnet, where its
        package is installed; all, if empty.
    """

    windows: int = 100
    window: Seconds = 0.1
    variants: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.windows < 1:
            raise InputError(f"{self.windows} windows", "1 or more")
        if not 0.03 <= self.window <= 1.0:
            raise InputError(f"window {self.window:g} s", "0.03 to 1 s")
        for name in self.variants:
            if name not in VARIANTS:
                raise InputError(f"variant '{name}'", ", ".join(VARIANTS), did_you_mean(name, VARIANTS))

    def run(self) -> Iterator[Row]:
        """Prepare every variant, time them, and yield the rows of each."""
        size = round(self.window * RATE)
        rng = np.random.default_rng(0)
        sounds = 0.1 * rng.standard_normal((WARM_UP + self.windows, 1, 2, size), np.float32)
        with one_core():
            ready: dict[str, Extractor] = {}
            for name in {BASELINE: None, **dict.fromkeys(self.variants or VARIANTS)}:
                start = time.perf_counter()
                try:
                    ready[name] = _extractor(name, size)
                except (InputError, DeviceError):
                    continue
                yield Row(name=f"{name}, to make ready", value=time.perf_counter() - start, unit="s")
            times: dict[str, list[Seconds]] = {name: [] for name in ready}
            for sound in sounds:
                for name, extract in ready.items():
                    times[name].append(_duration(extract, sound))
        base = np.median(times[BASELINE][WARM_UP:])
        for name, taken in times.items():
            timed = taken[WARM_UP:]
            for what, value in (("median", np.median(timed)), ("p99", np.percentile(timed, 99))):
                yield Row(
                    name=f"{name}, {what}",
                    value=float(value),
                    unit="s",
                    baseline=f"{BASELINE}, median",
                    baseline_value=float(base),
                )
            pace = float(np.mean(timed)) / self.window
            yield Row(
                name=f"{name}, wall/audio", value=pace, unit="1", baseline="real time", baseline_value=1.0
            )


def _extractor(name: str, size: Samples) -> Extractor:
    feature, options = VARIANTS[name]
    return FEATURES.build(feature, options).prepare(Signal(sample_rate=RATE, channels=2), size)


def _duration(extract: Extractor, sound: Audio) -> Seconds:
    start = time.perf_counter()
    extract(sound)
    return time.perf_counter() - start


if __name__ == "__main__":
    measure(Encoders)
