"""The bring-up's page in a real Chromium, from the command with the virtual sensor to its files."""

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.browser import BRING_UP, Page, chromium, opened
from tests.e2e.test_page import SIZES, TEXTS, outside, overlaps, sized
from tests.waiting import wait_for

import monochord as mc

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
PATIENCE = 240.0
"""The virtual sensor is compiled at first."""
STATE = "window.monochord?.state"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bring_up")


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Page]:
    pipe = subprocess.PIPE
    with subprocess.Popen(BRING_UP, cwd=folder, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("page: http://127.0.0.1:"), line
        try:
            with opened(line.split()[1]) as page:
                page.size(1280, 800)
                page.wait(f"{STATE} ? 1 : 0", PATIENCE)
                yield page
                assert page.complaints == []
            process.send_signal(signal.SIGINT)  # all steps are done: it ends with the result
            out, errors = process.communicate(timeout=60)
            assert process.returncode == 0, errors
            assert out.splitlines()[0] == "No fault. Simulated: a rehearsal on the virtual sensor."
            assert "written to mine.toml" in out
        finally:
            process.kill()


def click(page: Page, name: str) -> None:
    page.ask(f"document.getElementById({json.dumps(name)}).click()")


def at(page: Page, step: str | None, phase: str = "ready") -> None:
    page.wait(f"{STATE}.step === {json.dumps(step)} && {STATE}.phase === '{phase}'", PATIENCE)


def status(page: Page) -> dict[str, str]:
    return {each["name"]: each["status"] for each in page.ask(f"{STATE}.steps")}


def words(page: Page, name: str) -> str:
    return page.ask(f"document.getElementById({json.dumps(name)}).innerText")


PARTS = "[...document.querySelectorAll('#sensor [data-part]')]"


def lit(page: Page) -> set[str]:
    """Return the parts of the drawing that are lit; they and no others are in another colour."""
    matching = "filter((each) => each.matches('.lit')).map((each) => each.dataset.part)"
    named: set[str] = {*page.ask(f"{PARTS}.{matching}")}
    shown = "filter((each) => each.getClientRects().length && each.dataset.part !== 'string')"
    stroke = "getComputedStyle(each.querySelector('rect, line, path, circle')).stroke"
    colours: list[tuple[str, str]] = page.ask(f"{PARTS}.{shown}.map((each) => [each.dataset.part, {stroke}])")
    actions = {"pluck", "tap", "press", "damp"}
    assert {part for part, _ in colours} & actions == named & actions
    plain = dict(colours)["microphone_2"]
    assert {part for part, colour in colours if colour != plain} == named - {"string"}
    return named


def on(page: Page) -> list[str]:
    words = "[...document.querySelectorAll('#sensor [data-switch]')]"
    return page.ask(f"{words}.map((each) => each.textContent.trim())")


def lines_fit(page: Page) -> None:
    for size in SIZES:
        sized(page, size)
        texts: list[dict[str, Any]] = page.ask(TEXTS)
        assert len(texts) > 15
        assert overlaps(texts) == []
        assert outside(texts) == []
        assert page.ask("document.documentElement.scrollWidth") == size[0]
    page.size(1280, 800)


def test_a_sensor_is_brought_up_step_by_step(page: Page, folder: Path) -> None:
    at(page, "quiet")
    assert words(page, "simulated") == "simulated"
    assert "Switch both drivers off" in words(page, "instruction")
    assert (lit(page), on(page)) == ({"driver_1", "driver_2", "damp"}, ["off", "off"])
    click(page, "record")
    at(page, "quiet", "recording")
    page.wait("document.querySelectorAll('[role=meter]').length === 2", PATIENCE)
    at(page, "pluck")
    click(page, "record")
    at(page, "pluck", "recording")
    page.wait("Number(document.querySelector('[role=meter]').getAttribute('aria-valuenow')) > -60", 30.0)
    at(page, "tap")
    assert (lit(page), on(page)) == ({"tap", "end_1", "microphone_1"}, ["off", "off"])
    assert "open pitch" in words(page, "advice")
    assert status(page) == {"quiet": "passed", "pluck": "passed"} | dict.fromkeys(
        ("tap", "driver_1", "driver_2", "both", "press", "damped"), "waiting"
    )
    click(page, "skip")
    at(page, "driver_1")
    assert (lit(page), on(page)) == ({"driver_1"}, ["on", "off"])
    click(page, "repeat")
    at(page, "pluck")
    click(page, "record")
    at(page, "driver_1")
    lines_fit(page)
    click(page, "end")
    at(page, None, "done")
    assert page.ask("document.getElementById('sensor').hidden")
    assert words(page, "verdict") == (
        "No fault. Simulated: a rehearsal on the virtual sensor. 2 of 8 steps are recorded."
    )
    lines_fit(page)
    assert "Written to mine.toml and mine.html" in words(page, "paths")
    assert mc.load_sensor(str(folder / "mine.toml")).string.tension == pytest.approx(65.0, rel=0.01)


def test_the_links_give_the_files(page: Page, folder: Path, tmp_path: Path) -> None:
    page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    click(page, "toml")
    wait_for((tmp_path / "mine.toml").exists, 30.0)
    assert (tmp_path / "mine.toml").read_text(encoding="utf-8") == (folder / "mine.toml").read_text(
        encoding="utf-8"
    )
    page.call("Page.navigate", url=page.ask("document.getElementById('report').href"))
    time.sleep(0.5)
    page.wait("document.querySelectorAll('svg').length === 4", PATIENCE)
    assert "simulated" in page.ask("document.querySelector('h1').textContent")
    assert page.ask("getComputedStyle(document.body).maxWidth") == "1170px"  # its own styles are let in
