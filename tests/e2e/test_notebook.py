"""A session in a notebook: what objects show of themselves, as text, as HTML and as a plot."""

import re
import sys
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import monochord as mc
from monochord.core.errors import MissingLibraryError
from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.physics.strings import load_string


@pytest.fixture
def recorded(small: Path) -> Path:
    """A simulated session, as ``monochord collect`` makes it."""
    return small / "slide_000.mcap"


@pytest.fixture
def plt(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Pyplot, drawing into memory."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    from matplotlib import pyplot as plt

    plt.switch_backend("Agg")
    yield plt
    plt.close("all")


def cells(shown: Any) -> list[str]:
    """Return the texts of an object's table in a notebook; an HTML that is not well-formed fails."""
    root = ET.fromstring(shown._repr_html_())  # noqa: S314
    assert root.tag == "table"
    return [(cell.text or "") for cell in root.iter() if cell.tag in {"td", "th", "caption"}]


def test_a_model_shows_its_sensor_training_and_errors() -> None:
    model = mc.load("demo")
    text = repr(model)
    for fact in ("prototype", "200 mm", " sessions, simulated", "position (m)", "44100 Hz"):
        assert fact in text
    shown = cells(model)
    lines = dict(zip(shown[1::2], shown[2::2], strict=True))  # after the caption, name and text
    measured = model.definition.heads["position"].calibration.measured["coverage_1"]
    assert f"covers {100 * measured:.0f} % of errors" in lines["position"]
    assert "calibration error" in lines["contact"]


def test_a_session_shows_its_streams_length_and_what_touches(recorded: Path, plt: Any) -> None:
    session = mc.read_session(recorded)
    text = repr(session)
    assert "audio" not in vars(session)  # the sound itself is not read for it
    seconds = session.audio.samples.shape[1] / 44100
    assert session.length == seconds
    for fact in (
        f"{seconds:.2f} s",
        session.description.material,
        "simulated",
        "prototype",
        *session.streams,
    ):
        assert fact in text
    assert str(recorded) in cells(session)
    axes = session.plot()
    assert axes[0].get_ylabel() == "audio"
    assert len(axes[0].lines) == 2
    drawn = {each.get_ylabel(): [line.get_label() for line in each.lines] for each in axes}
    assert drawn["wrench (N)"] == ["fx", "fy", "fz"]
    assert drawn["pose (m)"] == ["x", "y", "z"]
    assert {"labels: position (mm)", "labels: force (N)"} <= set(drawn)
    plt.gcf().canvas.draw()


def test_a_dataset_shows_its_windows_sessions_and_labels(recorded: Path, tmp_path: Path) -> None:
    dataset = build_dataset([recorded], tmp_path / "dataset")
    split_dataset(dataset, by="time").write(dataset.path / "split.json")
    data = mc.load_dataset(dataset.path)
    text = repr(data)
    for fact in (f"{len(dataset)} of 100 ms", "1, simulated", "position", f"train {len(data.split.train)}"):
        assert fact in text
    assert f"train {len(data.split.train)}" in " ".join(cells(data))
    assert "split" not in repr(data.dataset)
    assert cells(data.dataset)[0] == "Dataset: dataset"


def test_predictions_are_a_table_and_a_plot(plt: Any) -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    twin.press(0.08, 1.0, material="plastic")
    table = mc.load("demo").predict(twin.advance(0.6)[0], sensor="prototype")
    shown = cells(table)
    assert {"51 windows", "position (mm)", "force (N)", "...", f"{table.time[-1]:.3f}"} <= set(shown)
    last = table.position[-1]
    assert f"{1e3 * last.value:.2f} \N{PLUS-MINUS SIGN} {1e3 * last.std:.2f}" in shown
    axes = table.plot()
    assert {each.get_ylabel() for each in axes} == {"contact", "slip", "position (mm)", "force (N)"}
    drawn = next(each for each in axes if each.get_ylabel() == "position (mm)").lines[0]
    assert np.array_equal(drawn.get_ydata(), 1e3 * table.position.value, equal_nan=True)
    plt.gcf().canvas.draw()


def test_a_simulated_sound_and_a_string_show_themselves(plt: Any) -> None:
    sound = mc.simulate("appendix", position=0.2275, force=0.0, route="modal")
    assert "227.5 mm" in repr(sound)
    assert "0.4 s of 2 microphones at 44100 Hz" in cells(sound)
    assert "nothing" in repr(mc.simulate("appendix", touched=False, route="modal", seconds=0.1))
    first, second = sound.plot()
    assert np.max(first.lines[0].get_ydata()) == np.max(sound.microphones[0])
    assert second.get_xlabel() == "time (s)"
    plt.gcf().canvas.draw()
    assert "65 N" in cells(load_string("appendix"))


def test_a_plot_without_matplotlib_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    sound = mc.simulate("appendix", route="modal", seconds=0.1)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingLibraryError, match=r"^A plot requires matplotlib .*pip install") as refusal:
        sound.plot()
    assert "\n" not in str(refusal.value)


CELLS = {
    "model": "import monochord as mc\nmodel = mc.load('demo')\nmodel",
    "work": """twin = ["groups=[{name='hold', sessions=3, grid=[2, 1], hold=0.3}]"]
sessions = mc.collect("quick", "sessions", settings=twin, workers=1)""",
    "session": "session = mc.read_session(sessions[0].path)\nsession",
    "plot": "session.plot();",
    "table": "table = model.predict(session.audio.samples, sensor='prototype')\ntable",
    "estimate": "mc.Estimate(value=0.0824, std=3e-4, unit='m')",
    "data": "mc.build(sessions, 'dataset')",
    "error": "mc.load_sensor('prototpye')",
}


@pytest.mark.slow
def test_a_real_notebook_shows_reprs_tables_a_plot_and_progress(tmp_path: Path) -> None:
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    states: list[str] = []

    class Client(nbclient.NotebookClient):
        """Remembers the states of the bar, as a front end is told of them."""

        def process_message(self, msg: Any, cell: Any, cell_index: int) -> Any:
            if msg["msg_type"] in {"display_data", "update_display_data"}:
                states.append(msg["content"]["data"].get("text/html", ""))
            return super().process_message(msg, cell, cell_index)

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code) for code in CELLS.values()])
    Client(notebook, timeout=240, allow_errors=True, resources={"metadata": {"path": tmp_path}}).execute()
    shown = {name: cell.outputs for name, cell in zip(CELLS, notebook.cells, strict=True)}
    tables = {"model": "prototype", "session": "wrench", "table": "position (mm)", "data": "windows"}
    for name, said in tables.items():
        html = shown[name][-1]["data"]["text/html"]
        assert html.startswith("<table>")
        assert said in html
    assert shown["model"][-1]["data"]["text/plain"] == repr(mc.load("demo"))
    assert b64decode(shown["plot"][-1]["data"]["image/png"]).startswith(b"\x89PNG")
    assert shown["estimate"][-1]["data"]["text/plain"] == "82.4 +- 0.3 mm"
    (error,) = shown["error"]
    assert error["ename"] == "InputError"
    assert error["evalue"].endswith("did you mean 'prototype'?")
    bars = [state for state in states if "<progress" in state]
    assert bars[-1].endswith(" 3/3")
    assert any(re.fullmatch(r'<progress value="\d+" max="\d+"></progress> .* \d+/\d+', each) for each in bars)
    (bar,) = shown["work"]  # which is empty at the end
    assert bar["data"]["text/plain"] == ""
