"""Names that have moved lead to a study, and a study's figure is drawn by its command."""

import sys
from pathlib import Path

import pytest
from studies._command import draw
from studies.taps import LATE, DelayedTaps
from studies.touch import Touch

from monochord.benchmarks import BENCHMARKS
from monochord.cli._moved import MOVED
from monochord.figures import FIGURES

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.mark.parametrize("kind", MOVED)
def test_every_moved_name_leads_to_a_study(kind: str) -> None:
    assert not [study for study in MOVED[kind].values() if not (STUDIES / f"{study}.py").is_file()]


def test_what_has_moved_is_not_in_the_package_too() -> None:
    assert not MOVED["figure"].keys() & {*FIGURES.names()}
    assert not MOVED["benchmark"].keys() & {*BENCHMARKS.names()}


def test_numbers_of_a_figure_without_any_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    files = ["--out", str(tmp_path / "a.png"), "--json", str(tmp_path / "a.json")]
    monkeypatch.setattr(sys, "argv", ["touch", *files])
    with pytest.raises(SystemExit, match="2"):
        draw(Touch)
    assert "--json" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_figure_of_delayed_taps_tells_their_delays() -> None:
    told = [text.get_text() for axes in DelayedTaps().draw().axes for text in axes.texts]
    delays = [1e-3 * float(text.split()[0]) for text in told]
    assert delays == pytest.approx([LATE["audio"][0], LATE["pose"][0]], abs=1e-3)
