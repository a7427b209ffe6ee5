"""A layer of YAMNet over a window: a frozen network trained on other sounds."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.perception.features.base import Extractor, Feature
from monochord_encoders.mel import MEL_RATE, MelSound
from monochord_yamnet.network import (
    BANDS,
    LAYERS,
    LOG_OFFSET,
    PATCH,
    YamnetMel,
    YamnetWeights,
    activations,
    load_yamnet,
)

FINE_HOP: Samples = 16
"""Hop in samples that gives 100 frames in a tenth of a second."""
COARSE_HOP: Samples = 160
"""Hop in samples used in training."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Yamnet(Feature):
    """A layer of YAMNet, averaged over time only, to keep frequency, which a touch changes.

    Each microphone's sound is resampled to 16 kHz and cut into frames of 25 ms for
    `monochord_yamnet.network`. With the defaults 8 bands x 256 channels of each of two
    microphones, 4096 columns.

    Ridge regression on 2000 windows of the twin, scored on sessions left out, had mean absolute errors of
    position and force of 1.9 mm and 0.27 N from layer 1, 2.0 and 0.24 from 5, 1.7 and 0.23 from 7, 1.5 and
    0.24 from 9 and 11, but 5.4 and 0.36 from 27. YAMNet's own embedding is layer 27 averaged over all, 1024
    of each microphone: 5.3 and 0.35. It separates kinds of sound, whatever their pitch.

    Parameters
    ----------
    layer
        Layer number, 1 to 27, counting convolutions.
    average
        Average over "time", of the frames with sound, or over "all": time, the silence after it, and
        frequency.
    hop
        Hop of the frames: 0.001 s, or 0.01 s as in training. Fewer than 96 frames are padded with silence to
        96, as in training.
    weights
        Weights file; empty for the location of `monochord weights`.
    """

    layer: int = 9
    average: Literal["time", "all"] = "time"
    hop: Seconds = 0.001
    weights: str = ""

    def __post_init__(self) -> None:
        if not 1 <= self.layer <= LAYERS:
            raise InputError(f"yamnet.layer {self.layer}", f"1 to {LAYERS}")
        if round(self.hop * MEL_RATE, 6) not in (FINE_HOP, COARSE_HOP):
            raise InputError(f"yamnet.hop {self.hop:g} s", "0.001 s, 0.01 s")

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Read the weights; raises `InputError` without them, below 16 kHz, or for too short a window."""
        sound = MelSound(signal, size)
        return _LayerRows(self, load_yamnet(self.weights), sound)


class _LayerRows(Extractor):
    """The rows of a layer of a network."""

    def __init__(self, options: Yamnet, network: YamnetWeights, sound: MelSound) -> None:
        self._layer, self._average, self._sound = options.layer, options.average, sound
        self._convolutions = network.convolutions[: options.layer]
        hop = round(options.hop * MEL_RATE)
        self._mel = YamnetMel(size=sound.length, hop=hop, centred=hop == FINE_HOP)
        missing = max(PATCH - self._mel.frames, 0)
        self._silence = np.full((sound.channels, missing, BANDS), np.log(LOG_OFFSET), np.float32)
        stride = int(np.prod([one.stride for one in self._convolutions]))
        self._steps = -(-self._mel.frames // stride)
        """Time steps of the layer with sound."""
        bands = [f" band {band + 1}" for band in range(-(-BANDS // stride))]
        self._columns = tuple(
            f"mic {microphone + 1} layer {self._layer}{band} channel {channel + 1}"
            for microphone in range(sound.channels)
            for band in (bands if self._average == "time" else [""])
            for channel in range(self._convolutions[-1].bias.size)
        )

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    def __call__(self, windows: Audio) -> Audio:
        windows = self._sound.check(windows)
        rows = np.empty((len(windows), len(self._columns)), np.float32)
        # One by one: more at once would round otherwise.
        for row, window in zip(rows, windows, strict=True):
            patches = np.concatenate([self._mel(self._sound(window)), self._silence], axis=1)
            values = activations(self._convolutions, patches, self._layer)
            over_time = self._average == "time"
            mean = values[:, : self._steps].mean(axis=1) if over_time else values.mean(axis=(1, 2))
            row[:] = mean.reshape(-1)
        return rows
