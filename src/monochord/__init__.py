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
    from monochord.core.errors import DeviceError, InputError
    from monochord.core.types import Estimate
    from monochord.front.audit import audit
    from monochord.front.build import build
    from monochord.front.calibrate import calibrate
    from monochord.front.collect import collect
    from monochord.front.evaluate import evaluate
    from monochord.front.record import record
    from monochord.front.train import train
    from monochord.live.listen import listen, listen_async
    from monochord.live.sinks.base import Update
    from monochord.live.tuning import tune
    from monochord.perception.data import features, load_dataset
    from monochord.perception.model import PredictionTable, load
    from monochord.physics.simulate import simulate
    from monochord.physics.twin.virtual_sensor import VirtualSensor
    from monochord.sessions import read_session

__version__ = version("monochord")

__all__ = [
    "DeviceError",
    "Estimate",
    "InputError",
    "PredictionTable",
    "Update",
    "VirtualSensor",
    "__version__",
    "audit",
    "build",
    "calibrate",
    "collect",
    "evaluate",
    "features",
    "listen",
    "listen_async",
    "load",
    "load_dataset",
    "read_session",
    "record",
    "simulate",
    "train",
    "tune",
]

_HOMES = {
    "DeviceError": "monochord.core.errors",
    "Estimate": "monochord.core.types",
    "InputError": "monochord.core.errors",
    "PredictionTable": "monochord.perception.model",
    "Update": "monochord.live.sinks.base",
    "VirtualSensor": "monochord.physics.twin.virtual_sensor",
    "audit": "monochord.front.audit",
    "build": "monochord.front.build",
    "calibrate": "monochord.front.calibrate",
    "collect": "monochord.front.collect",
    "evaluate": "monochord.front.evaluate",
    "features": "monochord.perception.data",
    "listen": "monochord.live.listen",
    "listen_async": "monochord.live.listen",
    "load": "monochord.perception.model",
    "load_dataset": "monochord.perception.data",
    "read_session": "monochord.sessions",
    "record": "monochord.front.record",
    "simulate": "monochord.physics.simulate",
    "train": "monochord.front.train",
    "tune": "monochord.live.tuning",
}


_GONE = {
    "TouchEstimator": "a pipeline of scikit-learn on mc.features, as in examples/study_a_feature.py",
}


def __getattr__(name: str) -> Any:
    if name in _GONE:
        raise ImportError(f"monochord.{name}: use {_GONE[name]}", name="monochord")
    if name not in _HOMES:
        raise AttributeError(f"module 'monochord' has no attribute '{name}'")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
