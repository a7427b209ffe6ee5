"""Updates from a source as they arrive: the live loop as an iterator, for Python programs."""

import asyncio
import math
from collections.abc import AsyncIterator, Generator, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from msgspec import Meta
from numpy.typing import NDArray

from monochord.capture.sources import SOURCES
from monochord.capture.sources._array import ArraySource
from monochord.capture.sources._virtual_sensor import VirtualSensorSource, VirtualSensorsSource
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.core.ranges import Positive, checked
from monochord.core.units import Hertz, Seconds
from monochord.live.loop import opened
from monochord.live.settings import (
    MODEL,
    ONE_STRING,
    Hop,
    LiveRun,
    StringSettings,
    WindowLength,
    WindowSettings,
    recording_source,
)
from monochord.live.update import Update
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators._loaded import LoadedModel
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import Model
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.virtual_sensors import VirtualSensors

Listenable: TypeAlias = str | Path | Source | VirtualSensor | VirtualSensors | NDArray[Any]
"""Inputs of `listen`: a source's name, a recording, a source object, virtual sensors, or sound."""
Answering: TypeAlias = str | Path | Model | Estimator
"""What answers in `listen`: a model, its name or folder, or another estimator or its name."""


def listen(
    source: Listenable = "jack",
    model: Answering = "demo",
    *,
    seconds: Seconds = math.inf,
    hop: Seconds = 0.01,
    window: Seconds | None = None,
    string: str | Path = "",
    sensor: str | Path = "",
    **options: Any,
) -> Iterator[Update]:
    """Yield an update for every window of a source, as soon as the window is complete.

    This is the loop of ``monochord live``: a file or session gives the same numbers as live sound. A reader
    that is a hop or more behind a real-time source skips to the newest window.

    Parameters
    ----------
    source
        One of these: a recording (``take.wav``, ``take.mp3``, ``take.mcap``); the name of a source
        (``"jack"``, ``"soundcard"``, ``"twin"``), or a source object; an array (channels, samples) or
        (samples,) of floats in full scale, with ``sample_rate=`` in Hz; a `VirtualSensor`, whose time
        advances by a hop per update, so that the program can touch it in between.
    model
        A bundled model's name, the folder of a model or of a training run, what `load` returned, the name of
        another estimator (``"closed_form"``), or an estimator object.
    seconds
        How much of the stream to process, in s; without end by default.
    hop
        Distance of window starts, in s.
    window
        Length of a window in s; the model's own by default, 0.1 s for other estimators.
    string
        A string preset, for a source that does not know its string.
    sensor
        A sensor preset, or a file written by `tune` or ``monochord tune``; its string takes precedence.
    options
        Options of the source, such as ``seed=1`` or ``speed=0.0`` for the twin.

    Returns
    -------
    Iterator[Update]
        One update per window: the estimates (``update.position``), the tracked estimates
        (``update.tracked.position``), `decided`, `events`, `notes`, and the truth of simulated sound. The
        source is opened at the first `next` and released when the iterator ends or is closed.

    Raises
    ------
    InputError
        For an unknown source or model, or sound or an option that cannot be used.
    DeviceError
        If a device is missing or lost for good.

    Examples
    --------
    >>> updates = list(listen("twin", seconds=0.3, speed=0.0))
    >>> len(updates), sorted(updates[0].estimates)
    (21, ['contact', 'force', 'position', 'slip'])

    >>> from monochord import VirtualSensor
    >>> twin = VirtualSensor("prototype", seed=1)
    >>> for update in listen(twin, seconds=0.8):
    ...     if update.time == 0.0:
    ...         _ = twin.press(0.09, 1.0)
    >>> print(f"{update.position.value:.2f} m, truly {update.truth['position']:.2f} m")
    0.09 m, truly 0.09 m
    """
    return _updates(live_run(source, model, seconds, hop, window, string, sensor, options))


async def listen_async(
    source: Listenable = "jack", model: Answering = "demo", **options: Any
) -> AsyncIterator[Update]:
    """Yield the updates of `listen` for asyncio programs; takes the same arguments.

    The loop runs in a separate thread. A slow consumer delays it as in `listen`, so that the next update is
    always the newest window. Leaving the iteration ends the thread and releases the source.

    Examples
    --------
    >>> import asyncio
    >>> async def first() -> float:
    ...     async for update in listen_async("twin", seconds=0.3, speed=0.0):
    ...         return update.time
    >>> asyncio.run(first())
    0.0
    """
    names = ("seconds", "hop", "window", "string", "sensor")
    given = {name: options.pop(name) for name in names if name in options}
    defaults: dict[str, Any] = {"seconds": math.inf, "hop": 0.01, "window": None, "string": "", "sensor": ""}
    setup = live_run(source, model, **{**defaults, **given}, options=options)
    with ExitStack() as stack:
        live = await asyncio.to_thread(stack.enter_context, opened(setup))
        updates, waiting = iter(live), None
        try:
            while True:
                waiting = asyncio.create_task(asyncio.to_thread(next, updates, None))
                update = await asyncio.shield(waiting)
                if update is None:
                    return
                yield update
        finally:
            live.close()
            if waiting is not None:
                await asyncio.wait([waiting])  # the thread is done with the source before that is released


def _updates(setup: LiveRun) -> Generator[Update]:
    with opened(setup) as live:
        yield from live


@checked
def live_run(
    source: Listenable,
    model: Answering,
    seconds: Annotated[Seconds, Meta(ge=0.0)],
    hop: Hop,
    window: WindowLength | None,
    string: str | Path,
    sensor: str | Path,
    options: dict[str, Any],
    strings: Mapping[str, StringSettings] = ONE_STRING,
) -> LiveRun:
    """Return the run of `listen` for its arguments, of several `strings` where they are given."""
    estimator = _estimator(model)
    length = estimator.window if window is None else window
    settings = WindowSettings(hop=hop) if length is None else WindowSettings(length=length, hop=hop)
    run = LiveRun(
        source=source_of(source, options, settings, seconds),
        estimator=estimator,
        window=settings,
        string=str(string),
        sensor=str(sensor),
        strings=strings,
        seconds=seconds,
    )
    return run.with_channels()


def source_of(
    source: Listenable,
    options: dict[str, Any],
    window: WindowSettings = WindowSettings(),  # noqa: B008  (frozen)
    seconds: Seconds = math.inf,
) -> Source:
    """Return the source that `listen` opens for its argument of the same name, with these options.

    An array or a virtual sensor is read by the hop of `window`, and a virtual sensor for `seconds`.
    """
    if isinstance(source, (Source, VirtualSensor, VirtualSensors)):
        if options:
            what = "a source object" if isinstance(source, Source) else "a virtual sensor"
            given = f"options {', '.join(options)} with {what}"
            raise InputError(given, "none", "pass them to the source")
        if isinstance(source, Source):
            return source
        if isinstance(source, VirtualSensors):
            _, hop = window.frames(source[0].sample_rate)
            return VirtualSensorsSource(sensors=source, block=hop, seconds=seconds)
        _, hop = window.frames(source.sample_rate)
        return VirtualSensorSource(sensor=source, block=hop, seconds=seconds)
    if not isinstance(source, (str, Path)):
        return _array_source(source, window, **options)
    if isinstance(source, str) and source.replace("-", "_") in SOURCES.names():
        return SOURCES.build(source, options)
    return SOURCES.build(recording_source(source) or "wav", {"path": str(source), **options})


@checked
def _array_source(
    samples: NDArray[Any],
    window: WindowSettings,
    *,
    sample_rate: Positive[Hertz] | None = None,
    **others: Any,
) -> Source:
    if others:
        raise InputError(f"options {', '.join(others)} with an array", "sample_rate alone")
    if sample_rate is None:
        raise InputError("an array without its sample rate", "sample_rate in Hz", "set sample_rate=44100")
    _, hop = window.frames(round(sample_rate))
    return ArraySource(samples=samples, sample_rate=sample_rate, block=max(hop, 1))


def _estimator(model: Answering) -> Estimator:
    """Return the estimator that an answer is asked of: itself, or by a model or a name."""
    if isinstance(model, Estimator):
        return model
    if isinstance(model, Model):
        return LoadedModel(loaded=model)
    if isinstance(model, str) and model.replace("-", "_") in set(ESTIMATORS.names()) - {MODEL}:
        return ESTIMATORS.build(model)
    return ESTIMATORS.build(MODEL, {"path": str(model)})
