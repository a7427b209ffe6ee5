"""The tutorial of one's own model, its notebook, and the guide of bringing up, followed to their end."""

import csv
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.contract.test_documents import command_lines
from tests.e2e.conftest import MONOCHORD
from tests.e2e.test_readme import BLOCK

import monochord as mc

ROOT = Path(__file__).parents[2]
TUTORIAL = ROOT / "docs" / "tutorial" / "own-model.md"
BRING_UP = ROOT / "docs" / "how-to" / "bring-up.md"


def blocks(page: Path) -> list[tuple[str, str]]:
    """The commands and programs of a page, in order: language and text."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(kind, text.strip()) for kind, text, _ in found if kind]


def test_the_notebook_has_the_blocks_of_its_page() -> None:
    notebook = json.loads(TUTORIAL.with_suffix(".ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    expected = [f"%%sh\n{text}" if kind == "sh" else text for kind, text in blocks(TUTORIAL)]
    assert cells == expected, "make docs writes the notebook anew"


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
    printed = "".join(out.get("text", "") for out in notebook.cells[-2].get("outputs", ()))
    place, _ = printed.split(" and ")
    assert float(place.split()[0]) == pytest.approx(80.0, abs=1.0)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_the_bring_up_guide_is_followed_with_the_virtual_sensor(tmp_path: Path) -> None:
    """Each command as it stands, on the twin in place of JACK; a ruler's readings are the model's own."""
    guide = [words for words in command_lines(BRING_UP.read_text(encoding="utf-8")) if words != ["doctor"]]
    verbs = [words[1] if words[0] == "sessions" else words[0] for words in guide]
    assert verbs == ["doctor", "tune", "live", "record", "touches", "import", "calibrate", "live"]
    for words in guide:
        line = ["twin" if word == "jack" else word for word in words]
        line = ["jsonl=live.jsonl" if word == "web" else word for word in line]
        line += ["--yes"] if "doctor" in line else []
        if "--seconds" in line:
            line[line.index("--seconds") + 1] = "30" if "record" in line else "3"
        run = subprocess.run(
            [MONOCHORD, *line],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )
        assert run.returncode == 0, f"{shlex.join(line)}\n{run.stderr}"
        if "touches" in line:
            _measure(tmp_path / "touches.csv", tmp_path / "take.mcap")
    assert (tmp_path / "mine.html").stat().st_size > 10_000
    assert mc.load(tmp_path / "mine").definition.string is not None


def _measure(table: Path, take: Path) -> None:
    """Fill in position and force, as a person with ruler and scale does."""
    updates = list(mc.listen(take, "demo"))
    with table.open(newline="", encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    assert rows
    known: list[dict[str, str]] = []
    for row in rows:
        within = [each for each in updates if float(row["begin"]) < each.time < float(row["end"])]
        read = {
            name: np.median(
                [value.value for each in within if (value := each.estimate(name)).valid] or [np.nan]
            )
            for name in ("position", "force")
        }
        if np.isfinite(list(read.values())).all():
            known.append(row | {name: f"{value:.4f}" for name, value in read.items()})
    with table.open("w", newline="", encoding="utf-8") as lines:
        writer = csv.DictWriter(lines, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(known)
