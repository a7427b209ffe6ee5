"""The transformer's weights from a safetensors file as Hugging Face's transformers write it."""

from collections.abc import Callable, Iterable, Mapping
from math import prod
from pathlib import Path

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.patches import ROWS
from monochord.perception.encoders.ast.tensors import HEAD, AstWeights, shapes
from monochord.perception.encoders.weights import checked_sum, find_weights, load_known

NAME = "ast"
PREFIX = "audio_spectrogram_transformer."
SINGLE = {
    "patch.weight": "embeddings.patch_embeddings.projection.weight",
    "patch.bias": "embeddings.patch_embeddings.projection.bias",
    "cls": "embeddings.cls_token",
    "distillation": "embeddings.distillation_token",
    "positions": "embeddings.position_embeddings",
    "final.weight": "layernorm.weight",
    "final.bias": "layernorm.bias",
}
OLD = {
    "qkv": ("attention.attention.query", "attention.attention.key", "attention.attention.value"),
    "out": ("attention.output.dense",),
    "up": ("intermediate.dense",),
    "down": ("output.dense",),
    "before": ("layernorm_before",),
    "after": ("layernorm_after",),
}
"""Parts of a layer in the published file, below ``encoder.layer.N``."""
NEW = {
    **OLD,
    "qkv": ("attention.q_proj", "attention.k_proj", "attention.v_proj"),
    "out": ("attention.o_proj",),
    "up": ("mlp.fc1",),
    "down": ("mlp.fc2",),
}
"""The same as transformers 5 names them, below ``layers.N``."""
_REMEDY = "give the file or the folder of an Audio Spectrogram Transformer in safetensors form"


def read_weights(given: str = "") -> AstWeights:
    """Read the weights from a file, from a Hugging Face folder, or from where they are kept.

    Parameters
    ----------
    given
        The file or folder; empty for the usual places, see `monochord.perception.encoders.weights`.

    Raises
    ------
    InputError
        If there are none, with the way to get them; if their sum is not the known one; or if the file is
        damaged or holds something else.
    """
    known = load_known(NAME)
    path = find_weights(known, given)
    own = checked_sum(known, path)
    return AstWeights(tensors=_tensors(path), sum=own)


def describe(path: Path) -> str:
    """Return in a few words what a file holds; raises `InputError` where it does not hold the transformer."""
    found = AstWeights(tensors=_tensors(path), sum="")
    numbers = sum(tensor.size for tensor in found.tensors.values())
    columns = (len(found.tensors["positions"]) - 2) // ROWS
    return (
        f"Audio Spectrogram Transformer, depth {found.depth}, width {found.width}, "
        f"{columns} patch columns, {numbers / 1e6:.1f} million numbers"
    )


def _tensors(path: Path) -> Mapping[str, Audio]:
    """Return all tensors of a file by our names, in their shapes."""
    import safetensors  # noqa: PLC0415

    try:
        with safetensors.safe_open(path, framework="numpy") as file:
            held = {name.removeprefix(PREFIX): name for name in file.keys()}  # noqa: SIM118  (it is no mapping)

            def take(name: str) -> Audio:
                if name not in held:
                    raise InputError(f"weights {path} (no '{name}' in them)", "the whole network", _REMEDY)
                return np.asarray(file.get_tensor(held[name]), np.float32)

            return _ours(path, take, held)
    except (safetensors.SafetensorError, TypeError) as error:
        raise InputError(f"weights {path} ({error})", "a whole safetensors file", _REMEDY) from error


def _ours(path: Path, take: Callable[[str], Audio], held: Iterable[str]) -> Mapping[str, Audio]:
    """Return the tensors that `take` gives by their names in the file."""
    stem, parts = ("layers", NEW) if "layers.0.layernorm_before.bias" in held else ("encoder.layer", OLD)
    depth = sum(name.startswith(f"{stem}.") and name.endswith(".layernorm_before.bias") for name in held)
    width, places = take(SINGLE["cls"]).size, take(SINGLE["positions"]).size
    columns = (places // width - 2) // ROWS if width else 0
    if depth < 1 or width % HEAD or columns < 1:
        given = f"weights {path} ({depth} layers of width {width}, {columns} patch columns)"
        raise InputError(given, f"layers of a multiple of {HEAD}", _REMEDY)
    tensors: dict[str, Audio] = {}
    for name, shape in shapes(depth=depth, width=width, columns=columns):
        if name in SINGLE:
            found = take(SINGLE[name])
        else:
            _, layer, part, kind = name.split(".")
            found = np.concatenate([take(f"{stem}.{layer}.{theirs}.{kind}") for theirs in parts[part]])
        if found.size != prod(shape):
            given = f"weights {path} ({name} of shape {found.shape})"
            raise InputError(given, f"{shape} in a network of width {width}", _REMEDY)
        if not np.isfinite(found).all():
            raise InputError(f"weights {path} ({name} is not finite)", "numbers", _REMEDY)
        tensors[name] = found.reshape(shape)
    return tensors
