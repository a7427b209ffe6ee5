"""The network of Hugging Face's transformers with the weights of a file, for spectrograms of any length."""

import logging
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.config import from_tree, load_json
from monochord.core.errors import InputError
from monochord.perception.encoders.ast.patches import DEVIATION, MEAN, PATCH, ROWS, STRIDE, columns_of
from monochord.perception.encoders.weights import checked_sum, find_weights, load_known

NAME, PREFIX = "ast", "audio_spectrogram_transformer."
HEAD = 64
"""Width of an attention head, where no configuration says otherwise."""
SPREAD = 0.02
"""Standard deviation of what is drawn, as such networks begin their training with."""
_REMEDY = "give the file or the folder of an Audio Spectrogram Transformer in safetensors form"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sizes:
    """Layers, numbers in a token, numbers between the two products of a layer, and patches side by side."""

    depth: int = 12
    width: int = 768
    inner: int = 3072
    columns: int = 101


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Which weights: those of the file `path`, or random ones by `seed` where there is none.

    `sum` is the SHA-256 of the file.
    """

    sizes: Sizes = Sizes()
    path: Path | None = None
    sum: str = ""
    seed: int = 0

    @property
    def label(self) -> str:
        """What the columns of a feature made with them are marked with.

        Examples
        --------
        >>> Weights(seed=3).label
        'random(3)'
        """
        return self.sum[:8] if self.path else f"random({self.seed})"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Config:
    """What of a configuration beside the weights is taken: the rest is in the shapes of the weights."""

    num_attention_heads: int = 0
    layer_norm_eps: float = 1e-12
    hidden_act: str = "gelu"
    qkv_bias: bool = True


def find(given: str = "") -> Weights:
    """Return the weights of a file, of a Hugging Face folder, or from where they are kept.

    Raises
    ------
    InputError
        If there are none, with the way to get them; if their sum is not the known one; or if the file is
        damaged or holds something else.
    """
    known = load_known(NAME)
    path = find_weights(known, given)
    return Weights(path=path, sum=checked_sum(known, path), sizes=_sizes(path))


def describe(path: Path) -> str:
    """Return in a few words what a file holds; raises `InputError` where it does not hold the transformer."""
    sizes = _sizes(path)
    return (
        f"Audio Spectrogram Transformer, depth {sizes.depth}, width {sizes.width}, "
        f"{sizes.columns} patch columns"
    )


def network_of(weights: Weights, frames: int) -> Any:
    """Return the network as a PyTorch module, for spectrograms of so many frames.

    It takes log-mel energies (channels, frames, 128), natural logarithms, and gives (channels, 2 width): the
    mean over all patches of the last layer, then the maximum. Energies are normalised first as in training,
    (e - mean) / (2 deviation). The positions of the patches are a field of 12 rows (frequency) and as many
    columns (time) as there were in training, of which the middle ones are taken; those of the two first
    tokens stay. So the original authors have it for shorter sounds.

    Raises
    ------
    InputError
        If PyTorch or transformers is not installed, the weights are not those of such a network, or it has
        seen no sound so long.
    """
    torch, _ = _libraries()
    own, wanted = weights.sizes.columns, columns_of(frames)
    if wanted > own:
        most = PATCH + STRIDE * own - 1
        raise InputError(f"a spectrogram of {frames} frames", f"{most} frames or fewer with these weights")
    with quiet(), torch.no_grad():
        model = _read(weights.path, weights.sizes) if weights.path else _drawn(weights)
        positions = model.embeddings.position_embeddings
        field = positions[0, 2:].reshape(ROWS, own, -1)
        first = own // 2 - wanted // 2
        middle = field[:, first : first + wanted].flatten(0, 1)
        fitting = torch.cat([positions[0, :2], middle])[None].clone()
        model.embeddings.position_embeddings = torch.nn.Parameter(fitting)
    model.config.max_length = frames

    class Pooled(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.model = model

        def forward(self, energies: Any) -> Any:
            state = self.model((energies - MEAN) / (2.0 * DEVIATION)).last_hidden_state[:, 2:]
            return torch.cat([state.mean(dim=1), state.amax(dim=1)], dim=1)

    return Pooled().eval().requires_grad_(requires_grad=False)


@contextmanager
def quiet() -> Generator[None]:
    """Keep what the libraries say of their own affairs from the terminal."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def _config(sizes: Sizes, more: _Config) -> Any:
    _, transformers = _libraries()
    heads = more.num_attention_heads or sizes.width // HEAD
    return transformers.ASTConfig(
        **{**asdict(more), "num_attention_heads": heads},
        hidden_size=sizes.width,
        num_hidden_layers=sizes.depth,
        intermediate_size=sizes.inner,
        max_length=PATCH + STRIDE * (sizes.columns - 1),
        frequency_stride=STRIDE,
        time_stride=STRIDE,
    )


def _read(path: Path, sizes: Sizes) -> Any:
    """Return the model with the weights of a file; a file of too few numbers takes no memory."""
    torch, transformers = _libraries()
    from safetensors.torch import load_file  # noqa: PLC0415

    config = _config(sizes, _beside(path, sizes))
    try:
        with torch.device("meta"):
            due = sum(tensor.numel() for tensor in transformers.ASTModel(config).parameters())
    except (KeyError, ValueError) as error:
        raise InputError(f"weights {path} (configuration: {error})", "a known one", _REMEDY) from error
    tensors = {name: one for name, one in load_file(path).items() if not name.startswith("classifier")}
    held = sum(tensor.numel() for tensor in tensors.values())
    if held < due:
        raise InputError(f"weights {path} ({held} numbers)", f"the whole network of {due}", _REMEDY)
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            raise InputError(f"weights {path} ({name} is not finite)", "numbers", _REMEDY)
    told = transformers.utils.logging
    shown, bar = told.get_verbosity(), told.is_progress_bar_enabled()
    told.set_verbosity(logging.CRITICAL)
    told.disable_progress_bar()
    try:
        model, found = transformers.ASTModel.from_pretrained(
            None, config=config, state_dict=tensors, output_loading_info=True, dtype=torch.float32
        )
    except (RuntimeError, ValueError, KeyError) as error:
        given = f"weights {path} (a tensor of another shape)"
        raise InputError(given, f"those of {asdict(sizes)}", _REMEDY) from error
    finally:
        told.set_verbosity(shown)
        if bar:
            told.enable_progress_bar()
    if missing := sorted(found["missing_keys"]):
        raise InputError(f"weights {path} (no '{missing[0]}' in them)", "the whole network", _REMEDY)
    return model


def _beside(path: Path, sizes: Sizes) -> _Config:
    """Return what the configuration beside the weights says, if there is one."""
    file = path.with_name("config.json")
    if not file.is_file():
        return _Config()
    tree = load_json(file, _REMEDY)
    tree = tree if isinstance(tree, dict) else {}
    due = {"patch_size": PATCH, "frequency_stride": STRIDE, "time_stride": STRIDE}
    for name, value in due.items():
        if tree.get(name, value) != value:
            raise InputError(f"{file} ({name} {tree[name]})", f"{name} {value}", _REMEDY)
    names = _Config.__dataclass_fields__
    more = from_tree(_Config, {name: tree[name] for name in names if name in tree}, str(file))
    if more.num_attention_heads < 0 or sizes.width % (more.num_attention_heads or HEAD):
        given = f"{file} ({more.num_attention_heads} heads of a width of {sizes.width})"
        raise InputError(given, "a number of heads that divides it", _REMEDY)
    return more


def _drawn(weights: Weights) -> Any:
    """Return a model in which nothing was learned: a baseline, and a stand-in for measuring speed.

    Matrices, tokens and positions are normal with a standard deviation of 0.02, biases zero, scales one.
    """
    torch, transformers = _libraries()
    model, stream = (
        transformers.ASTModel(_config(weights.sizes, _Config())),
        np.random.default_rng(weights.seed),
    )
    for name, tensor in model.named_parameters():
        if name.endswith("bias"):
            tensor.zero_()
        elif "layernorm" in name:
            tensor.fill_(1.0)
        else:
            tensor.copy_(torch.from_numpy(SPREAD * stream.standard_normal(tensor.shape, np.float32)))
    return model


def _sizes(path: Path) -> Sizes:
    """Return what the shapes in a file say; nothing but its header is read."""
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
    width, places = prod(shapes["embeddings.cls_token"]), prod(shapes["embeddings.position_embeddings"])
    inner = next(
        (
            prod(shape)
            for name, shape in shapes.items()
            if name.endswith(("mlp.fc1.bias", "intermediate.dense.bias"))
        ),
        0,
    )
    columns = (places // width - 2) // ROWS if width else 0
    if min(depth, inner, columns) < 1 or width % HEAD:
        given = f"weights {path} ({depth} layers of width {width}, {columns} patch columns)"
        raise InputError(given, f"layers of a multiple of {HEAD}", _REMEDY)
    return Sizes(depth=depth, width=width, inner=inner, columns=columns)


def _libraries() -> tuple[Any, Any]:
    try:
        import torch  # noqa: PLC0415
        import transformers  # noqa: PLC0415
    except ImportError as error:
        given = f"the transformer ({error.name} is not installed)"
        raise InputError(given, "PyTorch and transformers", "pip install 'monochord[encoders]'") from error
    return torch, transformers
