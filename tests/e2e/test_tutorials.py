"""The tutorial of one's own model and its notebook, followed to their end."""

import json
import os
import re
import sys
from pathlib import Path

import pytest
from tests.e2e.printed import missing_lines, outputs
from tests.e2e.test_readme import BLOCK

import monochord as mc

ROOT = Path(__file__).parents[2]
SHOWS = "from IPython.display import "
"""What a cell says that shows a picture or a report."""
FRAME = """from html import escape
from pathlib import Path

from IPython.display import HTML

report = escape(Path("{}/report.html").read_text())
HTML(f'<iframe srcdoc="{{report}}" width="100%" height="600"></iframe>')"""
TUTORIAL = ROOT / "docs" / "tutorial" / "own-model.md"


def blocks(page: Path) -> list[tuple[str, str]]:
    """The commands and programs of a page, in order: language and text."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(kind, text.strip()) for kind, text, _ in found if kind]


def cells_of(kind: str, text: str) -> list[str]:
    """The cells of a block: itself, and one for each picture and report that its commands draw."""
    shown = [f'{SHOWS}Image\n\nImage("{name}")' for name in re.findall(r"--figure (\S+\.png)", text)]
    shown += [
        FRAME.format(name) for name in re.findall(r"^monochord evaluate .*--out (\S+)", text, re.MULTILINE)
    ]
    return [f"%%sh\n{text}" if kind == "sh" else text, *shown]


def test_the_notebook_has_the_blocks_of_its_page() -> None:
    notebook = json.loads(TUTORIAL.with_suffix(".ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    expected = [cell for kind, text in blocks(TUTORIAL) for cell in cells_of(kind, text)]
    assert cells == expected, "make docs writes the notebook anew"
    assert sum(SHOWS in cell for cell in cells) == 2


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_notebook_ends_with_a_model_that_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    for name in ("ipykernel", "torch", "matplotlib"):
        pytest.importorskip(name)
    script = tmp_path / "bin" / "monochord"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nexec {sys.executable} -m monochord "$@"\n', encoding="utf-8")
    script.chmod(0o755)
    monkeypatch.setenv("PATH", os.pathsep.join([str(script.parent), os.environ["PATH"]]))
    notebook = nbformat.read(TUTORIAL.with_suffix(".ipynb"), as_version=4)
    nbclient.NotebookClient(notebook, timeout=900, resources={"metadata": {"path": tmp_path}}).execute()

    report = json.loads((tmp_path / "report" / "scores.json").read_text(encoding="utf-8"))
    rows = {row["object"]: row for row in report["table"] if row["state"] == "touched"}
    assert {"plastic", "wood"} <= rows.keys()
    assert rows["wood"]["position"]["mae"]["value"] < 0.5e-3
    assert rows["plastic"]["position"]["answered"] > 0.7
    assert rows["plastic"]["force"]["mae"]["value"] < 0.25
    assert mc.load_dataset(tmp_path / "dataset").split.held_out == ("wood",)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    for cell in code:
        if SHOWS in cell.source:
            data = cell.outputs[-1]["data"]
            assert "image/png" in data or data["text/html"].count("data:image/svg") >= 3
    printed = {cell.source: "".join(out.get("text", "") for out in cell.outputs) for cell in code}
    said = outputs(TUTORIAL.read_text(encoding="utf-8"))
    assert said
    for before, text in said.items():
        (shown,) = (printed[source] for source in printed if source.endswith(before.strip()))
        assert missing_lines(text, shown) == [], shown
    place, _ = printed[code[-1].source].split(" and ")
    assert float(place.split()[0]) == pytest.approx(90.0, abs=1.0)
