"""The embedding of a window by the frozen Audio Spectrogram Transformer."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Checked
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds
from monochord.perception.encoders.ast.engines import Backend, Embed, build_engine
from monochord.perception.encoders.ast.network import BANDS, Weights, find_ast
from monochord.perception.features._mel import FINE_HOP, Spectrogram
from monochord.perception.features.base import Extractor, Feature

AUDIOSET_HOP: Samples = 160
"""Samples from frame to frame in AudioSet."""
MIN_FRAMES = 100
"""Frames that AudioSet's framing is padded to, at the least."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ast(Feature):
    """Mean and maximum over all patches of the transformer's last layer, microphone by microphone.

    Each microphone is resampled to 16 kHz; its log-mel spectrogram of 128 bands (100 frames of 0.1 s) is
    normalised with AudioSet's mean and deviation and embedded by the frozen network of 12 layers, 768 wide:
    mean(768) and max(768) over the patch tokens, 3072 columns of two microphones. Columns begin with the
    first eight digits of the weights' SHA-256, so that rows of other weights are not confused with these.

    The weights are no part of Monochord: `monochord weights get ast` fetches them. With `random` there are
    untrained ones, to measure speed or as a baseline; their columns begin with ``random``.

    A window is embedded by itself, since the network's last bits depend on how many are embedded at once, and
    int8 on its neighbours.

    Parameters
    ----------
    weights
        A safetensors file or a Hugging Face folder; empty for what MONOCHORD_AST names or was fetched.
    random
        Use random weights; `weights` must be empty then.
    seed
        Random seed of the untrained weights.
    backend
        ``onnx`` (float32) or ``int8`` by ONNX Runtime, ``openvino`` (int8), ``torch`` on the processor,
        ``cuda`` for PyTorch on a GPU. In float32 they differ in the last bits, int8 by a few hundredths of
        the spread: train and predict with the same. The first use of ``onnx``, ``int8`` or ``openvino``
        exports the network, which takes a minute or two, PyTorch and transformers.
    framing
        ``fine``: frames 1 ms apart, mirrored at the ends, 100 of 0.1 s. ``audioset``: 10 ms apart, as the
        network was trained, 8 of 0.1 s, and zeros up to 100.
    threads
        Of ONNX Runtime and OpenVINO.
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
        Checked.__post_init__(self)
        if self.random and self.weights:
            given = f"ast.weights '{self.weights}' and ast.random"
            raise InputError(given, "one of them", "leave out ast.weights for random ones")

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Read the weights and build the network; seconds. See `Feature.prepare` for what it raises."""
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
