"""Another feature, computed from one microphone alone."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from monochord.core.errors import InputError
from monochord.core.shapes import batch
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor, Feature


@dataclass(frozen=True, slots=True, kw_only=True)
class OneMicrophone(Feature):
    """Another feature, computed with one microphone's signal on every channel.

    The other microphone is not an input. The feature's columns stay the same, but differences between
    microphones are constant. The result approximates a sensor with one microphone.

    Parameters
    ----------
    microphone
        The microphone to use, 1 or 2.
    feature
        Name and options of the other feature.

    Examples
    --------
    >>> import monochord as mc
    >>> signal = Signal(sample_rate=44100, channels=2, string=mc.load_sensor("prototype").string)
    >>> extract = OneMicrophone(microphone=2, feature={"name": "fft_harmonic"}).prepare(signal, 4410)
    >>> both = np.random.default_rng(0).normal(size=(1, 2, 4410)).astype(np.float32)
    >>> second = both * np.array([[0.0], [1.0]], np.float32)
    >>> bool((extract(both) == extract(second)).all())
    True
    """

    microphone: Literal[1, 2] = 1
    feature: dict[str, Any] = field(default_factory=lambda: {"name": "reading"})

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Prepare the other feature.

        Raises `InputError` if the signal lacks the microphone or the other feature refuses the signal.
        """
        if self.microphone > signal.channels:
            given = f"microphone {self.microphone} of a signal with {signal.channels} channel(s)"
            raise InputError(given, f"a microphone from 1 to {signal.channels}")
        options = dict(self.feature)
        name = options.pop("name", None)
        if not isinstance(name, str):
            raise InputError("one_microphone.feature without a name", ", ".join(FEATURES.names()))
        extract = FEATURES.build(name, options).prepare(signal, size)
        return _Copied(extract, self.microphone - 1, (signal.channels, size))


class _Copied(Extractor):
    def __init__(self, extract: Extractor, channel: int, shape: tuple[int, Samples]) -> None:
        self._extract, self._channel, self._shape = extract, channel, shape

    @property
    def columns(self) -> tuple[str, ...]:
        return self._extract.columns

    def __call__(self, windows: Audio) -> Audio:
        windows = batch(windows, *self._shape)
        channel = windows[:, self._channel : self._channel + 1]
        return self._extract(np.repeat(channel, windows.shape[1], axis=1))
