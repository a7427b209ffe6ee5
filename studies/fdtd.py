"""The paper's finite differences: their speed, and their distance from the exact solution.

Makes what docs/reference/python.md says of the split string's routes, in some 30 seconds: ``python -m
studies.fdtd``.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from studies._command import measure

from monochord.benchmarks import one_core
from monochord.benchmarks.base import Benchmark, Row
from monochord.core.errors import InputError
from monochord.core.units import Seconds
from monochord.physics.split_string import (
    PluckShape,
    Route,
    SimulatedSound,
    SplitString,
    peaks,
    simulate,
    time_step,
)
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies

REFERENCE = "NumPy reference"
FDTD = "compiled FDTD"
MIN_SECONDS, MAX_SECONDS = 0.001, 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Fdtd(Benchmark):
    """Time over audio time of the three routes through the split string, on one core.

    The case is the paper's appendix: two segments of 256 nodes, 1 us. Compiled code has run once before the
    timing, so compilation does not count; everything else does: layout, feedback, resampling. The fastest of
    several repeats counts. Wall time includes other programs on the core; core time, the processor time of
    this thread, does not. On an idle machine both are equal.

    Parameters
    ----------
    preset
        The string, with its preset's touch.
    seconds
        Duration of the audio for the compiled and the modal route, in s.
    reference_seconds
        Duration of the audio for the NumPy reference, in s, which takes some thirty times real time.
    repeats
        Number of timings of each.
    """

    preset: str = "appendix"
    seconds: Seconds = 4.0
    reference_seconds: Seconds = 0.1
    repeats: int = 5

    def __post_init__(self) -> None:
        for name in ("seconds", "reference_seconds"):
            if not MIN_SECONDS <= getattr(self, name) <= MAX_SECONDS:
                raise InputError(f"{name} {getattr(self, name):g}", f"{MIN_SECONDS:g} to {MAX_SECONDS:g} s")
        if self.repeats < 1:
            raise InputError(f"{self.repeats} repeats", "1 or more")

    def run(self) -> Iterator[Row]:
        """Time the routes, then compare their results."""
        string = load_string(self.preset)
        contact = string.usual_contact
        setup = SplitString(string=string.string, contact=contact)
        with one_core():
            for compiles in ("fdtd", "modal"):
                simulate(setup, 0.05, route=compiles)
            reference = _pace(setup, "reference", self.reference_seconds, repeats=2)
            fdtd = _pace(setup, "fdtd", self.seconds, self.repeats)
            modal = _pace(setup, "modal", self.seconds, self.repeats)
        for kind, pick in (("wall", 0), ("core", 1)):
            yield _row(f"compiled FDTD, {kind}/audio", fdtd[pick], REFERENCE, reference[pick])
            yield _row(f"exact modes, {kind}/audio", modal[pick], FDTD, fdtd[pick])
            yield _row(f"NumPy reference, {kind}/audio", reference[pick], "real time", 1.0)
        yield from self._agreement(setup)
        yield from _distances(setup, segment_frequencies(string.string, contact))

    def _agreement(self, setup: SplitString) -> Iterator[Row]:
        slow, fast = (simulate(setup, self.reference_seconds, route=route) for route in ("reference", "fdtd"))
        yield _row("compiled against reference, relative", _difference(slow, fast), "rounding", 1e-11)


def _pace(setup: SplitString, route: Route, seconds: Seconds, repeats: int) -> tuple[float, float]:
    """Wall and core time relative to audio time, each for the fastest repeat."""
    times = [_timed(setup, route, seconds) for _ in range(repeats)]
    return min(wall for wall, _ in times) / seconds, min(core for _, core in times) / seconds


def _timed(setup: SplitString, route: Route, seconds: Seconds) -> tuple[Seconds, Seconds]:
    wall, core = time.perf_counter(), time.thread_time()
    simulate(setup, seconds, route=route)
    return time.perf_counter() - wall, time.thread_time() - core


def _distances(setup: SplitString, expected: tuple[float, float]) -> Iterator[Row]:
    """Distance of the peaks from theory, and of the grid from its limit under refinement."""
    exact = simulate(setup, 0.4, route="modal")
    paper = simulate(setup, 0.4)
    for name, recording in (("FDTD", paper), ("modes", exact)):
        off = np.abs(np.divide(peaks(recording), expected) - 1.0).max()
        yield _row(f"peaks of {name} off theory, relative", float(off), "bound", 1e-3)
    # A broad pluck: the partials of a narrow one are too high for either grid to be near its limit.
    broad = replace(setup, pluck=PluckShape(width=0.02))
    finer = replace(broad, nodes=2 * setup.nodes - 1, time_step=time_step(setup) / 2.0)
    limit = simulate(broad, 0.4, route="modal")
    coarse, fine = (_difference(limit, simulate(each, 0.4)) for each in (broad, finer))
    yield _row("FDTD off modes, relative", coarse, "bound", 0.05)
    yield _row("the same at half the steps", fine, "FDTD", coarse)


def _difference(reference: SimulatedSound, estimate: SimulatedSound) -> float:
    """RMS of the difference over RMS of the reference, both segments together."""
    apart = estimate.segments - reference.segments
    return float(np.sqrt((apart**2).mean() / (reference.segments**2).mean()))


def _row(name: str, value: float, baseline: str, baseline_value: float) -> Row:
    return Row(name=name, value=value, unit="1", baseline=baseline, baseline_value=baseline_value)


if __name__ == "__main__":
    measure(Fdtd)
