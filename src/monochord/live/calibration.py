"""Calibrates an estimator with recordings of known touch position."""

import dataclasses
import math
import statistics
from collections.abc import Iterable
from pathlib import Path

from monochord.core.config import Tree, table
from monochord.core.errors import InputError
from monochord.core.lengths import refuse_other_units
from monochord.core.units import Metres
from monochord.live.loop import run
from monochord.live.settings import LiveRun, recording
from monochord.live.sinks.base import Listener, Update


def calibrated(tree: Tree, takes: Iterable[tuple[str | Path, Metres]]) -> Tree:
    """Return the tree of a run with the medians of takes (frequency, position, inharmonicity) as calibration.

    Each take is a recording with its position in m from the nut. Raises `InputError` for one that cannot be
    read, or has no window with a frequency.
    """
    rows: list[list[float]] = []
    for path, position in takes:
        refuse_other_units(position=position)
        take = LiveRun.read({**tree, "source": recording(path), "sinks": {}, "seconds": math.inf})
        try:
            median = medians(take)
        except InputError as error:
            if Path(path).name in error.given:
                raise
            raise InputError(f"{path}, {error.given}", error.expected, error.remedy) from error
        inharmonicity = [median["inharmonicity"]] if "inharmonicity" in median else []
        rows.append([median["frequency"], position, *inharmonicity])
    if not rows:
        return tree
    estimator = table(tree, "estimator")
    return {**tree, "estimator": {**estimator, "calibration": [*estimator.get("calibration", []), *rows]}}


def medians(take: LiveRun) -> dict[str, float]:
    """Return the median of each quantity over a take's windows with a frequency.

    The median suppresses a plucked take's onset and decay. Raises `InputError` where no window has a
    frequency, and `KeyboardInterrupt` for a take that is interrupted: an incomplete take is not used.
    """
    estimates = _Estimates()
    if run(dataclasses.replace(take, sinks=(estimates,))).interrupted:
        raise KeyboardInterrupt
    if not estimates.values:
        why = f"no window has a frequency ({estimates.reason or 'shorter than a window'})"
        raise InputError(f"calibration take: {why}", "a take with a clear note", "record it again")
    return {name: statistics.median(values) for name, values in estimates.values.items()}


class _Estimates(Listener):
    def __init__(self) -> None:
        self.values: dict[str, list[float]] = {}
        self.reason = ""

    def write(self, update: Update) -> None:
        frequency = update.prediction.estimate("frequency")
        if not frequency.valid:
            self.reason = frequency.reason
            return
        for name, estimate in update.prediction.estimates.items():
            if estimate.valid:
                self.values.setdefault(name, []).append(estimate.value)
