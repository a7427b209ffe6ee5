"""The live loop: from a source through windows and an estimator to sinks; the same offline and live.

`run` carries out a `LiveRun`, the configuration of a run, and `monochord.live.listen` iterates the same loop.
Each window gives an `Update` (`update`): the prediction, what the folds over time make of it, and the
stream's counters. Estimates equal those of an evaluation bit for bit, whoever takes the updates.

- `settings`, `saved_settings`: the configuration of a run, and its file.
- `loop`, `summary`: the loop, and what it counts and times.
- `filter`, `switches`: decisions on contact and slip, and estimates tracked over time.
- `events`, `health`: changes of contact and slip, and notes on the sensor's health.
- `delivery`, `sinks`: each sink in a thread of its own, and the sinks, which are plug-ins.
- `listen`, `score`, `touches`: updates in a program; errors where the truth is known; touches of a recording.
- `tuning`, `calibration`: a sensor from its untouched string; calibration from plucked takes.
- `touch_guide`, `labelled`, `recording`: guided touches of known position and force, and their session.
- `web`, `guides`: the page of a run, and the recordings and guided steps that it starts.

Conventions: positions in m from the first pickup (or the nut), forces in N, times in s since the stream
began, windows at exact sample indices. The folds are functions of the state before and the window, and return
the state after it. What comes late is skipped and counted; what is lost is a gap, and nothing is invented.
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
