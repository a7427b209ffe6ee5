"""The paper's simulator: a touched string as two independent, driven segments.

`simulate` runs a `SplitString` for a given time, by the paper's finite differences or by exact modes;
`begin`, `advance` and `touch` run the modes as a stream with changing touches.
"""

from monochord.physics.split_string.grid import time_step
from monochord.physics.split_string.rendering import Route, SimulatedSound, peaks, simulate
from monochord.physics.split_string.setup import Drive, PluckShape, SplitString
from monochord.physics.split_string.stream import Ringing, advance, begin, touch

__all__ = [
    "Drive",
    "PluckShape",
    "Ringing",
    "Route",
    "SimulatedSound",
    "SplitString",
    "advance",
    "begin",
    "peaks",
    "simulate",
    "time_step",
    "touch",
]
