from functools import partial
from typing import Any

import pytest
from studies.encoder_speed import Encoders

from monochord.core.errors import InputError
from monochord.perception.encoders.ast.network import Sizes, Weights
from monochord.perception.features import ast


def test_every_way_stands_beside_the_spectrogram(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("transformers", reason="transformers is not installed")
    three_layers = Sizes(depth=3, width=768, inner=3072, columns=9)
    monkeypatch.setattr(ast, "Weights", partial(Weights, sizes=three_layers))
    encoders = Encoders(windows=3, window=0.05, variants=("ast_torch",))
    rows = {row.name: row for row in encoders.run()}
    assert len(rows) == 2 * 4
    assert rows["log_mel, median"].ratio == 1.0
    slow = rows["ast_torch, median"].ratio
    assert slow is not None
    assert slow > 2.0, "a transformer costs more than its spectrogram"
    assert rows["ast_torch, p99"].value >= rows["ast_torch, median"].value
    assert rows["ast_torch, wall/audio"].baseline == "real time"


def test_what_is_not_there_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MONOCHORD_YAMNET", "/nowhere")
    rows = Encoders(windows=2, variants=("yamnet",)).run()
    assert {row.name.partition(",")[0] for row in rows} == {"log_mel"}


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"windows": 0}, "0 windows: allowed is 1 or more"),
        ({"window": 0.001}, r"window 0\.001 s: allowed is 0\.03 to 1 s"),
        ({"variants": ("ast_torh",)}, "did you mean 'ast_torch'"),
    ],
)
def test_options_that_cannot_be_are_refused(options: dict[str, Any], match: str) -> None:
    with pytest.raises(InputError, match=match):
        Encoders(**options)
