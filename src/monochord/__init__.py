"""Monochord: acoustic tactile sensing with a driven string.

Two electromagnetic drivers keep a steel string ringing, and two contact microphones record it. A touch splits
the string; its sound shows contact, position, normal force and slip.

What a program needs first stands here and is loaded when it is used, so that the import is quick::

    import monochord as mc

    for update in mc.listen("twin", model="demo", seconds=2.0):
        print(update.time, update.position, update.force, update.tracked.position)
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from monochord.core.types import Estimate
    from monochord.live.listen import listen, listen_async
    from monochord.live.sinks.base import Update
    from monochord.live.tuning import tune
    from monochord.perception.data import features, load_dataset
    from monochord.perception.learner import TouchEstimator
    from monochord.perception.model import load
    from monochord.physics.simulate import simulate
    from monochord.physics.twin.virtual_sensor import VirtualSensor
    from monochord.sessions import read_session

__version__ = version("monochord")

__all__ = [
    "Estimate",
    "TouchEstimator",
    "Update",
    "VirtualSensor",
    "__version__",
    "features",
    "listen",
    "listen_async",
    "load",
    "load_dataset",
    "read_session",
    "simulate",
    "tune",
]

_HOMES = {
    "Estimate": "monochord.core.types",
    "TouchEstimator": "monochord.perception.learner",
    "Update": "monochord.live.sinks.base",
    "VirtualSensor": "monochord.physics.twin.virtual_sensor",
    "features": "monochord.perception.data",
    "listen": "monochord.live.listen",
    "listen_async": "monochord.live.listen",
    "load": "monochord.perception.model",
    "load_dataset": "monochord.perception.data",
    "read_session": "monochord.sessions",
    "simulate": "monochord.physics.simulate",
    "tune": "monochord.live.tuning",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'monochord' has no attribute '{name}'")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
