"""The live loop: a source, windows, an estimator and sinks; the same offline and live.

`LiveSettings` is what a person configures, `LiveRun` what is built from it, `run` the loop and `Summary`
what it counted.
"""

from monochord.live.loop import run
from monochord.live.score import Scorer
from monochord.live.settings import LiveRun, LiveSettings, WindowSettings
from monochord.live.summary import Summary

__all__ = ["LiveRun", "LiveSettings", "Scorer", "Summary", "WindowSettings", "run"]
