"""Monochord: acoustic tactile sensing with a driven string.

Two electromagnetic drivers keep a steel string ringing, and two contact microphones record it. A touch splits
the string; its sound shows contact, position, normal force and slip.

What a program needs first stands here and is loaded when it is used, so that the import is quick::

    import monochord as mc

    for update in mc.listen("twin", model="demo", seconds=2.0):
        print(update.time, update.position, update.force, update.tracked.position)

Estimates from a source
    `listen`, `listen_async`, `locate`, `Update`, `Prediction`, `Estimate`
Models
    `load`, `train`, `evaluate`, `calibrate`, `tune`, `identify`, `features`, `Model`, `PredictionTable`,
    `publish`
Recordings and datasets
    `record`, `collect`, `build`, `audit`, `read_session`, `load_dataset`, `split_dataset`, `windows`,
    `Augmentation`, `SessionReader`, `SessionWriter`, `Description`
A hand of strings
    `load_skin`, `Skin`, `SkinString`
Simulation and presets
    `design`, `simulate`, `VirtualSensor`, `VirtualSensors`, `load_sensor`, `load_string`, `load_material`,
    `available`
Types
    `StringParams`, `Contact`, `Signal`, `Block`, `Window`, `Readings`, `Feed`
Closed forms
    `open_frequency`, `segment_frequencies`, `locate_from_segments`, `tension_from_segments`,
    `force_from_tension`, `stiff_partials`, `contact_bound`
Scores
    `mean_absolute_error`, `regression_score`, `detection_score`
Base classes of plug-ins
    `Source`, `Stream`, `Instrument`, `Connection`, `Feature`, `Extractor`, `Head`, `Task`, `Estimator`,
    `Sink`, `Writer`, `Run`, `Figure`
Errors
    `MonochordError`, `InputError`, `DeviceError`, `MissingLibraryError`
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from monochord.capture.instruments.base import Connection, Instrument
    from monochord.capture.sources.base import Source, Stream
    from monochord.core.errors import DeviceError, InputError, MissingLibraryError, MonochordError
    from monochord.core.types import (
        Block,
        Contact,
        Estimate,
        Feed,
        Prediction,
        Readings,
        Signal,
        StringParams,
        Window,
    )
    from monochord.core.windows import windows
    from monochord.datasets.augment import Augmentation
    from monochord.datasets.split import split_dataset
    from monochord.figures.base import Figure
    from monochord.front.audit import audit
    from monochord.front.available import available
    from monochord.front.build import build
    from monochord.front.calibrate import calibrate
    from monochord.front.collect import collect
    from monochord.front.design import design
    from monochord.front.evaluate import evaluate
    from monochord.front.identify import identify
    from monochord.front.locate import locate
    from monochord.front.publish import publish
    from monochord.front.record import record
    from monochord.front.train import train
    from monochord.live.listen import listen, listen_async
    from monochord.live.sinks.base import Run, Sink, Writer
    from monochord.live.tuning import tune
    from monochord.live.update import Update
    from monochord.metrics import detection_score, mean_absolute_error, regression_score
    from monochord.perception.data import features, load_dataset
    from monochord.perception.estimators.base import Estimator
    from monochord.perception.features.base import Extractor, Feature
    from monochord.perception.heads.base import Head, Task
    from monochord.perception.model import Model, PredictionTable, load
    from monochord.physics.materials import load_material
    from monochord.physics.sensors import load_sensor
    from monochord.physics.simulate import simulate
    from monochord.physics.strings import load_string
    from monochord.physics.theory import (
        contact_bound,
        force_from_tension,
        locate_from_segments,
        open_frequency,
        segment_frequencies,
        stiff_partials,
        tension_from_segments,
    )
    from monochord.physics.twin.virtual_sensor import VirtualSensor
    from monochord.physics.twin.virtual_sensors import VirtualSensors
    from monochord.sessions import Description, SessionReader, SessionWriter, read_session
    from monochord.skin import Skin, SkinString, load_skin

__version__ = version("monochord")

__all__ = [
    "Augmentation",
    "Block",
    "Connection",
    "Contact",
    "Description",
    "DeviceError",
    "Estimate",
    "Estimator",
    "Extractor",
    "Feature",
    "Feed",
    "Figure",
    "Head",
    "InputError",
    "Instrument",
    "MissingLibraryError",
    "Model",
    "MonochordError",
    "Prediction",
    "PredictionTable",
    "Readings",
    "Run",
    "SessionReader",
    "SessionWriter",
    "Signal",
    "Sink",
    "Skin",
    "SkinString",
    "Source",
    "Stream",
    "StringParams",
    "Task",
    "Update",
    "VirtualSensor",
    "VirtualSensors",
    "Window",
    "Writer",
    "__version__",
    "audit",
    "available",
    "build",
    "calibrate",
    "collect",
    "contact_bound",
    "design",
    "detection_score",
    "evaluate",
    "features",
    "force_from_tension",
    "identify",
    "listen",
    "listen_async",
    "load",
    "load_dataset",
    "load_material",
    "load_sensor",
    "load_skin",
    "load_string",
    "locate",
    "locate_from_segments",
    "mean_absolute_error",
    "open_frequency",
    "publish",
    "read_session",
    "record",
    "regression_score",
    "segment_frequencies",
    "simulate",
    "split_dataset",
    "stiff_partials",
    "tension_from_segments",
    "train",
    "tune",
    "windows",
]

_NAMES = {
    "monochord.capture.instruments.base": "Connection Instrument",
    "monochord.capture.sources.base": "Source Stream",
    "monochord.core.errors": "DeviceError InputError MissingLibraryError MonochordError",
    "monochord.core.types": "Block Contact Estimate Feed Prediction Readings Signal StringParams Window",
    "monochord.core.windows": "windows",
    "monochord.datasets.augment": "Augmentation",
    "monochord.datasets.split": "split_dataset",
    "monochord.figures.base": "Figure",
    "monochord.front.audit": "audit",
    "monochord.front.available": "available",
    "monochord.front.build": "build",
    "monochord.front.calibrate": "calibrate",
    "monochord.front.collect": "collect",
    "monochord.front.design": "design",
    "monochord.front.evaluate": "evaluate",
    "monochord.front.identify": "identify",
    "monochord.front.locate": "locate",
    "monochord.front.publish": "publish",
    "monochord.front.record": "record",
    "monochord.front.train": "train",
    "monochord.live.listen": "listen listen_async",
    "monochord.live.sinks.base": "Run Sink Writer",
    "monochord.live.tuning": "tune",
    "monochord.live.update": "Update",
    "monochord.metrics": "detection_score mean_absolute_error regression_score",
    "monochord.perception.data": "features load_dataset",
    "monochord.perception.estimators.base": "Estimator",
    "monochord.perception.features.base": "Extractor Feature",
    "monochord.perception.heads.base": "Head Task",
    "monochord.perception.model": "Model PredictionTable load",
    "monochord.physics.materials": "load_material",
    "monochord.physics.sensors": "load_sensor",
    "monochord.physics.simulate": "simulate",
    "monochord.physics.strings": "load_string",
    "monochord.physics.theory": (
        "contact_bound force_from_tension locate_from_segments open_frequency segment_frequencies"
        " stiff_partials tension_from_segments"
    ),
    "monochord.physics.twin.virtual_sensor": "VirtualSensor",
    "monochord.physics.twin.virtual_sensors": "VirtualSensors",
    "monochord.sessions": "Description SessionReader SessionWriter read_session",
    "monochord.skin": "Skin SkinString load_skin",
}
"""The names that each module gives to the front door."""
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}


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
