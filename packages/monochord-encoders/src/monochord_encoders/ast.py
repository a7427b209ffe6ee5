"""The embedding of a window by the frozen Audio Spectrogram Transformer."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.perception.features.base import Extractor, Feature
from monochord_encoders.engines import Backend, Embed, build_engine
from monochord_encoders.mel import FINE_HOP, Spectrogram
from monochord_encoders.network import BANDS, Weights, find_ast

AUDIOSET_HOP: Samples = 160
"""Samples from one frame to the next in AudioSet."""
MIN_FRAMES = 100
"""Spectrograms in AudioSet's framing are padded to at least this many frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ast(Feature):
    """Mean and maximum over all patches of the transformer's last layer, for each microphone.

    Each microphone's signal is resampled to 16 kHz. Its log-mel spectrogram (128 bands, 100 frames for 0.1 s)
    is normalised with AudioSet's mean and standard deviation. The frozen network of 12 layers, 768 wide,
    embeds it. The mean (768) and maximum (768) over the patch tokens give 3072 columns for two
    microphones. Column names begin with the first eight digits of the weights' SHA-256, so rows from
    different weights cannot be confused.

    Monochord does not ship the weights; `monochord weights get ast` downloads them. `random` uses untrained
    weights, to measure speed or as a baseline; their column names begin with ``random``.

    Windows are embedded one at a time. In a batch, the last bits of a float32 result depend on the batch
    size, and an int8 result depends on the other windows.

    Parameters
    ----------
    weights
        A safetensors file or a Hugging Face folder. Empty: the file that MONOCHORD_AST names, or the
        downloaded one.
    random
        Use random weights; `weights` must be empty.
    seed
        Random seed of the untrained weights.
    backend
        ``onnx`` (float32) or ``int8`` with ONNX Runtime, ``openvino`` (int8), ``torch`` (PyTorch on the CPU)
        or ``cuda`` (PyTorch on a GPU). The float32 backends differ in the last bits; int8 differs by a few
        hundredths of a column's spread. Train and predict with the same backend. The first use of ``onnx``,
        ``int8`` or ``openvino`` exports the network: this takes one or two minutes and requires PyTorch and
        transformers.
    framing
        ``fine``: frames 1 ms apart, mirrored at the ends, 100 for 0.1 s. ``audioset``: frames 10 ms apart, as
        in the network's training, 8 for 0.1 s, padded with zeros to 100.
    threads
        Threads of ONNX Runtime or OpenVINO.
    context
        Seconds at the start of each window that only settle the resampler.
    """

    weights: str = ""
    random: bool = False
    seed: int = 0
    backend: Backend = "onnx"
    framing: Literal["fine", "audioset"] = "fine"
    threads: Annotated[int, Meta(ge=1, le=256)] = 1
    context: Seconds = 0.0

    def __post_init__(self) -> None:
        Feature.__post_init__(self)
        if self.random and self.weights:
            given = f"ast.weights '{self.weights}' and ast.random"
            raise InputError(given, "only one of the two", "leave out ast.weights to use random weights")

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Read the weights and build the network, which takes seconds. Raises as `Feature.prepare` does."""
        fine = self.framing == "fine"
        spectrogram = Spectrogram(
            signal,
            size,
            hop=FINE_HOP if fine else AUDIOSET_HOP,
            centred=fine,
            bins=BANDS,
            context=self.context,
        )
        frames = spectrogram.frames if fine else max(spectrogram.frames, MIN_FRAMES)
        weights = Weights(seed=self.seed) if self.random else find_ast(self.weights)
        embed = build_engine(weights, frames=frames, backend=self.backend, threads=self.threads)
        return _Embedded(spectrogram, frames, embed, weights)


class _Embedded(Extractor):
    def __init__(self, spectrogram: Spectrogram, frames: int, embed: Embed, weights: Weights) -> None:
        self._spectrogram, self._frames, self._embed = spectrogram, frames, embed
        self._columns = tuple(
            f"{weights.label} mic {microphone + 1} {pooling} {number + 1}"
            for microphone in range(spectrogram.sound.channels)
            for pooling in ("mean", "max")
            for number in range(weights.sizes.width)
        )

    @property
    def columns(self) -> tuple[str, ...]:
        return self._columns

    def __call__(self, windows: Audio) -> Audio:
        windows = self._spectrogram.sound.check(windows)
        rows = np.empty((windows.shape[0], len(self._columns)), np.float32)
        for row, window in zip(rows, windows, strict=True):
            energies = self._spectrogram(window)
            short = self._frames - energies.shape[1]
            row[:] = self._embed(np.pad(energies, ((0, 0), (0, short), (0, 0)))).ravel()
        return rows
