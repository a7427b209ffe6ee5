"""The virtual sensor: a whole string with compliant, sliding touches, feedback drivers and two microphones.

`begin` gives a twin at time zero, `advance` a stretch of its sound with labels and the twin after it.
Everything here is simulated.
"""

from monochord.physics.twin.setup import (
    MOST_TOUCHES,
    Ebow,
    Key,
    Outside,
    Pickups,
    Pluck,
    Scene,
    Sensor,
    Touch,
    hold,
)
from monochord.physics.twin.stream import Labels, Take, Twin, advance, begin, retouch, switch

__all__ = [
    "MOST_TOUCHES",
    "Ebow",
    "Key",
    "Labels",
    "Outside",
    "Pickups",
    "Pluck",
    "Scene",
    "Sensor",
    "Take",
    "Touch",
    "Twin",
    "advance",
    "begin",
    "hold",
    "retouch",
    "switch",
]
