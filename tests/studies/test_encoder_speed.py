"""The benchmark of encoders, kept short."""

from functools import partial
from typing import Any

import pytest
from studies.encoder_speed import Encoders

from monochord.core.errors import InputError
from monochord_encoders import ast
from monochord_encoders.network import Sizes, Weights


@pytest.mark.slow
def test_every_way_stands_beside_the_spectrogram(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("transformers", reason="transformers is not installed")
    few_layers = Sizes(depth=2, width=768, inner=3072, columns=9)
    monkeypatch.setattr(ast, "Weights", partial(Weights, sizes=few_layers))
    encoders = Encoders(windows=2, window=0.05, variants=("ast_torch",))
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


@pytest.mark.parametrize("options", [{"windows": 0}, {"window": 0.001}, {"variants": ("ast_torh",)}])
def test_options_that_cannot_be_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Encoders(**options)
