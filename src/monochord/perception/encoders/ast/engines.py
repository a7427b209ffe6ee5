"""What runs the transformer: PyTorch, ONNX Runtime in float32 or int8, or OpenVINO in int8.

All but PyTorch run an ONNX file that is made once, which takes PyTorch, transformers and up to minutes, and
is kept in the user's cache folder: after that the engine alone is needed.
"""

import json
import os
import shutil
from collections.abc import Callable
from hashlib import file_digest, sha256
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, TypeAlias

import numpy as np

from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.network import Weights, find, network_of, quiet
from monochord.perception.encoders.ast.patches import BINS, DEVIATION, MEAN, columns_of

Backend: TypeAlias = Literal["onnx", "int8", "openvino", "torch", "cuda"]
Embed: TypeAlias = Callable[[Audio], Audio]
"""From log-mel energies (channels, frames, 128) to embeddings (channels, 2 width), of one or two channels."""
Form: TypeAlias = Literal["float32", "dynamic", "static"]
"""Of an ONNX file: in float32, or int8 with the scale of what is multiplied of the moment or fixed."""
FORMS: dict[str, Form] = {"onnx": "float32", "int8": "dynamic", "openvino": "static"}
RECIPE = 1
"""Raised where files that were made before are no longer the same network."""
CALIBRATION = 6
"""Made-up spectrograms that the fixed scales are taken from."""


def engine_of(weights: Weights, *, frames: int, backend: Backend, threads: int = 1) -> Embed:
    """Return what embeds spectrograms of so many frames.

    Parameters
    ----------
    weights
        As `network.find` gives them, or random ones.
    frames
        Of a spectrogram.
    backend
        ``onnx`` (float32) or ``int8`` by ONNX Runtime, ``openvino`` (int8), ``torch`` on the processor,
        ``cuda``.
    threads
        Of ONNX Runtime and OpenVINO.

    Raises
    ------
    InputError
        If a library is not installed, the weights cannot be used, or the length does not suit them.
    DeviceError
        If there is no GPU for ``cuda``.
    """
    if backend in ("torch", "cuda"):
        return _on_torch(weights, frames, "cpu" if backend == "torch" else "cuda")
    run = (_on_openvino if backend == "openvino" else _on_onnx)(weights, frames, FORMS[backend], threads)

    def embed(energies: Audio) -> Audio:
        both = energies if len(energies) == 2 else np.concatenate([energies, energies])
        return run(both)[: len(energies)]

    return embed


def export(given: str, file: Path, *, frames: int = 100, int8: bool = False) -> None:
    """Write the network that weights hold as an ONNX file: ``energies`` (2, frames, 128) to ``embedding``.

    The file says in its properties which weights it was made of.

    Raises
    ------
    InputError
        If the weights cannot be used, the length does not suit them, or a library is not installed.
    """
    shutil.copyfile(onnx_file(find(given), frames, "dynamic" if int8 else "float32"), file)


def onnx_file(weights: Weights, frames: int, form: Form) -> Path:
    """Return the network as an ONNX file in the cache folder, made if it is not there or damaged."""
    columns_of(frames)  # refuses a length before anything is looked for
    about = [RECIPE, weights.label, weights.sum, str(weights.sizes), frames, form]
    key = sha256(json.dumps(about).encode()).hexdigest()[:32]
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    file = Path(cache) / "monochord" / "ast" / f"{key}.onnx"
    seal = file.with_suffix(".sha256")
    if seal.is_file() and file.is_file() and seal.read_text(encoding="ascii") == _sum(file):
        return file
    file.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=file.parent) as folder, quiet():
        made = _made(weights, frames, form, Path(folder))
        seal.write_text(_sum(made), encoding="ascii")
        made.replace(file)
    return file


def _made(weights: Weights, frames: int, form: Form, folder: Path) -> Path:
    onnx = _library("onnx")
    _library("onnxscript")  # which the exporter needs and does not name
    torch, network = _library("torch"), network_of(weights, frames)
    network.model.set_attn_implementation("eager")
    energies = torch.zeros(2, frames, BINS)
    names: dict[str, Any] = {"input_names": ["energies"], "output_names": ["embedding"]}
    plain, made = folder / "plain.onnx", folder / "made.onnx"
    torch.onnx.export(network, (energies,), dynamo=True, verbose=False, **names).save(plain)
    if form == "float32":
        made = plain
    else:
        _quantise(plain, made, form, frames)
    model = onnx.load(made)
    about = {"weights": weights.sum or weights.label, "random": str(weights.path is None).lower()}
    onnx.helper.set_model_props(model, about)
    onnx.save(model, made)
    return made


def _quantise(plain: Path, made: Path, form: Form, frames: int) -> None:
    """Write a network with its products by constant matrices in int8, weights by output."""
    tools = _library("onnxruntime.quantization")
    usual: dict[str, Any] = {
        "op_types_to_quantize": ["MatMul", "Gemm"],
        "per_channel": True,
        "weight_type": tools.QuantType.QInt8,
        "extra_options": {"MatMulConstBOnly": True},
    }
    if form == "dynamic":
        # 7 bits: processors without 8-bit dot products add pairs in 16 bits and saturate silently.
        tools.quantize_dynamic(plain, made, reduce_range=True, **usual)
        return

    class MadeUp(tools.CalibrationDataReader):
        def __init__(self) -> None:
            stream = np.random.default_rng(0)
            draws = (stream.normal(MEAN, DEVIATION, (2, frames, BINS)) for _ in range(CALIBRATION))
            self._inputs = iter([{"energies": draw.astype(np.float32)} for draw in draws])

        def get_next(self) -> dict[str, Audio] | None:
            return next(self._inputs, None)

    tools.quantize_static(plain, made, MadeUp(), activation_type=tools.QuantType.QUInt8, **usual)


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
            return network(torch.from_numpy(energies).to(device)).cpu().numpy()

    return embed


def _on_onnx(weights: Weights, frames: int, form: Form, threads: int) -> Embed:
    runtime = _library("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    options.log_severity_level = 3
    file = onnx_file(weights, frames, form)
    session = runtime.InferenceSession(file, options, providers=["CPUExecutionProvider"])
    return lambda energies: session.run(["embedding"], {"energies": energies})[0]


def _on_openvino(weights: Weights, frames: int, form: Form, threads: int) -> Embed:
    vino = _library("openvino")
    how = {"INFERENCE_NUM_THREADS": threads, "PERFORMANCE_HINT": "LATENCY", "INFERENCE_PRECISION_HINT": "f32"}
    compiled = vino.Core().compile_model(onnx_file(weights, frames, form), "CPU", how)
    return lambda energies: compiled([energies])[0].copy()


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        given = f"this backend of the encoder ({name} is not installed)"
        extra = "openvino" if name == "openvino" else "encoders"
        raise InputError(given, "another one", f"pip install 'monochord[{extra}]'") from error


def _sum(file: Path) -> str:
    with file.open("rb") as stream:
        return file_digest(stream, "sha256").hexdigest()
