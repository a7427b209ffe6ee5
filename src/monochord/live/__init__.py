"""The live loop: a source, windows, an estimator and sinks; the same offline and live.

`Settings` is what a person configures, `Session` what is built from it, `run` the loop and `Summary`
what it counted.
"""

from monochord.live.loop import run
from monochord.live.score import Score
from monochord.live.settings import Session, Settings, WindowSettings
from monochord.live.summary import Summary

__all__ = ["Score", "Session", "Settings", "Summary", "WindowSettings", "run"]
