"""What is exported in a whole form and imported again is the same session, to the bit."""

import json
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.sessions import read_session
from monochord.sessions.exports import EXPORTS

Write = Callable[..., Path]
Same = Callable[[Path, Path], None]
FORMS = ("wav_csv", "parquet")


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_a_round_trip_loses_nothing(write_random: Write, assert_same: Same, form: str, seed: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        take = write_random(folder / "take.mcap", seed)
        EXPORTS.build(form).write([read_session(take)], folder / "out")
        EXPORTS.build(form).read(folder / "out" / "take", folder / "again.mcap")
        assert_same(take, folder / "again.mcap")


@pytest.mark.parametrize("form", FORMS)
def test_a_session_that_was_cut_off_keeps_what_it_has(
    write_random: Write, assert_same: Same, tmp_path: Path, form: str
) -> None:
    take = write_random(tmp_path / "take.mcap", 5, close=False)
    EXPORTS.build(form).write([read_session(take)], tmp_path / "out")
    assert json.loads((tmp_path / "out/take/session.json").read_text())["complete"] is False
    EXPORTS.build(form).read(tmp_path / "out" / "take", tmp_path / "again.mcap")
    assert_same(take, tmp_path / "again.mcap")
