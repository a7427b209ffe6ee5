"""The file's 8-bit weights come out in their places, scaled; another file is refused in one line."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.encoders.yamnet import Yamnet, load_yamnet
from monochord.perception.encoders.yamnet.reading import parse

INT32, INT8 = 2, 9


class Model:
    """A file of TensorFlow Lite written with Google's own writer, as far as `parse` reads one."""

    def __init__(self) -> None:
        flatbuffers: Any = pytest.importorskip("flatbuffers", reason="comes with onnxruntime")
        self.builder = flatbuffers.Builder(0)

    def table(self, fields: dict[int, tuple[str, Any]]) -> int:
        self.builder.StartObject(8)
        for number, (kind, value) in fields.items():
            if kind == "at":
                self.builder.PrependUOffsetTRelativeSlot(number, value, 0)
            else:
                getattr(self.builder, f"Prepend{kind}Slot")(number, value, 0)
        return self.builder.EndObject()

    def vector(self, places: Sequence[int]) -> int:
        self.builder.StartVector(4, len(places), 4)
        for place in reversed(places):
            self.builder.PrependUOffsetTRelative(place)
        return self.builder.EndVector()

    def numbers(self, values: Any, kind: str) -> int:
        return self.builder.CreateNumpyVector(np.asarray(values, kind).reshape(-1))


def written(operators: Sequence[tuple[int, int, Any, Any, int]]) -> bytes:
    """Operators as (kind, stride, kernel with scales, bias with scales, the dimension that they go along)."""
    model = Model()
    kinds = sorted({kind for kind, *_ in operators})
    codes = [model.table({3: ("Int32", kind)}) for kind in kinds]
    buffers, tensors, steps = [model.table({})], [model.table({})], []
    for kind, stride, kernel, bias, along in operators:
        for (values, scales), stored, dimension in ((kernel, INT8, along), (bias, INT32, 0)):
            data = values.astype("<i4" if stored == INT32 else "i1")
            buffers.append(model.table({0: ("at", model.numbers(data.view(np.uint8), "u1"))}))
            zero = model.numbers(np.zeros(len(scales)), "<i8")
            scale = model.numbers(scales, "<f4")
            fields = {2: ("at", scale), 3: ("at", zero), 6: ("Int32", dimension)}
            quantised = model.table(fields)
            shape = model.numbers(values.shape, "<i4")
            tensors.append(
                model.table(
                    {
                        0: ("at", shape),
                        1: ("Int8", stored),
                        2: ("Uint32", len(buffers) - 1),
                        4: ("at", quantised),
                    }
                )
            )
        inputs = model.numbers([0, len(tensors) - 2, len(tensors) - 1], "<i4")
        options = model.table({1: ("Int32", stride)})
        steps.append(model.table({0: ("Uint32", kinds.index(kind)), 1: ("at", inputs), 4: ("at", options)}))
    graph = model.table({0: ("at", model.vector(tensors)), 3: ("at", model.vector(steps))})
    fields = {
        1: ("at", model.vector(codes)),
        2: ("at", model.vector([graph])),
        4: ("at", model.vector(buffers)),
    }
    model.builder.Finish(model.table(fields), b"TFL3")
    return bytes(model.builder.Output())


def test_weights_come_out_scaled_and_in_their_places() -> None:
    stream = np.random.default_rng(0)
    first, mixes, dense = (
        stream.integers(-127, 128, shape) for shape in ((4, 3, 3, 1), (5, 1, 1, 4), (7, 5))
    )
    each = stream.integers(-127, 128, (1, 3, 3, 4))
    four, five = np.array([1.0, 2.0, 4.0, 0.5]), np.array([1.0, 0.25, 2.0, 8.0, 1.0])
    whole = stream.integers(-(10**6), 10**6, 7)
    network = parse(
        written(
            [
                (3, 2, (first, four), (whole[:4], four), 0),
                (4, 1, (each, four), (whole[:4], four), 3),
                (3, 1, (mixes, five), (whole[:5], five), 0),
                (9, 0, (dense, [0.5]), (whole, [0.25]), 0),
            ]
        )
    )
    one, two, three = network.convolutions
    np.testing.assert_array_equal(one.kernel, first.reshape(4, 9).T * four)
    np.testing.assert_array_equal(one.bias, whole[:4] * four)
    np.testing.assert_array_equal(two.kernel, each[0] * four)
    np.testing.assert_array_equal(three.kernel, mixes.reshape(5, 4).T * five)
    assert [layer.stride for layer in network.convolutions] == [2, 1, 1]
    np.testing.assert_array_equal(network.kinds, 0.5 * dense.T)
    np.testing.assert_array_equal(network.kinds_bias, 0.25 * whole)
    assert one.kernel.dtype == network.kinds.dtype == np.float32


def test_the_real_file_has_the_networks_form(real: Yamnet, by_chance: Yamnet) -> None:
    for ours, theirs in zip(by_chance.convolutions, real.convolutions, strict=True):
        assert (ours.kernel.shape, ours.bias.shape) == (theirs.kernel.shape, theirs.bias.shape)
        assert ours.stride == theirs.stride
    assert (real.kinds.shape, real.kinds_bias.shape) == ((1024, 521), (521,))


def test_another_file_and_none_are_refused_in_one_line(tmp_path: Path) -> None:
    other = tmp_path / "yamnet.tflite"
    with pytest.raises(InputError, match=r"not there.*weights get yamnet.*MONOCHORD_YAMNET"):
        load_yamnet(str(other))
    other.write_bytes(b"TFL3")
    with pytest.raises(InputError, match=r"with SHA-256 .*allowed is 0a266465c467"):
        load_yamnet(str(other))
