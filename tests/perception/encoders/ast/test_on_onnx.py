import sys

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.on_onnx import OnOnnx
from monochord.perception.encoders.ast.on_torch import OnTorch
from monochord.perception.encoders.ast.tensors import AstWeights

pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")
pytest.importorskip("onnx", reason="onnx is not installed")


@pytest.fixture
def told(small: AstWeights, energies: Audio) -> Audio:
    pytest.importorskip("torch", reason="PyTorch is not installed")
    return OnTorch(small, frames=100)(energies)


def test_it_says_what_pytorch_says(small: AstWeights, energies: Audio, told: Audio) -> None:
    assert np.abs(OnOnnx(small, frames=100)(energies) - told).max() < 1e-4


def test_int8_says_nearly_that(small: AstWeights, energies: Audio, told: Audio) -> None:
    near = OnOnnx(small, frames=100, int8=True)(energies)
    assert 1e-6 < np.abs(near - told).max() < 0.1
    for one, other in zip(near, told, strict=True):
        assert one @ other > 0.9999 * np.linalg.norm(one) * np.linalg.norm(other)


@pytest.mark.parametrize("int8", [False, True])
def test_the_same_bits_each_time(small: AstWeights, energies: Audio, *, int8: bool) -> None:
    embed = OnOnnx(small, frames=100, int8=int8)
    first = embed(energies)
    embed(10.0 * energies)
    assert np.array_equal(embed(energies), first)


def test_one_microphone_alone_says_the_same(small: AstWeights, energies: Audio) -> None:
    embed = OnOnnx(small, frames=100)
    assert np.allclose(embed(energies[:1]), embed(energies)[:1], atol=1e-5)


def test_without_onnx_runtime_it_says_what_to_install(
    small: AstWeights, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(InputError, match=r"monochord\[encoders\]"):
        OnOnnx(small, frames=100)
