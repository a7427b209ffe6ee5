"""The state of a model on one stream of windows, passed in and out."""

from typing import NamedTuple

from monochord.core.units import Samples
from monochord.perception.reader.memory import Memory


class ModelState(NamedTuple):
    """The state of a model after a window; initially ``ModelState()``.

    `start` is the first frame of the last window. `memory` is the memory of a feature that has one; None
    before the first window.
    """

    start: Samples = -1
    memory: Memory | None = None
