import sys

import pytest

from monochord.core.errors import InputError
from monochord.perception.encoders.ast.graph import graph_of
from monochord.perception.encoders.ast.tensors import AstWeights


@pytest.mark.parametrize("int8", [False, True])
def test_the_graph_is_valid_and_says_what_it_was_made_of(small: AstWeights, *, int8: bool) -> None:
    onnx = pytest.importorskip("onnx", reason="onnx is not installed")
    model = onnx.load_from_string(graph_of(small, frames=100, int8=int8))
    onnx.checker.check_model(model, full_check=True)
    assert {entry.key: entry.value for entry in model.metadata_props} == {
        "weights": "random(1)",
        "random": "true",
    }
    kinds = {node.op_type for node in model.graph.node}
    assert ("MatMulInteger" in kinds) == int8


def test_int8_is_smaller(small: AstWeights) -> None:
    pytest.importorskip("onnx", reason="onnx is not installed")
    assert len(graph_of(small, frames=100, int8=True)) < 0.5 * len(graph_of(small, frames=100))


def test_without_onnx_it_says_what_to_install(small: AstWeights, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(InputError, match=r"monochord\[encoders\]"):
        graph_of(small, frames=100)
