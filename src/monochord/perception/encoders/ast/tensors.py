"""The transformer's weights by our own names: which there are, adapted to a length, or drawn at random."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.patches import PATCH, ROWS, columns_of

HEAD = 64
"""Width of one attention head; there are width / 64 of them."""
DEPTH, WIDTH, COLUMNS = 12, 768, 101
"""Layers, width and patch columns of the published network (AST-base, 1024 frames)."""
SPREAD = 0.02
"""Standard deviation of what is drawn, as such networks begin their training with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AstWeights:
    """The frozen network's numbers.

    `tensors` are float32 by name, as `shapes` lists them. `sum` is the SHA-256 of their file, or says which
    draw they are; `random` tells that nothing was ever learned in them.
    """

    tensors: Mapping[str, Audio]
    sum: str
    random: bool = False

    @property
    def depth(self) -> int:
        """Number of layers."""
        return sum(name.endswith(".qkv.bias") for name in self.tensors)

    @property
    def width(self) -> int:
        """Numbers in a token."""
        return self.tensors["cls"].size

    @property
    def label(self) -> str:
        """What the columns of a feature made with them are marked with.

        Examples
        --------
        >>> random_weights(seed=3, depth=1, width=64, columns=9).label
        'random(3)'
        """
        return self.sum if self.random else self.sum[:8]


def shapes(*, depth: int, width: int, columns: int) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Yield name and shape of every tensor of a network, for spectrograms of so many patch columns.

    Examples
    --------
    >>> dict(shapes(depth=12, width=768, columns=101))["positions"]
    (1214, 768)
    """
    yield "patch.weight", (width, PATCH * PATCH)
    yield "patch.bias", (width,)
    yield "cls", (width,)
    yield "distillation", (width,)
    yield "positions", (2 + ROWS * columns, width)
    for layer in range(depth):
        for part, (out, into) in {
            "qkv": (3 * width, width),
            "out": (width, width),
            "up": (4 * width, width),
            "down": (width, 4 * width),
        }.items():
            yield f"layers.{layer}.{part}.weight", (out, into)
            yield f"layers.{layer}.{part}.bias", (out,)
        for part in ("before", "after"):
            yield f"layers.{layer}.{part}.weight", (width,)
            yield f"layers.{layer}.{part}.bias", (width,)
    yield "final.weight", (width,)
    yield "final.bias", (width,)


def random_weights(
    *, seed: int, depth: int = DEPTH, width: int = WIDTH, columns: int = COLUMNS
) -> AstWeights:
    """Return weights that nothing was learned in: a baseline, and a stand-in for measuring speed.

    Matrices, tokens and positions are normal with a standard deviation of 0.02, biases zero, scales one.

    Raises
    ------
    InputError
        If the width is not a whole number of heads, or there is no layer.

    Examples
    --------
    >>> random_weights(seed=0, depth=2, width=64, columns=9).tensors["cls"].shape
    (64,)
    """
    if depth < 1 or width < HEAD or width % HEAD:
        raise InputError(f"{depth} layers of width {width}", f"1 or more, of a multiple of {HEAD}")
    stream = np.random.default_rng(seed)
    tensors: dict[str, Audio] = {}
    for name, shape in shapes(depth=depth, width=width, columns=columns):
        if name.endswith(".bias"):
            tensors[name] = np.zeros(shape, np.float32)
        elif len(shape) == 1 and name.endswith(".weight"):
            tensors[name] = np.ones(shape, np.float32)
        else:
            tensors[name] = SPREAD * stream.standard_normal(shape, np.float32)
    return AstWeights(tensors=tensors, sum=f"random({seed})", random=True)


def cropped(weights: AstWeights, frames: int) -> AstWeights:
    """Return weights whose positions fit spectrograms of so many frames.

    The positions of the patches are seen as a field of 12 rows (frequency) and as many columns (time) as
    there were in training, of which the middle ones are taken; those of the two first tokens stay. So the
    original authors have it for shorter sounds.

    Raises
    ------
    InputError
        If the network has seen no sound so long.

    Examples
    --------
    >>> whole = random_weights(seed=0, depth=1, width=64)
    >>> whole.tensors["positions"].shape, cropped(whole, 100).tensors["positions"].shape
    ((1214, 64), (110, 64))
    """
    positions = weights.tensors["positions"]
    field = positions[2:].reshape(ROWS, -1, weights.width)
    own, wanted = field.shape[1], columns_of(frames)
    if wanted > own:
        most = PATCH + 10 * own - 1
        raise InputError(f"a spectrogram of {frames} frames", f"{most} frames or fewer with these weights")
    first = own // 2 - wanted // 2
    middle = field[:, first : first + wanted].reshape(-1, weights.width)
    fitting = np.concatenate([positions[:2], middle])
    return replace(weights, tensors={**weights.tensors, "positions": fitting})
