"""Each engine gives what PyTorch gives, from a file that is made once."""

import sys
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.engines import FORMS, Backend, engine_of, export, onnx_file
from monochord.perception.encoders.ast.network import Weights, find

for needed in ("torch", "transformers"):
    pytest.importorskip(needed, reason=f"{needed} is not installed")
pytestmark = pytest.mark.timeout(400)  # an export takes its time on a busy machine
NEEDED = {"onnx": "onnxruntime", "int8": "onnxruntime", "openvino": "openvino"}
OFF = {"onnx": 1e-5, "int8": 0.05, "openvino": 0.05}
"""Root mean square of the difference, of that of the embedding."""


def off(found: Audio, told: Audio) -> float:
    return float(np.sqrt(np.mean((found - told) ** 2) / np.mean(told**2)))


@pytest.fixture
def weights(file: Path) -> Weights:
    return find(str(file))


@pytest.fixture
def told(weights: Weights, energies: Audio) -> Audio:
    return engine_of(weights, frames=100, backend="torch")(energies)


@pytest.fixture(params=["onnx", "int8", "openvino"])
def backend(request: pytest.FixtureRequest) -> Backend:
    for name in ("onnx", "onnxscript", "onnxruntime", NEEDED[request.param]):
        pytest.importorskip(name, reason=f"{name} is not installed")
    return request.param


def test_it_says_what_pytorch_says_each_time_and_of_one_microphone(
    weights: Weights, energies: Audio, told: Audio, backend: Backend
) -> None:
    embed = engine_of(weights, frames=100, backend=backend)
    first = embed(energies)
    assert off(first, told) < OFF[backend]
    for one, other in zip(first, told, strict=True):
        assert one @ other > 0.999 * np.linalg.norm(one) * np.linalg.norm(other)
    if backend != "onnx":
        assert off(first, told) > 1e-4, "nothing was quantised"
    embed(10.0 * energies)
    assert np.array_equal(embed(energies), first)
    assert off(embed(energies[:1]), told[:1]) < OFF[backend]


def test_the_file_is_made_once_and_anew_where_it_is_damaged(
    weights: Weights, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    file = onnx_file(weights, 100, "float32")
    made = file.read_bytes()
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "torch", None)
        assert onnx_file(weights, 100, "float32") == file
    file.write_bytes(made[:-5000] + bytes([made[-5000] ^ 1]) + made[-4999:])
    onnx_file(weights, 100, "float32")
    assert file.read_bytes()[-5000] == made[-5000]
    assert sorted(each.suffix for each in file.parent.glob(f"{file.stem}*")) == [".onnx", ".sha256"]


def test_another_program_gets_the_same_from_the_exported_file(
    file: Path, tmp_path: Path, energies: Audio, told: Audio
) -> None:
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    runtime = pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")
    pytest.importorskip("onnxscript", reason="onnxscript is not installed")
    export(str(file), tmp_path / "ast.onnx")
    session = runtime.InferenceSession(tmp_path / "ast.onnx", providers=["CPUExecutionProvider"])
    assert np.allclose(session.run(None, {"energies": energies})[0], told, atol=1e-4)
    properties = {one.key: one.value for one in onnx.load(tmp_path / "ast.onnx").metadata_props}
    assert (properties["weights"], properties["random"]) == (find(str(file)).sum, "false")


def test_a_device_that_is_not_there_is_told_of(weights: Weights) -> None:
    import torch

    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    with pytest.raises(DeviceError, match="no device 'cuda' for the encoder") as caught:
        engine_of(weights, frames=100, backend="cuda")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", FORMS)
def test_without_its_library_a_backend_says_what_to_install(
    weights: Weights, name: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, NEEDED[name], None)
    with pytest.raises(InputError, match=r"pip install 'monochord\["):
        engine_of(weights, frames=100, backend=name)
