"""Engines of the transformer: PyTorch, ONNX Runtime in float32 or int8, or OpenVINO in int8.

All engines except PyTorch run an ONNX file. It is exported once, which requires PyTorch and transformers and
takes minutes, and kept in the user's cache folder. After that, only the engine is required.
"""

import json
import os
import shutil
from collections.abc import Callable
from functools import cache
from hashlib import file_digest, sha256
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, TypeAlias

import numpy as np

from monochord.core.errors import DeviceError
from monochord.core.types import Audio
from monochord_encoders.network import (
    BANDS,
    DEVIATION,
    MEAN,
    Weights,
    find_ast,
    missing_library,
    network_of,
    patch_columns,
    quiet_libraries,
)

Backend: TypeAlias = Literal["onnx", "int8", "openvino", "torch", "cuda"]
Embed: TypeAlias = Callable[[Audio], Audio]
"""Function from log-mel energies (channels, frames, 128) of 1 or 2 channels to embeddings (channels, 2
width)."""
Precision: TypeAlias = Literal["float32", "dynamic", "static"]
"""Precision of an ONNX file: float32, or int8 with activation scales computed at run time or fixed."""
PRECISIONS: dict[str, Precision] = {"onnx": "float32", "int8": "dynamic", "openvino": "static"}
EXPORT_VERSION = 2
"""Part of the cache key; increased when the exported files change."""
CALIBRATION_SPECTROGRAMS = 6
"""Number of synthetic spectrograms that determine the fixed scales."""


def build_engine(weights: Weights, *, frames: int, backend: Backend, threads: int = 1) -> Embed:
    """Return the function that embeds spectrograms of `frames` frames.

    Parameters
    ----------
    weights
        Weights from `find_ast`, or random weights.
    frames
        Frames of a spectrogram.
    backend
        ``onnx`` (float32) or ``int8`` with ONNX Runtime, ``openvino`` (int8), ``torch`` (PyTorch on the CPU)
        or ``cuda`` (PyTorch on a GPU).
    threads
        Threads of ONNX Runtime or OpenVINO.

    Raises
    ------
    InputError
        If a library is not installed, the weights cannot be used, or `frames` does not fit the weights.
    DeviceError
        If there is no GPU for ``cuda``.
    """
    if backend in ("torch", "cuda"):
        return _on_torch(weights, frames, "cpu" if backend == "torch" else "cuda")
    run = (_on_openvino if backend == "openvino" else _on_onnx)(weights, frames, PRECISIONS[backend], threads)

    def embed(energies: Audio) -> Audio:
        pair = energies if len(energies) == 2 else np.concatenate([energies, energies])
        return run(pair)[: len(energies)]

    return embed


def export(given: str, file: Path, *, frames: int = 100, int8: bool = False) -> None:
    """Write the network as an ONNX file, from ``energies`` (2, frames, 128) to ``embedding``.

    The file's metadata name the weights.

    Raises
    ------
    InputError
        If the weights cannot be used, `frames` does not fit the weights, or a library is not installed.
    """
    shutil.copyfile(onnx_file(find_ast(given), frames, "dynamic" if int8 else "float32"), file)


def onnx_file(weights: Weights, frames: int, precision: Precision) -> Path:
    """Return the network's ONNX file in the cache folder; exports it if it is absent or damaged."""
    patch_columns(frames)  # refuses a length before any library is loaded
    key = [EXPORT_VERSION, weights.label, weights.sha256, str(weights.sizes), frames, precision]
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    name = sha256(json.dumps(key).encode()).hexdigest()[:32]
    file = Path(cache) / "monochord" / "ast" / f"{name}.onnx"
    checksum = file.with_suffix(".sha256")
    if checksum.is_file() and file.is_file() and checksum.read_text(encoding="ascii") == _sha256(file):
        return file
    file.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=file.parent) as folder, quiet_libraries():
        exported = _export(weights, frames, precision, Path(folder))
        checksum.write_text(_sha256(exported), encoding="ascii")
        exported.replace(file)
    return file


def _export(weights: Weights, frames: int, precision: Precision, folder: Path) -> Path:
    onnx = _library("onnx")
    _library("onnxscript")  # PyTorch's exporter needs it and does not name it
    torch, network = _library("torch"), network_of(weights, frames)
    network.model.set_attn_implementation("eager")
    energies = torch.zeros(2, frames, BANDS)
    names: dict[str, Any] = {"input_names": ["energies"], "output_names": ["embedding"]}
    plain, file = folder / "plain.onnx", folder / "file.onnx"
    torch.onnx.export(network, (energies,), dynamo=True, verbose=False, **names).save(plain)
    if precision == "float32":
        file = plain
    else:
        _quantise(plain, file, precision, frames)
    model = onnx.load(file)
    origin = {"weights": weights.sha256 or weights.label, "random": str(weights.path is None).lower()}
    onnx.helper.set_model_props(model, origin)
    onnx.save(model, file)
    return file


def _quantise(plain: Path, file: Path, precision: Precision, frames: int) -> None:
    """Write a network with its products by constant matrices in int8, weights by output."""
    tools = _library("onnxruntime.quantization")
    options: dict[str, Any] = {
        # 7 bits: processors without 8-bit dot products add pairs in 16 bits and saturate silently.
        "reduce_range": True,
        "op_types_to_quantize": ["MatMul", "Gemm"],
        "per_channel": True,
        "weight_type": tools.QuantType.QInt8,
        "extra_options": {"MatMulConstBOnly": True},
    }
    if precision == "dynamic":
        tools.quantize_dynamic(plain, file, **options)
        return

    class Synthetic(tools.CalibrationDataReader):
        def __init__(self) -> None:
            random = np.random.default_rng(0)
            shape, count = (2, frames, BANDS), CALIBRATION_SPECTROGRAMS
            draws = (random.normal(MEAN, DEVIATION, shape).astype(np.float32) for _ in range(count))
            self._inputs = iter([{"energies": draw} for draw in draws])

        def get_next(self) -> dict[str, Audio] | None:
            return next(self._inputs, None)

    tools.quantize_static(plain, file, Synthetic(), activation_type=tools.QuantType.QUInt8, **options)


def _on_torch(weights: Weights, frames: int, device: str) -> Embed:
    network = network_of(weights, frames)
    torch = _library("torch")
    try:
        network = network.to(device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).partition("\n")[0]
        raise DeviceError(f"no device '{device}' for the encoder ({reason}); use the backend onnx") from error

    def embed(energies: Audio) -> Audio:
        with torch.inference_mode():
            return network(torch.from_numpy(energies)).numpy()

    return embed if device == "cpu" else _recorded(torch, network)


def _recorded(torch: Any, network: Any) -> Embed:
    """Return a network on a GPU whose kernels are recorded once and replayed.

    The graphics processor then waits for no Python: a window of two microphones takes 3.7 instead of 6.5 ms
    on an H200, with the same numbers.
    """

    @cache
    def graph_of(shape: tuple[int, ...]) -> tuple[Any, Any, Any]:
        graph, given = torch.cuda.CUDAGraph(), torch.zeros(shape, device="cuda")
        with torch.inference_mode():
            side = torch.cuda.Stream()
            side.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(side):
                network(given)  # libraries choose their kernels in a first run, which cannot be recorded
            torch.cuda.current_stream().wait_stream(side)
            with torch.cuda.graph(graph):
                embedding = network(given)
        return graph, given, embedding

    def embed(energies: Audio) -> Audio:
        graph, given, embedding = graph_of(energies.shape)
        with torch.inference_mode():
            given.copy_(torch.from_numpy(energies))
            graph.replay()
            return embedding.cpu().numpy()

    return embed


def _on_onnx(weights: Weights, frames: int, precision: Precision, threads: int) -> Embed:
    runtime = _library("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 3
    file = onnx_file(weights, frames, precision)
    session = runtime.InferenceSession(file, options, providers=["CPUExecutionProvider"])
    return lambda energies: session.run(["embedding"], {"energies": energies})[0]


def _on_openvino(weights: Weights, frames: int, precision: Precision, threads: int) -> Embed:
    vino = _library("openvino")
    options = {
        "INFERENCE_NUM_THREADS": threads,
        "PERFORMANCE_HINT": "LATENCY",
        "INFERENCE_PRECISION_HINT": "f32",
    }
    compiled = vino.Core().compile_model(onnx_file(weights, frames, precision), "CPU", options)
    return lambda energies: compiled([energies])[0].copy()


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise missing_library("This backend of the encoder", name) from error


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()
