"""The transformer as an ONNX graph, in float32 or with its large products in int8."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.patches import PATCH, ROWS, columns_of
from monochord.perception.encoders.ast.tensors import HEAD, AstWeights, cropped

EPSILON = 1e-12
OPSET = 20
"""Version of ONNX's operators: the first with Gelu."""
IR = 10
LARGEST = 64.0
"""Of a quantised weight: two products of such with 255 add up within 16 bits, which processors without 8-bit
dot products saturate at, so that all give the same numbers."""


def graph_of(weights: AstWeights, *, frames: int, int8: bool = False) -> bytes:
    """Return the network as an ONNX model: ``patches`` (2, patches, 256) to ``embedding`` (2, 2 width).

    The embedding is the mean over all patches, then the maximum, as `OnTorch` has them. In int8 the four
    large products of each layer are: weights to -64..64, each output with its own scale; what they are
    multiplied with to 0..255 with the scale and zero of the moment (dynamic quantisation).

    Parameters
    ----------
    weights
        As read; their positions are cropped to fit.
    frames
        Of a spectrogram.
    int8
        Whether to quantise.

    Raises
    ------
    InputError
        If the onnx library is not installed, or the spectrogram's length does not suit the weights.

    Examples
    --------
    >>> from monochord.perception.encoders.ast.tensors import random_weights
    >>> len(graph_of(random_weights(seed=0, depth=1, width=64), frames=100)) > 4 * 64 * 256
    True
    """
    return _Writer(cropped(weights, frames), int8=int8).model(ROWS * columns_of(frames)).SerializeToString()


class _Writer:
    """Nodes and numbers of a graph as it is written; a value is known by its name."""

    def __init__(self, weights: AstWeights, *, int8: bool) -> None:
        try:
            import onnx  # noqa: PLC0415
        except ImportError as error:
            given = "an ONNX graph of the encoder (onnx is not installed)"
            raise InputError(given, "the backend torch", "pip install 'monochord[encoders]'") from error
        self._onnx, self._weights, self._int8 = onnx, weights, int8
        self._nodes: list[Any] = []
        self._numbers: list[Any] = []

    def model(self, patches: int) -> Any:
        onnx, weights = self._onnx, self._weights
        tokens, width = 2 + patches, weights.width
        seen = self._linear("patches", "patch", small=True)
        first = np.stack([weights.tensors["cls"], weights.tensors["distillation"]])
        both = self._number("first", np.stack([first, first]))
        state = self._node("Add", [self._node("Concat", [both, seen], axis=1), self._known("positions")])
        for layer in range(weights.depth):
            name = f"layers.{layer}"
            told = self._attended(name, self._even(state, f"{name}.before"), tokens)
            state = self._node("Add", [state, told])
            up = self._node("Gelu", [self._linear(self._even(state, f"{name}.after"), f"{name}.up")])
            state = self._node("Add", [state, self._linear(up, f"{name}.down")])
        ends = [self._number(f"slice.{i}", np.array([value])) for i, value in enumerate((2, tokens, 1))]
        kept = self._node("Slice", [self._even(state, "final"), *ends])
        over = self._number("over", np.array([1]))
        pooled = [self._node(how, [kept, over], keepdims=0) for how in ("ReduceMean", "ReduceMax")]
        self._node("Concat", pooled, output="embedding", axis=1)
        value, kind = onnx.helper.make_tensor_value_info, onnx.TensorProto.FLOAT
        graph = onnx.helper.make_graph(
            self._nodes,
            "audio spectrogram transformer",
            [value("patches", kind, [2, patches, PATCH * PATCH])],
            [value("embedding", kind, [2, 2 * width])],
            self._numbers,
        )
        opset = [onnx.helper.make_opsetid("", OPSET)]
        model = onnx.helper.make_model(graph, opset_imports=opset, ir_version=IR, producer_name="monochord")
        onnx.helper.set_model_props(model, {"weights": weights.sum, "random": str(weights.random).lower()})
        return model

    def _attended(self, name: str, state: str, tokens: int) -> str:
        heads = self._weights.width // HEAD
        split = self._number(f"{name}.split", np.array([2, tokens, 3, heads, HEAD]))
        qkv = self._node("Reshape", [self._linear(state, f"{name}.qkv"), split])
        turned = self._node("Transpose", [qkv], perm=[2, 0, 3, 1, 4])
        parts = self._node("Split", [turned], count=3, axis=0, num_outputs=3)
        lead = self._number(f"{name}.lead", np.array([0]))
        query, key, value = (self._node("Squeeze", [part, lead]) for part in parts.split())
        scale = self._number(f"{name}.scale", np.array(HEAD**-0.5, np.float32))
        across = self._node("Transpose", [key], perm=[0, 1, 3, 2])
        likeness = self._node("MatMul", [self._node("Mul", [query, scale]), across])
        mixed = self._node("MatMul", [self._node("Softmax", [likeness], axis=-1), value])
        joined = self._number(f"{name}.joined", np.array([2, tokens, self._weights.width]))
        flat = self._node("Reshape", [self._node("Transpose", [mixed], perm=[0, 2, 1, 3]), joined])
        return self._linear(flat, f"{name}.out")

    def _linear(self, state: str, name: str, *, small: bool = False) -> str:
        matrix = np.ascontiguousarray(self._weights.tensors[f"{name}.weight"].T)
        if self._int8 and not small:
            product = self._quantised(state, name, matrix)
        else:
            product = self._node("MatMul", [state, self._number(f"{name}.weight", matrix)])
        return self._node("Add", [product, self._known(f"{name}.bias")])

    def _quantised(self, state: str, name: str, matrix: Audio) -> str:
        scale = np.maximum(np.abs(matrix).max(axis=0), np.float32(1e-12)) / np.float32(LARGEST)
        whole = self._number(f"{name}.weight", np.rint(matrix / scale).astype(np.int8))
        zero = self._number(f"{name}.zero", np.zeros(scale.shape, np.int8))
        small = self._node("DynamicQuantizeLinear", [state], count=3)
        values, own, shift = small.split()
        product = self._node("MatMulInteger", [values, whole, shift, zero])
        plain = self._node("Cast", [product], to=self._onnx.TensorProto.FLOAT)
        return self._node("Mul", [plain, self._node("Mul", [own, self._number(f"{name}.scale", scale)])])

    def _even(self, state: str, name: str) -> str:
        numbers = [self._known(f"{name}.weight"), self._known(f"{name}.bias")]
        return self._node("LayerNormalization", [state, *numbers], axis=-1, epsilon=EPSILON)

    def _known(self, name: str) -> str:
        return self._number(name, self._weights.tensors[name])

    def _number(self, name: str, value: Mapping[str, Audio] | Any) -> str:
        self._numbers.append(self._onnx.numpy_helper.from_array(np.asarray(value), name))
        return name

    def _node(self, kind: str, inputs: list[str], *, count: int = 1, output: str = "", **more: Any) -> str:
        """Add a node and return the name of what it gives, several names with blanks between."""
        names = [output or f"{kind}.{len(self._nodes)}.{i}" for i in range(count)]
        self._nodes.append(self._onnx.helper.make_node(kind, inputs, names, **more))
        return " ".join(names)
