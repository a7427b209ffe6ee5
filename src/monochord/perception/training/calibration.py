"""Adapting a model to one sensor with sessions of known touches, as ``monochord calibrate`` does."""

import dataclasses
import logging
import shlex
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.identity import SensorIdentity, calibrated_elsewhere
from monochord.core.types import Progress
from monochord.core.units import Metres
from monochord.datasets.build import BuildOptions, Labelling, build_dataset, find_sessions
from monochord.datasets.store import Dataset
from monochord.perception.model import Model, load
from monochord.perception.training.adapt import Objects, adapt, judge
from monochord.perception.training.adaptation import Adaptation
from monochord.perception.training.examples import touches_of
from monochord.perception.training.touch_labels import refuse_impossible
from monochord.perception.tuning.sessions import retuned_strings, tension_estimator
from monochord.sessions import read_session

_log = logging.getLogger("monochord")
TOLERANCE: Metres = 1e-6
"""Tolerance at the ends of the sensing range, because labels are rounded to 32 bits."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class SensorRange:
    """The sensing range of a sensor in a session's description, in m."""

    range: tuple[Metres, Metres]


def calibrated(
    model: str | Model,
    sessions: Iterable[str],
    out: Path | None,
    *,
    touches: int | None = None,
    objects: Objects = "same",
    labels: Labelling = "",
    force: bool = False,
    sensing_range: tuple[Metres, Metres] | None = None,
    progress: Progress = lambda *_: None,
) -> Adaptation:
    """Adapt a model to a sensor and an object with sessions of known touches, and save it; see `adapt`.

    Outside the sensing range, the labels of position and force are left out, because the sensor cannot
    estimate them there. By default it is the range of the sensor that the sessions name, where it overlaps
    the model's.

    With 0 `touches` the model does not change, and all touches measure its error. `labels` is as in
    `BuildOptions`; `force` accepts sessions whose streams are not on one clock. Without `out` nothing is
    saved.

    Raises
    ------
    InputError
        If the folder exists, all touches are outside the sensing range, or the model or a session cannot be
        used; see `adapt`.
    """
    given = model if isinstance(model, Model) else load(model)
    if touches == 0 and objects == "others":
        raise InputError(
            "--objects others with --touches 0", "touches to learn from", "leave out one of the two"
        )
    if out is not None and out.exists():
        raise InputError(f"folder {out} (exists)", "a new folder", "choose another name with --out")
    trained = given.definition
    rate = trained.sample_rate
    options = BuildOptions(
        window=trained.window / rate, hop=trained.hop / rate, labels=labels, force=force, sample_rate=rate
    )
    files = find_sessions(sessions)
    _refuse_lower_rates(files, rate)
    sensors = {read_session(file).description.identity: None for file in files}
    for each in sensors:
        if said := calibrated_elsewhere(trained.calibrated_on, each):
            _log.warning("monochord: %s", said)
    with tempfile.TemporaryDirectory() as folder:
        dataset = build_dataset(
            files,
            Path(folder) / "dataset",
            options,
            listen=tension_estimator(trained.string),
        )
        dataset = _as_live(dataset)
        touch = touches_of(dataset)
        refuse_impossible(given, dataset, touch, np.unique(touch))  # before any is left out
        span = sensing_range or _range_of(files)
        strings = retuned_strings(dataset, trained.string).values() if trained.string else ()
        on_sensor = next((given.tuned(string) for string in strings), given)
        on_sensor = on_sensor.within(span) if span else on_sensor
        scale = on_sensor.prepared.length_scale
        span = on_sensor.places and (on_sensor.places[0] * scale, on_sensor.places[1] * scale)
        dataset, outside = _within(dataset, span)
        if touches == 0:
            result = judge(given, dataset, sensing_range=span, progress=progress)
        else:
            result = adapt(
                given, dataset, touches=touches, objects=objects, sensing_range=span, progress=progress
            )
    result = dataclasses.replace(result, sensing_range=span, outside=outside)
    if touches != 0:
        on = next(iter(sensors)) if len(sensors) == 1 and SensorIdentity() not in sensors else None
        definition = dataclasses.replace(result.model.definition, calibrated_on=on)
        result = dataclasses.replace(result, model=dataclasses.replace(result.model, definition=definition))
    return result if out is None else dataclasses.replace(result, model=result.model.save(out))


def _as_live(dataset: Dataset) -> Dataset:
    """Return a dataset whose strings have the lengths that a live run of their sensors knows."""
    parts = tuple(
        part if part.measured_length == part.length else dataclasses.replace(part, measured_length=None)
        for part in dataset.manifest.parts
    )
    return dataclasses.replace(dataset, manifest=dataclasses.replace(dataset.manifest, parts=parts))


def _refuse_lower_rates(sessions: Sequence[Path], sample_rate: int) -> None:
    """Raise `InputError` for a session of a lower rate than the model's; the message has the remedy."""
    for path in sessions:
        if (rate := read_session(path).description.sample_rate) < sample_rate:
            out = path.with_name(f"{path.stem}_{sample_rate}.mcap")
            words = shlex.join([str(path), "--rate", str(sample_rate), "--out", str(out)])
            allowed = f"{sample_rate} Hz or more, as the model was trained"
            remedy = f"resample it: monochord sessions resample {words}"
            raise InputError(f"session {path} at {rate} Hz", allowed, remedy)


def _range_of(sessions: Sequence[Path]) -> tuple[Metres, Metres] | None:
    """Return the overlap of the ranges of all sensors that sessions name; None if they name none."""
    named = [read_session(path).description.sensor.get("range") for path in sessions]
    ranges = [from_tree(SensorRange, {"range": each}, "session.sensor").range for each in named if each]
    return (max(low for low, _ in ranges), min(high for _, high in ranges)) if ranges else None


def _within(dataset: Dataset, span: tuple[Metres, Metres] | None) -> tuple[Dataset, tuple[Metres, ...]]:
    """Return a dataset without labels outside a range, and the positions of the touches that lose them.

    Raises `InputError` if no touch is left.
    """
    if span is None or "position" not in dataset.labels:
        return dataset, ()
    place, touch = dataset.label("position"), touches_of(dataset)
    outside = (place < span[0] - TOLERANCE) | (place > span[1] + TOLERANCE)
    outside &= dataset.label("contact") == 1.0
    if not outside.any():
        return dataset, ()
    places = tuple(float(place[outside & (touch == each)].mean()) for each in np.unique(touch[outside]))
    labels, valid = dict(dataset.labels), dict(dataset.valid)
    for name in labels.keys() & {"position", "force"}:
        labels[name] = np.where(outside, np.nan, labels[name])
        valid[name] = valid[name] & ~outside
    if not any(valid[name].any() for name in labels.keys() & {"position", "force"}):
        low, high = (f"{1e3 * end:g}" for end in span)
        given = f"{len(places)} known touches, all outside the sensing range"
        raise InputError(given, f"touches between {low} and {high} mm", "record touches in this range")
    return dataclasses.replace(dataset, labels=labels, valid=valid), places
