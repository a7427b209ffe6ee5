"""The frozen Audio Spectrogram Transformer, with the network of Hugging Face's transformers.

Weights come from a file; a spectrogram may have any length.

Source: Y. Gong, Y.-A. Chung and J. Glass, AST: Audio Spectrogram Transformer, Interspeech 2021.
"""

import logging
import warnings
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.config import from_tree, load_json
from monochord.core.errors import InputError, MissingLibraryError
from monochord_encoders.weights import checked_sum, find_weights, load_known

BANDS = 128
"""Mel bands of a spectrogram."""
PATCH, STRIDE = 16, 10
"""Size of a patch, and step from one patch to the next, in bands and in frames."""
PATCH_ROWS = (BANDS - PATCH) // STRIDE + 1
MEAN, DEVIATION = -4.2677393, 4.5689974
"""Mean and standard deviation of log-mel energies in AudioSet."""
PREFIX = "audio_spectrogram_transformer."
"""Prefix of tensor names in the published file."""
HEAD_WIDTH = 64
"""Default width of an attention head."""
RANDOM_STD = 0.02
"""Standard deviation of random weights, as at the start of training."""
_REMEDY = "give the file or the folder of an Audio Spectrogram Transformer in safetensors form"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Number of layers, width of a token, inner width of a layer's MLP, and number of patch columns."""

    depth: int = 12
    width: int = 768
    inner: int = 3072
    columns: int = 101


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """The weights in the file `path` with their SHA-256; without a path, random weights from `seed`."""

    sizes: Sizes = Sizes()
    path: Path | None = None
    sha256: str = ""
    seed: int = 0

    @property
    def label(self) -> str:
        """Prefix of a feature's column names with these weights.

        Examples
        --------
        >>> Weights(seed=3).label
        'random(3)'
        """
        return self.sha256[:8] if self.path else f"random({self.seed})"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Config:
    """Entries of a `config.json` that the shapes of the weights do not determine."""

    num_attention_heads: int = 0
    layer_norm_eps: float = 1e-12
    hidden_act: str = "gelu"
    qkv_bias: bool = True


def patch_columns(frames: int) -> int:
    """Return the number of patch columns in a spectrogram; raises `InputError` if there is none.

    Examples
    --------
    >>> patch_columns(100), patch_columns(1024)
    (9, 101)
    """
    if frames < PATCH:
        raise InputError(f"a spectrogram of {frames} frames", f"{PATCH} frames or more")
    return (frames - PATCH) // STRIDE + 1


def find_ast(given: str = "") -> Weights:
    """Return the weights from a file or a Hugging Face folder; by default from their usual place.

    Raises
    ------
    InputError
        If the weights are missing (the message says how to get them), have an unexpected checksum, are
        damaged, or belong to another network.
    """
    known = load_known("ast")
    path = find_weights(known, given)
    return Weights(path=path, sha256=checked_sum(known, path), sizes=_sizes(path))


def describe(path: Path) -> str:
    """Return a short description of a file; raises `InputError` if it belongs to another network."""
    sizes = _sizes(path)
    return (
        f"Audio Spectrogram Transformer, depth {sizes.depth}, width {sizes.width}, "
        f"{sizes.columns} patch columns"
    )


def network_of(weights: Weights, frames: int) -> Any:
    """Return the network as a PyTorch module, for spectrograms of `frames` frames.

    The input is log-mel energies e (channels, frames, 128), as natural logarithms; the module normalises them
    to (e - mean) / (2 deviation), as in training. The output (channels, 2 width) is the mean and the maximum
    over all patches of the last layer.

    The weights contain a position for each patch, in 12 rows (frequency) and up to 101 columns (time). A
    shorter sound uses the positions of the middle columns, as the original authors do. The positions of the
    first two tokens do not change.

    Raises
    ------
    InputError
        If PyTorch or transformers is not installed, the weights belong to another network, or the sound is
        longer than in training.
    """
    torch, _ = _libraries()
    trained, columns = weights.sizes.columns, patch_columns(frames)
    if columns > trained:
        longest = PATCH + STRIDE * trained - 1
        raise InputError(f"a spectrogram of {frames} frames", f"at most {longest} frames with these weights")
    with quiet_libraries(), torch.no_grad():
        model = _load_model(weights.path, weights.sizes) if weights.path else _random_model(weights)
        positions = model.embeddings.position_embeddings
        grid = positions[0, 2:].reshape(PATCH_ROWS, trained, -1)
        first = trained // 2 - columns // 2
        middle = grid[:, first : first + columns].flatten(0, 1)
        positions = torch.cat([positions[0, :2], middle])[None].clone()
        model.embeddings.position_embeddings = torch.nn.Parameter(positions)
    model.config.max_length = frames

    class Pooled(torch.nn.Module):
        """The encoder with what goes before and after it: scaled energies in, 1536 numbers out."""

        def __init__(self) -> None:
            super().__init__()
            self.model = model

        def forward(self, energies: Any) -> Any:
            """Return mean and maximum over the tokens."""
            state = self.model((energies - MEAN) / (2.0 * DEVIATION)).last_hidden_state[:, 2:]
            return torch.cat([state.mean(dim=1), state.amax(dim=1)], dim=1)

    return Pooled().eval().requires_grad_(requires_grad=False)


@contextmanager
def quiet_libraries() -> Generator[None]:
    """Suppress the libraries' messages and warnings on the terminal."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def _ast_config(sizes: Sizes, config: _Config) -> Any:
    _, transformers = _libraries()
    heads = config.num_attention_heads or sizes.width // HEAD_WIDTH
    return transformers.ASTConfig(
        **{**asdict(config), "num_attention_heads": heads},
        hidden_size=sizes.width,
        num_hidden_layers=sizes.depth,
        intermediate_size=sizes.inner,
        max_length=PATCH + STRIDE * (sizes.columns - 1),
        frequency_stride=STRIDE,
        time_stride=STRIDE,
    )


def _load_model(path: Path, sizes: Sizes) -> Any:
    """Return the model with the weights of a file; a file of too few numbers takes no memory."""
    torch, transformers = _libraries()
    from safetensors.torch import load_file  # noqa: PLC0415

    config = _ast_config(sizes, _read_config(path, sizes))
    try:
        with torch.device("meta"):
            expected = _count(dict(transformers.ASTModel(config).named_parameters()))
    except (KeyError, ValueError) as error:
        given = f"weights {path} (configuration: {error})"
        raise InputError(given, "a supported configuration", _REMEDY) from error
    tensors = {name: one for name, one in load_file(path).items() if not name.startswith("classifier")}
    if (count := _count(tensors)) < expected:
        raise InputError(f"weights {path} ({count} numbers)", f"the whole network of {expected}", _REMEDY)
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            raise InputError(f"weights {path} ({name} is not finite)", "numbers", _REMEDY)
    logs = transformers.utils.logging
    verbosity, bar = logs.get_verbosity(), logs.is_progress_bar_enabled()
    logs.set_verbosity(logging.CRITICAL)
    logs.disable_progress_bar()
    try:
        model, report = transformers.ASTModel.from_pretrained(
            None, config=config, state_dict=tensors, output_loading_info=True, dtype=torch.float32
        )
    except (RuntimeError, ValueError, KeyError) as error:
        given = f"weights {path} (a tensor of another shape)"
        raise InputError(given, f"shapes for {asdict(sizes)}", _REMEDY) from error
    finally:
        logs.set_verbosity(verbosity)
        if bar:
            logs.enable_progress_bar()
    if missing := sorted(report["missing_keys"]):
        raise InputError(f"weights {path} (no '{missing[0]}' in them)", "the whole network", _REMEDY)
    return model


def _count(tensors: Mapping[str, Any]) -> int:
    return sum(tensor.numel() for tensor in tensors.values())


def _read_config(path: Path, sizes: Sizes) -> _Config:
    """Return the configuration beside the weights, or the default one."""
    file = path.with_name("config.json")
    if not file.is_file():
        return _Config()
    tree = load_json(file, _REMEDY)
    tree = tree if isinstance(tree, dict) else {}
    required = {"patch_size": PATCH, "frequency_stride": STRIDE, "time_stride": STRIDE}
    for name, value in required.items():
        if tree.get(name, value) != value:
            raise InputError(f"{file} ({name} {tree[name]})", f"{name} {value}", _REMEDY)
    names = [field.name for field in fields(_Config)]
    config = from_tree(_Config, {name: tree[name] for name in names if name in tree}, str(file))
    if config.num_attention_heads < 0 or sizes.width % (config.num_attention_heads or HEAD_WIDTH):
        given = f"{file} ({config.num_attention_heads} heads for a width of {sizes.width})"
        raise InputError(given, "a number of heads that divides the width", _REMEDY)
    return config


def _random_model(weights: Weights) -> Any:
    """Return an untrained model: a baseline, and a stand-in for measuring speed.

    Matrices, tokens and positions are normal with a standard deviation of 0.02, biases zero, scales one.
    """
    torch, transformers = _libraries()
    model = transformers.ASTModel(_ast_config(weights.sizes, _Config()))
    random = np.random.default_rng(weights.seed)
    for name, tensor in model.named_parameters():
        if name.endswith("bias"):
            tensor.zero_()
        elif "layernorm" in name:
            tensor.fill_(1.0)
        else:
            tensor.copy_(torch.from_numpy(RANDOM_STD * random.standard_normal(tensor.shape, np.float32)))
    return model


def _sizes(path: Path) -> Sizes:
    """Return the sizes that the shapes in a file imply; only its header is read."""
    import safetensors  # noqa: PLC0415

    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            shapes = {
                name.removeprefix(PREFIX): tuple(file.get_slice(name).get_shape())
                for name in file.keys()  # noqa: SIM118  (it is no mapping)
            }
    except (safetensors.SafetensorError, OSError, TypeError) as error:
        raise InputError(f"weights {path} ({error})", "a whole safetensors file", _REMEDY) from error
    for name in ("embeddings.cls_token", "embeddings.position_embeddings"):
        if name not in shapes:
            raise InputError(f"weights {path} (no '{name}' in them)", "the whole network", _REMEDY)
    depth = sum(name.endswith(".layernorm_before.bias") for name in shapes)
    width, positions = prod(shapes["embeddings.cls_token"]), prod(shapes["embeddings.position_embeddings"])
    biases = ("mlp.fc1.bias", "intermediate.dense.bias")
    inner = next((prod(shape) for name, shape in shapes.items() if name.endswith(biases)), 0)
    columns = (positions // width - 2) // PATCH_ROWS if width else 0
    if min(depth, inner, columns) < 1 or width % HEAD_WIDTH:
        given = f"weights {path} ({depth} layers of width {width}, {columns} patch columns)"
        raise InputError(given, f"layers whose width is a multiple of {HEAD_WIDTH}", _REMEDY)
    return Sizes(depth=depth, width=width, inner=inner, columns=columns)


def _libraries() -> tuple[Any, Any]:
    try:
        import torch  # noqa: PLC0415
        import transformers  # noqa: PLC0415
    except ImportError as error:
        raise missing_library("The transformer", error.name or "torch") from error
    return torch, transformers


def missing_library(task: str, name: str) -> MissingLibraryError:
    """Return the error for a library that is not there, as after an installation without dependencies."""
    library = name.partition(".")[0]
    return MissingLibraryError(task, library, "train" if library == "torch" else library)
