from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from monochord.core.types import Audio
from monochord.perception.encoders.ast.export import export
from monochord.perception.encoders.ast.on_onnx import OnOnnx
from monochord.perception.encoders.ast.patches import patches_of
from monochord.perception.encoders.ast.reading import read_weights

onnx = pytest.importorskip("onnx", reason="onnx is not installed")
runtime = pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed")


@pytest.mark.parametrize("int8", [False, True])
def test_another_program_gets_the_same_from_the_file(
    file: Path, tmp_path: Path, energies: Audio, *, int8: bool
) -> None:
    made = tmp_path / "ast.onnx"
    export(str(file), made, int8=int8)
    session = runtime.InferenceSession(made, providers=["CPUExecutionProvider"])
    told = session.run(None, {"patches": patches_of(energies)})[0]
    ours = OnOnnx(read_weights(str(file)), frames=100, int8=int8)(energies)
    assert np.allclose(told, ours, atol=1e-5)


def test_the_file_says_which_weights_it_was_made_of(file: Path, tmp_path: Path) -> None:
    export(str(file), tmp_path / "ast.onnx", frames=50)
    properties = {p.key: p.value for p in onnx.load(tmp_path / "ast.onnx").metadata_props}
    assert properties == {"weights": sha256(file.read_bytes()).hexdigest(), "random": "false"}
