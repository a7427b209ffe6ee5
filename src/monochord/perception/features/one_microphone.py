"""Another feature, as one microphone alone would give it."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor, Feature


@dataclass(frozen=True, slots=True, kw_only=True)
class OneMicrophone(Feature):
    """Another feature that hears one microphone in place of all.

    Every channel is a copy of the chosen one, so that nothing of the others comes in. The columns are those
    of the other feature; what tells differences of microphones is constant then. What a sensor with one
    microphone would do, as far as that feature can.

    Parameters
    ----------
    microphone
        The one that is heard, 1 or 2.
    feature
        Name and options of the other feature.

    Examples
    --------
    >>> extract = OneMicrophone(microphone=2, feature={"name": "log_mel"}).prepare(
    ...     Signal(sample_rate=44100, channels=2), 4410
    ... )
    >>> heard = np.random.default_rng(0).normal(size=(1, 2, 4410)).astype(np.float32)
    >>> deaf = heard * np.array([[0.0], [1.0]], np.float32)
    >>> bool((extract(heard) == extract(deaf)).all())
    True
    """

    microphone: Literal[1, 2] = 1
    feature: dict[str, Any] = field(default_factory=lambda: {"name": "fft_harmonic"})

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Prepare the other feature; raises `InputError` as that does, and for a microphone that is not."""
        if self.microphone > signal.channels:
            raise InputError(f"microphone {self.microphone} of {signal.channels}", "one that is there")
        options = dict(self.feature)
        name = options.pop("name", None)
        if not isinstance(name, str):
            raise InputError("one_microphone.feature without a name", ", ".join(FEATURES.names()))
        return _OneHeard(FEATURES.build(name, options).prepare(signal, size), self.microphone - 1)


class _OneHeard(Extractor):
    def __init__(self, extract: Extractor, channel: int) -> None:
        self._extract, self._channel = extract, channel

    @property
    def columns(self) -> tuple[str, ...]:
        return self._extract.columns

    def __call__(self, windows: Audio) -> Audio:
        heard = windows[:, self._channel : self._channel + 1]
        return self._extract(np.repeat(heard, windows.shape[1], axis=1))
