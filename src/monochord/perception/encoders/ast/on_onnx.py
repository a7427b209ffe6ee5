"""The transformer in ONNX Runtime, which on a processor is faster than PyTorch; float32 or int8."""

from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.graph import graph_of
from monochord.perception.encoders.ast.patches import patches_of
from monochord.perception.encoders.ast.tensors import AstWeights


class OnOnnx:
    """Embed log-mel spectrograms of one length, of two microphones at once.

    Parameters
    ----------
    weights
        As read; their positions are cropped to fit.
    frames
        Of a spectrogram.
    int8
        Whether to calculate the large products in 8 bits: faster, and less exact.
    threads
        How many at once.

    Raises
    ------
    InputError
        If ONNX Runtime or onnx is not installed, or the spectrogram's length does not suit the weights.

    Examples
    --------
    >>> from monochord.perception.encoders.ast.tensors import random_weights
    >>> embed = OnOnnx(random_weights(seed=0, depth=1, width=64), frames=100)
    >>> embed(np.zeros((2, 100, 128), np.float32)).shape
    (2, 128)
    """

    def __init__(self, weights: AstWeights, *, frames: int, int8: bool = False, threads: int = 1) -> None:
        runtime = _runtime()
        options = runtime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.log_severity_level = 3
        graph = graph_of(weights, frames=frames, int8=int8)
        self._session = runtime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])

    def __call__(self, energies: Audio) -> Audio:
        """Return the embedding (channels, 2 width) of energies (channels, frames, 128), one or two channels.

        First the mean over all patches, then the maximum.
        """
        patches = patches_of(energies)
        both = patches if len(patches) == 2 else np.concatenate([patches, patches])
        return self._session.run(["embedding"], {"patches": both})[0][: len(patches)]


def _runtime() -> Any:
    try:
        import onnxruntime  # noqa: PLC0415
    except ImportError as error:
        given = "the encoder's backend onnx (ONNX Runtime is not installed)"
        raise InputError(given, "torch", "pip install 'monochord[encoders]'") from error
    return onnxruntime
