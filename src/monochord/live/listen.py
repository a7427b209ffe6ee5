"""Predictions from a source as they come: the live loop as an iterator, for programs."""

import asyncio
import math
from collections.abc import AsyncIterator, Generator, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.core.types import Prediction
from monochord.core.units import Seconds
from monochord.live.loop import opened
from monochord.live.settings import MODEL, LiveRun, WindowSettings, recording_source
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator
from monochord.perception.model import load


def listen(
    source: str | Path | Source = "jack",
    model: str | Path | Estimator = "demo",
    *,
    seconds: Seconds = math.inf,
    hop: Seconds = 0.01,
    window: Seconds | None = None,
    string: str = "",
    sensor: str = "",
    **options: Any,
) -> Iterator[Prediction]:
    """Yield a prediction for every window of a source, as soon as the window is complete.

    It is the loop of ``monochord live``: a file or a session gives the same numbers as it did live. A reader
    that is a hop or more behind a real-time source skips to the newest window.

    Parameters
    ----------
    source
        A recording (``take.wav``, ``take.flac``, ``take.mcap``), the name of a source (``"jack"``,
        ``"soundcard"``, ``"twin"``), or a source that was built.
    model
        A bundled model's name, the folder of a model or of a training run, the name of another estimator
        (``"closed_form"``), or an estimator that was built.
    seconds
        How much of the stream to process, in s.
    hop
        Distance of window starts, in s.
    window
        Length of a window in s; the model's own by default, 0.1 s for other estimators.
    string
        A string preset, for a source that does not know its string.
    sensor
        A sensor's preset, or the file that `tune` or ``monochord tune`` wrote: its string counts.
    options
        Options of the source, such as ``seed=1`` or ``speed=0.0`` for the twin.

    Returns
    -------
    Iterator[Prediction]
        The source is opened at the first `next` and released when the iterator ends or is closed.

    Raises
    ------
    InputError
        For an unknown source or model, or an option that cannot be used.
    DeviceError
        If a device is absent or goes away for good.

    Examples
    --------
    >>> predictions = list(listen("twin", seconds=0.3, speed=0.0))
    >>> len(predictions), sorted(predictions[0].estimates)
    (21, ['contact', 'force', 'position', 'slip'])
    """
    return _predictions(_live_run(source, model, seconds, hop, window, string, sensor, options))


async def listen_async(
    source: str | Path | Source = "jack", model: str | Path | Estimator = "demo", **options: Any
) -> AsyncIterator[Prediction]:
    """Yield what `listen` yields, for programs that use asyncio; it takes the same arguments.

    The loop runs in a thread of its own. A consumer that is slow delays it as in `listen`, so that the
    newest window is what comes next. Leaving the iteration ends the thread and releases the source.

    Examples
    --------
    >>> import asyncio
    >>> async def first() -> float:
    ...     async for prediction in listen_async("twin", seconds=0.3, speed=0.0):
    ...         return prediction.time
    >>> asyncio.run(first())
    0.0
    """
    names = ("seconds", "hop", "window", "string", "sensor")
    given = {name: options.pop(name) for name in names if name in options}
    defaults: dict[str, Any] = {"seconds": math.inf, "hop": 0.01, "window": None, "string": "", "sensor": ""}
    setup = _live_run(source, model, **{**defaults, **given}, options=options)
    with ExitStack() as stack:
        live = await asyncio.to_thread(stack.enter_context, opened(setup))
        updates, waiting = iter(live), None
        try:
            while True:
                waiting = asyncio.create_task(asyncio.to_thread(next, updates, None))
                update = await asyncio.shield(waiting)
                if update is None:
                    return
                yield update.prediction
        finally:
            live.close()
            if waiting is not None:
                await asyncio.wait([waiting])  # the thread is done with the source before that is released


def _predictions(setup: LiveRun) -> Generator[Prediction]:
    with opened(setup) as live:
        for update in live:
            yield update.prediction


def _live_run(
    source: str | Path | Source,
    model: str | Path | Estimator,
    seconds: Seconds,
    hop: Seconds,
    window: Seconds | None,
    string: str,
    sensor: str,
    options: dict[str, Any],
) -> LiveRun:
    estimator, length = _estimator(model)
    return LiveRun(
        source=source_of(source, options),
        estimator=estimator,
        window=WindowSettings(length=window or length, hop=hop),
        string=string,
        sensor=sensor,
        seconds=seconds,
    )


def source_of(source: str | Path | Source, options: dict[str, Any]) -> Source:
    """Return the source that `listen` opens for its argument of that name, with these options."""
    if isinstance(source, Source):
        if options:
            given = f"options {', '.join(options)} beside a source that was built"
            raise InputError(given, "none", "give them to the source")
        return source
    if isinstance(source, str) and source.replace("-", "_") in SOURCES.names():
        return SOURCES.build(source, options)
    return SOURCES.build(recording_source(source) or "wav", {"path": str(source), **options})


def _estimator(model: str | Path | Estimator) -> tuple[Estimator, Seconds]:
    """Return an estimator and the length of its windows."""
    if isinstance(model, Estimator):
        return model, WindowSettings().length
    if isinstance(model, str) and model.replace("-", "_") in set(ESTIMATORS.names()) - {MODEL}:
        return ESTIMATORS.build(model), WindowSettings().length
    definition = load(model).definition
    return ESTIMATORS.build(MODEL, {"path": str(model)}), definition.window / definition.sample_rate
