"""What a layer of YAMNet makes of a window: a network trained on other sounds, not trained further."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.dsp.mel import MEL_RATE
from monochord.dsp.resample import Resampler
from monochord.perception.encoders.yamnet import YamnetMel, activations, load_yamnet
from monochord.perception.encoders.yamnet.mel import FLOOR, PATCH
from monochord.perception.encoders.yamnet.reading import LAYERS
from monochord.perception.encoders.yamnet.reading import Yamnet as Network
from monochord.perception.features.base import Extractor, Feature

FINE, COARSE = 16, 160
"""Samples from frame to frame at 16 kHz."""
LOUDEST = 1.0e3
"""Samples beyond this many times full scale count as it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Yamnet(Feature):
    """A layer of YAMNet, averaged over time alone, so that frequency is kept, since it is what tells a touch.

    Each microphone's sound is resampled to 16 kHz and cut into frames of 25 ms; `encoders.yamnet`
    does the rest. With the defaults 8 bands x 256 channels of each of two microphones, 4096 columns.

    Ridge regression on 2000 windows of the twin, scored on sessions left out, had mean absolute errors of
    position and force of 1.9 mm and 0.27 N from layer 1, 2.0 and 0.24 from 5, 1.7 and 0.23 from 7, 1.5 and
    0.24 from 9 and 11, but 5.4 and 0.36 from 27. YAMNet's own embedding is layer 27 averaged over all, 1024
    of each microphone: 5.3 and 0.35. It tells kinds of sound, whatever their pitch.

    Parameters
    ----------
    layer
        1 to 27, counted by convolutions.
    average
        Over "time", of the frames that hold sound, or over "all": time, silence after it, and frequency.
    hop
        From frame to frame: 0.001 s, or 0.01 s, as it was trained. Fewer than 96 frames are filled up with
        silence, since it was trained on 96.
    weights
        File of the weights; empty to look where `monochord weights` does.
    """

    layer: int = 9
    average: Literal["time", "all"] = "time"
    hop: Seconds = 0.001
    weights: str = ""

    def __post_init__(self) -> None:
        if not 1 <= self.layer <= LAYERS:
            raise InputError(f"yamnet.layer {self.layer}", f"1 to {LAYERS}")
        if round(self.hop * MEL_RATE, 6) not in (FINE, COARSE):
            raise InputError(f"yamnet.hop {self.hop:g} s", "0.001 s, 0.01 s")

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Read the weights; raises `InputError` without them, below 16 kHz, or for too short a window."""
        if signal.sample_rate < MEL_RATE:
            raise InputError(f"a sample rate of {signal.sample_rate} Hz", f"{MEL_RATE} Hz or more")
        return _Rows(self, load_yamnet(self.weights), signal, size)


class _Rows(Extractor):
    """The rows of a layer of a given network."""

    def __init__(self, options: Yamnet, network: Network, signal: Signal, size: Samples) -> None:
        self._layer, self._average = options.layer, options.average
        self._weights = network.convolutions[: options.layer]
        self._shape = (signal.channels, size)
        self._resampler = Resampler(sample_rate=signal.sample_rate, new_rate=MEL_RATE, size=size)
        hop = round(options.hop * MEL_RATE)
        self._mel = YamnetMel(size=self._resampler.length, hop=hop, centred=hop == FINE)
        missing = max(PATCH - self._mel.frames, 0)
        self._silence = np.full((signal.channels, missing, self._mel.bands), np.log(FLOOR), np.float32)
        stride = int(np.prod([one.stride for one in self._weights]))
        self._sounding = -(-self._mel.frames // stride)
        self._columns = self._named(stride)

    def _named(self, stride: int) -> tuple[str, ...]:
        bands = [f" band {band + 1}" for band in range(-(-self._mel.bands // stride))]
        return tuple(
            f"mic {microphone + 1} layer {self._layer}{band} channel {channel + 1}"
            for microphone in range(self._shape[0])
            for band in (bands if self._average == "time" else [""])
            for channel in range(self._weights[-1].bias.size)
        )

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    def __call__(self, windows: Audio) -> Audio:
        if windows.ndim != 3 or windows.shape[1:] != self._shape:
            raise InputError(f"windows of shape {windows.shape}", f"(n, {self._shape[0]}, {self._shape[1]})")
        rows = np.empty((len(windows), len(self._columns)), np.float32)
        # One by one: more at once would round otherwise.
        for row, window in zip(rows, windows, strict=True):
            row[:] = self._row(window)
        return rows

    def _row(self, window: Audio) -> Audio:
        sound = np.clip(np.nan_to_num(window, nan=0.0, posinf=0.0, neginf=0.0), -LOUDEST, LOUDEST)
        patches = np.concatenate([self._mel(self._resampler(sound)), self._silence], axis=1)
        made = activations(self._weights, patches, self._layer)
        mean = made[:, : self._sounding].mean(axis=1) if self._average == "time" else made.mean(axis=(1, 2))
        return mean.reshape(-1)
