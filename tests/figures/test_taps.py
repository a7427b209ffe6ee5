"""The taps figure: its numbers are the offsets that were put in, and it draws any session with taps."""

import json
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.figures._tapped import tapped
from monochord.figures.taps import LATE, Taps


def test_its_numbers_are_the_offsets_that_were_put_in() -> None:
    told = json.loads(json.dumps(Taps().numbers()))
    assert told["reference"] == "wrench"
    assert told["flags"] == []
    for stream, width in (("audio", 0.5e-3), ("pose", 4e-3)):
        for found, late in zip(told[stream]["offsets"], LATE[stream], strict=True):
            assert found == pytest.approx(late, abs=width)
        assert told[stream]["taps"][0] >= 4


def test_it_draws_each_stream_before_and_after(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    tapped(groups=(1.5,), seconds=5.0).write(path)
    page = Taps(session=str(path), tap=2).draw()
    assert len(page.axes) == 6
    for axes in page.axes:
        assert any(len(line.get_xdata()) > 10 for line in axes.get_lines())  # pyright: ignore[reportArgumentType]
    page.savefig(tmp_path / "taps.png")
    with pytest.raises(InputError, match="tap 5: allowed is 0 to 4"):
        Taps(session=str(path), tap=5).draw()


def test_a_session_that_has_no_taps_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    tapped(groups=(), seconds=2.0).write(path)
    with pytest.raises(InputError, match="there are no taps in wrench"):
        Taps(session=str(path)).draw()


def test_what_cannot_be_shown_is_refused() -> None:
    with pytest.raises(InputError, match="tap -1"):
        Taps(tap=-1)
