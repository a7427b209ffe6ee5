"""The virtual sensor: a whole string with compliant, sliding touches, feedback drivers and two microphones.

`begin` returns a twin at time zero, `advance` its next frames with labels and the twin after them. Everything
here is simulated.
"""

from monochord.physics.setup import (
    MAX_TOUCHES,
    ContactLaw,
    Ebow,
    End,
    Key,
    Mount,
    MountMode,
    Outside,
    Pickups,
    Pluck,
    Scene,
    Sensor,
    Touch,
    hold,
)
from monochord.physics.twin.stream import Labels, Take, Twin, advance, advance_many, begin, retouch, switch
from monochord.physics.twin.world import plausible_touch, sensor_of

__all__ = [
    "MAX_TOUCHES",
    "ContactLaw",
    "Ebow",
    "End",
    "Key",
    "Labels",
    "Mount",
    "MountMode",
    "Outside",
    "Pickups",
    "Pluck",
    "Scene",
    "Sensor",
    "Take",
    "Touch",
    "Twin",
    "advance",
    "advance_many",
    "begin",
    "hold",
    "plausible_touch",
    "retouch",
    "sensor_of",
    "switch",
]
