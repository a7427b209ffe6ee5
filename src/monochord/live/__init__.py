"""The live loop from a source through windows and an estimator to sinks; the same offline and live.

`LiveRun` is the configuration of a run, `run` is the loop, and `Summary` holds its counts and timings.
"""

from monochord.live.filter import FilterSettings, FilterState, Tracked, step
from monochord.live.loop import LiveStream, run
from monochord.live.score import Scorer
from monochord.live.settings import MODEL, LiveRun, WindowSettings
from monochord.live.summary import Summary
from monochord.live.switches import SwitchSettings

__all__ = [
    "MODEL",
    "FilterSettings",
    "FilterState",
    "LiveRun",
    "LiveStream",
    "Scorer",
    "Summary",
    "SwitchSettings",
    "Tracked",
    "WindowSettings",
    "run",
    "step",
]
