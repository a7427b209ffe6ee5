"""A model's time per window: feature and four heads.

Prints its table in some ten seconds on one core: ``python -m studies.model_speed --set path=demo``.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from studies._command import measure

from monochord.benchmarks import one_core
from monochord.benchmarks.base import Benchmark, Row
from monochord.capture.sources import SOURCES
from monochord.core.config import to_tree
from monochord.core.ranges import Count
from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Seconds
from monochord.core.windows import windows
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.features import FEATURES
from monochord.perception.heads import HEADS
from monochord.perception.model import (
    Definition,
    FeatureRecord,
    HeadRecord,
    Model,
    ModelState,
    load,
    probed,
)
from monochord.physics.sensors import load_sensor

WARM_UP = 20
"""Warm-up windows before the timing."""
HOP: Seconds = 0.02
BASELINE = "closed form"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSpeed(Benchmark):
    """Time from a window to contact, slip, position and force on one core, beside the closed form's.

    Both process every window of the twin's sound, touched and untouched, in turn. Without a `path` the
    weights are random, which take as long as trained ones. The clock time includes other work on the machine;
    the processor time of these windows alone is given too.

    Parameters
    ----------
    path
        Folder of a model or of a training run, or the name of a bundled one.
    feature
        Name of the random model's feature.
    count
        Number of timed windows.
    """

    path: str = ""
    feature: str = "reading"
    count: Count = 1000

    def run(self) -> Iterator[Row]:
        """Prepare both, time them window by window, and yield median, p99 and maximum, for both times."""
        definition = load(self.path).definition if self.path else None
        length = definition.window / definition.sample_rate if definition else 0.1
        with SOURCES.build("twin", {"speed": 0.0, "seed": 1}).open() as stream, one_core():
            signal = stream.signal
            size = round(length * signal.sample_rate)
            estimators: dict[str, Prepared] = {
                BASELINE: ESTIMATORS.build("closed_form").prepare(signal, size),
                "model": _estimate(self._model(signal, size), signal, size),
            }
            times: dict[str, list[tuple[Seconds, Seconds]]] = {name: [] for name in estimators}
            hop = round(HOP * signal.sample_rate)
            stream_windows = windows(stream, size=size, hop=hop, sample_rate=signal.sample_rate)
            for window in islice(stream_windows, WARM_UP + self.count):
                for name, estimate in estimators.items():
                    times[name].append(_duration(estimate, window))
        for clock, kind in enumerate(("", " of processor time")):
            taken, baseline = (np.array(times[name][WARM_UP:])[:, clock] for name in ("model", BASELINE))
            for what, share in (("median", 0.5), ("p99", 0.99), ("largest", 1.0)):
                yield Row(
                    name=f"model, {what}{kind}",
                    value=float(np.quantile(taken, share)),
                    unit="s",
                    baseline=f"{BASELINE}, {what}{kind}",
                    baseline_value=float(np.quantile(baseline, share)),
                )

    def _model(self, signal: Signal, size: int) -> Model:
        return load(self.path) if self.path else drawn(self.feature, signal, size)


def _estimate(model: Model, signal: Signal, size: int) -> Prepared:
    """Return the function from a window to a model's estimates, with its stream state."""
    model.check(signal, size)
    state = ModelState()

    def estimate(window: Window) -> Estimates:
        nonlocal state
        state, estimates = model.step(state, window)
        return estimates

    return estimate


def drawn(name: str, signal: Signal, size: int) -> Model:
    """Return a model of the usual heads with random weights; its estimates are meaningless."""
    own = Signal(sample_rate=signal.sample_rate, channels=2, string=load_sensor("prototype").string)
    feature = FEATURES.build(name)
    extractor = feature.prepare(own, size)
    definition = Definition(
        title="weights drawn at random",
        sample_rate=own.sample_rate,
        channels=2,
        window=size,
        hop=size,
        feature=FeatureRecord(name=name, options=to_tree(feature), columns=extractor.columns),
        heads={name: HeadRecord(task=HEADS.build(name).task()) for name in HEADS.names()},
        string=own.string,
        simulated=True,
    )
    rng = np.random.default_rng(0)
    weights = {
        name: 0.1 * rng.standard_normal(shape, np.float32) for name, shape in definition.shapes().items()
    }
    weights["scaler.scale"][:] = 1.0
    weights["scaler.probe"] = probed(extractor, 2, size)
    return Model(definition=definition, weights=weights)


def _duration(estimate: Prepared, window: Window) -> tuple[Seconds, Seconds]:
    """Return the clock time and the processor time."""
    start, busy = time.perf_counter(), time.process_time()
    estimate(window)
    taken = time.process_time() - busy
    return time.perf_counter() - start, taken


if __name__ == "__main__":
    measure(ModelSpeed)
