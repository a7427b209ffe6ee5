"""The live loop: a source, windows, an estimator and sinks; the same offline and live.

`LiveRun` is what is run, as a person configures it, `run` the loop and `Summary` what it counted.
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
