"""Labelled touches on the page in a real Chromium, by a person with a ruler and a scale that shows grams."""

import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.e2e.browser import Page, chromium, opened

from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.sessions import read_session

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
SAYS = "document.getElementById('says').textContent"


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    """A touch every seven seconds, without a truth: as if somebody sat at the sensor."""
    twin = VirtualSensor("prototype", seed=3)
    parts = [twin.advance(3.5)[0]]
    twin.press(0.1, 0.8)
    parts.append(twin.advance(3.0)[0])
    twin.release()
    parts.append(twin.advance(0.5)[0])
    file = tmp_path / "take.wav"
    soundfile.write(file, np.concatenate(parts, axis=1).T, twin.sample_rate, subtype="FLOAT")
    return file


@contextmanager
def shown(sound: Path, folder: Path) -> Generator[Page]:
    """Run `live` with the page, and open it."""
    sets = ("source.speed=1", "source.repeat=0", f"sinks.web.folder={folder}")
    line = [sys.executable, "-m", "monochord", "live", "demo", str(sound), "--sensor", "prototype"]
    line += ["--sink", "web=0", *(word for each in sets for word in ("--set", each))]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout
        try:
            words = process.stdout.readline().split()
            assert words[:1] == ["page:"], words
            with opened(words[1]) as page:
                page.size(1200, 900)
                page.wait("window.monochord?.moment ? 1 : 0")
                yield page
                assert page.complaints == []
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60)
        finally:
            process.kill()


def test_touches_are_heard_labelled_in_grams_undone_and_saved(sound: Path, tmp_path: Path) -> None:
    folder = tmp_path / "takes"
    folder.mkdir()

    def click(name: str) -> None:
        page.ask(f"document.getElementById('{name}').click()")

    def put(name: str, value: float | str) -> None:
        page.ask(
            f"(() => {{const e = document.getElementById('{name}'); e.value = '{value}';"
            " e.dispatchEvent(new Event('change'))})()"
        )

    with shown(sound, folder) as page:
        page.ask("document.querySelectorAll('details').forEach((each) => { each.open = true })")
        click("label")
        page.wait("monochord.moment.tasks.guided?.phase === 'press'")
        page.wait(f"{SAYS}.includes('mm')")  # with the next frame
        put("known-unit", "g")
        page.wait("monochord.moment.tasks.guided?.phase === 'label'")  # heard
        assert "Recorded" in page.wait(f"{SAYS}.includes('Recorded') && {SAYS}")
        put("known-position", 98.5)
        put("known-force", 9000)
        page.ask("document.getElementById('typed').requestSubmit()")
        page.wait(f"{SAYS}.includes('impossible')")
        put("known-force", 82)
        page.ask("document.getElementById('typed').requestSubmit()")
        page.wait("monochord.moment.tasks.guided?.count === 1")
        (table,) = folder.glob("touches_*.csv")
        assert "0.0985,0.804145" in table.read_text(encoding="utf-8")
        click("step-undo")
        page.wait("monochord.moment.tasks.guided?.count === 0")
        page.wait("monochord.moment.tasks.guided?.phase === 'label'")
        page.picture(tmp_path / "label.png")
        put("known-position", 100)
        put("known-force", 80)
        page.ask("document.getElementById('typed').requestSubmit()")
        page.wait("monochord.moment.tasks.guided?.count === 1")
        page.wait("document.getElementById('cancel').textContent === 'Finish'")
        click("cancel")
        assert "touches_" in page.wait("document.getElementById('lines').textContent")
    (session,) = folder.glob("touches_*.mcap")
    recorded = read_session(session)
    columns = recorded.labels.columns
    on = columns["contact"] == 1.0
    assert {*np.round(columns["position"][on], 4).tolist()} == {0.1}
    assert columns["force"][on][0] == pytest.approx(0.7845, abs=1e-3)
    assert recorded.description.sensor["range"] == [0.05, 0.15]
    assert recorded.complete
