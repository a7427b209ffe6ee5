"""What a policy observes of a string: its estimates, its sound, or features of its sound.

An `Observer` is fed with a string's sound hop by hop, keeps the last window of 0.1 s, and gives one row for
it. The row ``estimates`` is `estimates_row` of the live loop's results; therefore a policy that was trained
in a simulator runs on a real sensor with `mc.listen`, whose updates hold the same results. `observe` feeds
many observers at once, with the same bits as one by one.
"""

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from gymnasium.spaces import Box

from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimates, Prediction, Signal, Window
from monochord.core.units import Metres
from monochord.live.filter import FilterSettings, FilterState, Tracked, step
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.perception.model import load
from monochord.perception.model.stepping import step_all
from monochord.perception.model.stream import ModelStream

__all__ = ["ESTIMATES", "ObservationKind", "Observer", "estimates_row", "observe", "observer"]

ObservationKind = Literal["estimates", "sound", "features"]
ESTIMATES = (
    "contact",
    "touched",
    "slip",
    "sliding",
    "position",
    "position error",
    "position stated",
    "force",
    "force error",
    "force stated",
)
"""Columns of the observation ``estimates``; see `estimates_row`."""
_HIGH = np.array([1, 1, 1, 1, 1, 1, 1, 10, 10, 1], np.float32)
MAX_FEATURE = 100.0
"""Bound of a feature's column. Columns of `fft_harmonic` on the twin lie within 40."""
_SETTINGS = FilterSettings()


def estimates_row(
    estimates: Estimates, tracked: Estimates, decided: Mapping[str, bool], length: Metres
) -> Audio:
    """Return a window's results as the row ``estimates`` of an observation.

    On a real sensor: ``estimates_row(update.estimates, update.tracked, update.decided, length)`` for each
    update of ``mc.listen(..., hop=0.02)``.

    Parameters
    ----------
    estimates, tracked, decided
        As of `mc.Update`.
    length
        Length of the string in m.

    Returns
    -------
    Audio
        (10,) float32, by `ESTIMATES`: the window's probability of contact, and the decision, 0 or 1; tracked
        probability of slip, and the decision; position in lengths of the string and its standard error; force
        in N and its standard error. A probability or decision that is missing is 0.5. ``stated`` is 1, or 0
        where position or force is withheld; then value and error are 0. Errors end at 1 length and 10 N.

    Examples
    --------
    >>> from monochord import Estimate
    >>> given = {"position": Estimate(value=0.08, std=0.001, unit="m")}
    >>> estimates_row({}, given, {"contact": True}, length=0.2)[[0, 1, 4, 5, 6]].round(3).tolist()
    [0.5, 1.0, 0.4000000059604645, 0.004999999888241291, 1.0]
    """
    row = [
        _probability(estimates, "contact"),
        float(decided.get("contact", 0.5)),
        _probability(tracked, "slip"),
        float(decided.get("slip", 0.5)),
        *_stated(tracked, "position", 1.0 / length),
        *_stated(tracked, "force", 1.0),
    ]
    return np.clip(np.array(row, np.float32), 0.0, _HIGH)


def _probability(estimates: Estimates, name: str) -> float:
    estimate = estimates.get(name)
    return estimate.value if estimate is not None and estimate.valid else 0.5


def _stated(estimates: Estimates, name: str, scale: float) -> tuple[float, float, float]:
    estimate = estimates.get(name)
    if estimate is None or not estimate.valid:
        return 0.0, 0.0, 0.0
    return scale * estimate.value, scale * estimate.std, 1.0


class Observer(ABC):
    """A string as a policy observes it; `observe` feeds it.

    Attributes
    ----------
    space
        Of the rows, bounded.
    size
        Length of a window in frames.
    """

    space: Box

    def __init__(self, signal: Signal, size: int) -> None:
        self._rate, self._start, self.size = signal.sample_rate, -size, size
        self._samples = np.zeros((2, size), np.float32)

    def copy(self) -> Self:
        """Return an observer that goes on from here by itself."""
        return copy.copy(self)  # samples and states are replaced, never changed

    @classmethod
    @abstractmethod
    def rows(cls, observers: Sequence[Any], windows: Sequence[Window]) -> Audio:
        """Return the row of each observer's next window."""

    def after(self, sound: Audio) -> Window:
        """Return the window that ends with this sound, (2, n) with n up to a window's length."""
        frames = sound.shape[1]
        self._samples = np.concatenate((self._samples[:, frames:], sound), axis=1)
        self._start += frames
        return Window(samples=self._samples, start=max(self._start, 0), sample_rate=self._rate)


class SoundObserver(Observer):
    """Both microphones of the last 0.1 s, (2, 4410) in full scale."""

    def __init__(self, signal: Signal, size: int) -> None:
        super().__init__(signal, size)
        self.space = Box(-1.0, 1.0, (2, size), np.float32)

    @classmethod
    def rows(cls, observers: Sequence[Any], windows: Sequence[Window]) -> Audio:  # noqa: ARG003
        """Return the windows' samples, (observers, 2, size)."""
        return np.clip(np.stack([window.samples for window in windows]), -1.0, 1.0)


class FeatureObserver(Observer):
    """The columns of a feature that depends on one window alone."""

    def __init__(self, signal: Signal, size: int, extractor: Extractor) -> None:
        super().__init__(signal, size)
        self._extractor = extractor
        self.space = Box(-MAX_FEATURE, MAX_FEATURE, (len(extractor.columns),), np.float32)

    @classmethod
    def rows(cls, observers: Sequence[Any], windows: Sequence[Window]) -> Audio:
        """Return the features, (observers, columns)."""
        extractor: Extractor = observers[0]._extractor  # noqa: SLF001
        rows = extractor(np.stack([window.samples for window in windows]))
        return np.clip(rows, -MAX_FEATURE, MAX_FEATURE)


class EstimateObserver(Observer):
    """What the live loop says after a window; see `estimates_row`."""

    def __init__(self, signal: Signal, size: int, stream: ModelStream, length: Metres) -> None:
        super().__init__(signal, size)
        self._stream, self._filter, self._length = stream, FilterState(), length
        self.tracked = Tracked()
        self.space = Box(0.0, _HIGH, dtype=np.float32)

    def copy(self) -> Self:
        """Return an observer that goes on from here by itself; the model is shared."""
        other = super().copy()
        other._stream = self._stream.copy()  # noqa: SLF001
        return other

    @classmethod
    def rows(cls, observers: Sequence[Any], windows: Sequence[Window]) -> Audio:
        """Return the results of each window, (observers, columns)."""
        streams: list[ModelStream] = [each._stream for each in observers]  # noqa: SLF001
        inputs = [stream.before(window) for stream, window in zip(streams, windows, strict=True)]
        results = zip(observers, streams, windows, step_all(inputs), strict=True)
        return np.stack(
            [
                each._row(stream.after(*result), window)  # noqa: SLF001
                for each, stream, window, result in results
            ]
        )

    def _row(self, estimates: Estimates, window: Window) -> Audio:
        """Return the row of a window, and keep what is tracked after it."""
        prediction = Prediction(
            start=window.start, time=window.start / window.sample_rate, estimates=estimates
        )
        self._filter, self.tracked = step(self._filter, prediction, window.duration, _SETTINGS)
        return estimates_row(estimates, self.tracked.estimates, self.tracked.decided, self._length)


def observer(
    kind: ObservationKind,
    signal: Signal,
    *,
    model: str | Path = "demo",
    feature: str = "fft_harmonic",
) -> Observer:
    """Return an observer at the beginning of a string's sound.

    Parameters
    ----------
    kind
        ``estimates`` of a model, ``sound``, or ``features``.
    signal
        Of two microphones of a known string.
    model
        A bundled model's name or a folder; its window is that of ``estimates``, others have 0.1 s.
    feature
        Name of a feature.

    Raises
    ------
    InputError
        For an unknown kind, model or feature, or a signal that does not fit it.

    Examples
    --------
    >>> signal = Signal(sample_rate=44100, channels=2)
    >>> observer("sound", signal).space.shape
    (2, 4410)
    """
    size = round(0.1 * signal.sample_rate)
    makers: dict[str, Callable[[], Observer]] = {
        "estimates": lambda: _of_estimates(signal, model),
        "sound": lambda: SoundObserver(signal, size),
        "features": lambda: FeatureObserver(signal, size, FEATURES.build(feature, {}).prepare(signal, size)),
    }
    if kind not in makers:
        raise InputError(f"observation {kind!r}", f"one of {', '.join(makers)}")
    return makers[kind]()


def _of_estimates(signal: Signal, model: str | Path) -> EstimateObserver:
    loaded = load(model)
    string = signal.string or loaded.definition.string
    if string is None:
        raise InputError("a signal of an unknown string", "one with a string", "with_sensor(signal, sensor)")
    size = loaded.definition.window
    return EstimateObserver(signal, size, loaded.stream(signal, size), string.length)


def observe(observers: Sequence[Any], sounds: Sequence[Audio]) -> Audio:
    """Feed observers of one kind with the sound that follows, (2, n) each, and return their rows.

    The rows are those of each observer alone, to the last bit.

    Examples
    --------
    >>> observers = [observer("sound", Signal(sample_rate=44100, channels=2)) for _ in range(3)]
    >>> observe(observers, np.zeros((3, 2, 441), np.float32)).shape
    (3, 2, 4410)
    """
    windows = [each.after(sound) for each, sound in zip(observers, sounds, strict=True)]
    return type(observers[0]).rows(observers, windows)
