"""The page in a real Chromium: it loads without a network, is touched, shows slip, and resumes."""

import json
import subprocess
import sys
import time
import urllib.request
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.browser import Page, chromium, opened
from websockets.sync.client import connect

from monochord.sessions import read_session

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
SECONDS = 240
READY = "window.monochord?.moment ? 1 : 0"


FIRST_ESTIMATE = 5.0
"""Seconds from the command to the first estimate at a page, where everything is installed."""


@contextmanager
def demonstration(folder: Path) -> Generator[str]:
    """The address of the page of a demonstration that runs in a folder."""
    command = [sys.executable, "-m", "monochord", "demo", "--no-browser", "--seconds", str(SECONDS)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=folder, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("page: http://127.0.0.1:"), line
        yield line.split()[1]
        process.terminate()
        process.communicate(timeout=60)
        assert process.returncode == 0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with demonstration(folder) as address:
        yield address


@pytest.fixture(scope="module")
def page(address: str) -> Iterator[Page]:
    with opened(address) as page:
        page.size(1200, 900)
        page.wait(READY)
        yield page
        assert page.complaints == []


class String:
    """The drawn string, in the browser's pixels."""

    def __init__(self, page: Page) -> None:
        self._page = page
        script = """(() => {const v = monochord.view, r = v.canvas.getBoundingClientRect();
            return [r.left + v.pixel(0, 1), r.left + v.pixel(1, 1), r.top + v.rest]})()"""
        self._left, self._right, self._y = page.ask(script)

    def mouse(self, kind: str, share: float, down: float = 0.0) -> None:
        self._page.mouse(kind, self._left + share * (self._right - self._left), self._y + down)


def shown(page: Page) -> dict[str, Any]:
    return json.loads(page.ask("JSON.stringify(monochord.moment)"))


def test_the_page_needs_nothing_but_its_server(page: Page, address: str) -> None:
    assert page.requests
    assert all(request.startswith(address) for request in page.requests), page.requests
    assert page.ask("document.getElementById('connection').dataset.state") == "live"
    assert page.ask("document.getElementById('simulated').hidden") is False
    assert page.ask("document.querySelectorAll('.uplot').length") == 3


def test_a_press_is_estimated_where_it_is_and_a_drag_is_slip(page: Page) -> None:
    string = String(page)
    length = page.ask("monochord.run.length")
    string.mouse("mousePressed", 0.30)
    page.wait("monochord.moment.decided.contact && monochord.moment.truth.contact === 1")
    time.sleep(1.0)
    told = shown(page)
    assert told["truth"]["position"] == pytest.approx(0.30 * length, abs=1e-3)
    assert told["tracked"]["position"]["value"] == pytest.approx(0.30 * length, abs=5e-3)
    words = page.ask("document.querySelector('#reading-position .value').textContent")
    assert float(words.split()[0]) == pytest.approx(300.0 * length, abs=5.0)
    slid = False
    for step in range(200):
        string.mouse("mouseMoved", 0.30 + 0.002 * step)
        slid = slid or bool(shown(page)["decided"].get("slip"))
    assert slid
    place = 0.30 + 0.002 * 199
    page.wait("monochord.moment.decided.slip === false")
    page.wait(f"Math.abs(monochord.moment.truth.position - {place * length}) < 1e-3")
    string.mouse("mouseReleased", place)
    page.wait("monochord.moment.truth.contact === 0 && monochord.moment.decided.contact === false")


def test_a_drag_across_the_string_is_slip_at_one_place(page: Page) -> None:
    string = String(page)
    page.ask("document.getElementById('vertical').value = 'across'")
    string.mouse("mousePressed", 0.4)
    page.wait("monochord.moment.truth.contact === 1 && monochord.moment.truth.slip === 0")
    slid = False
    for step in range(100):
        string.mouse("mouseMoved", 0.4, down=2.0 * step)
        slid = slid or shown(page)["truth"].get("slip") == 1.0
    assert slid
    page.wait("monochord.moment.truth.slip === 0")
    told = shown(page)["truth"]
    assert told["position"] == pytest.approx(0.4 * page.ask("monochord.run.length"), abs=1e-3)
    assert told["force"] == pytest.approx(1.0, rel=0.1)
    string.mouse("mouseReleased", 0.4)
    page.ask("document.getElementById('vertical').value = 'force'")
    page.wait("monochord.moment.truth.contact === 0")


def test_it_is_touched_with_keys(page: Page) -> None:
    def press(key: str) -> None:
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, key=key, text=" " if key == " " else "")

    page.ask("monochord.view.canvas.focus()")
    press(" ")
    page.wait("monochord.moment.decided.contact && monochord.moment.truth.contact === 1")
    assert "not" not in page.ask("monochord.view.canvas.getAttribute('aria-valuetext')")
    press("Escape")
    page.wait("monochord.moment.truth.contact === 0")


def test_a_session_is_recorded_and_the_sensor_is_tuned(page: Page, folder: Path) -> None:
    def click(name: str) -> None:
        page.ask(f"document.getElementById('{name}').click()")

    click("record")
    page.wait("monochord.moment.tasks.recording?.seconds > 1")
    assert str(folder) in page.ask("document.getElementById('recorded').textContent")
    click("record")
    page.wait("monochord.moment.tasks.saved")
    (session,) = folder.glob("*.mcap")
    assert read_session(session).complete
    click("tune")
    lines = page.wait("document.getElementById('lines').textContent")
    (file,) = folder.glob("*.toml")
    assert str(file) in lines
    click("cancel")
    page.wait("document.getElementById('guided').hidden")


def test_a_calibration_asks_for_touches_and_takes_one_that_is_held(page: Page) -> None:
    says = "document.getElementById('says').textContent"
    page.ask("document.getElementById('calibrate').click()")
    page.wait(f"{says}.includes('Touch 1 of 6. Press near')")
    string = String(page)
    string.mouse("mousePressed", 0.5)
    page.wait(f"{says}.includes('Touch 2 of 6')")
    string.mouse("mouseReleased", 0.5)
    page.ask("document.getElementById('cancel').click()")
    page.wait("document.getElementById('guided').hidden")


def test_a_material_is_chosen(page: Page) -> None:
    page.ask("""(() => {const s = document.querySelector('select[name=material]');
        s.value = 'brass_rod'; s.dispatchEvent(new Event('change'))})()""")
    page.wait("monochord.moment.settings.find((s) => s.name === 'material').value === 'brass_rod'")


def test_a_reload_resumes_and_knows_what_was_before(page: Page) -> None:
    before = shown(page)["time"]
    page.call("Page.reload")
    time.sleep(0.5)
    page.wait(READY)
    assert shown(page)["time"] > before
    assert page.ask("monochord.run.history.length") > 20
    assert page.ask("monochord.run.history[0][0]") < before


def test_it_fits_a_phone_and_both_schemes(page: Page) -> None:
    page.size(360, 740, scale=2.0, mobile=True)
    for scheme in ("light", "dark"):
        page.scheme(scheme)
        assert page.ask("document.documentElement.scrollWidth") == 360
    paper = "getComputedStyle(document.body).backgroundColor"
    dark = page.ask(paper)
    page.ask("document.getElementById('theme').click()")
    assert page.ask(paper) != dark
    page.ask("document.getElementById('theme').click()")
    page.size(1200, 900)


def test_it_is_drawn_at_the_screens_pace_not_at_that_of_messages(page: Page) -> None:
    told = page.ask("""new Promise((done) => {
        let frames = 0, seen = new Set(), end = performance.now() + 2000;
        const count = (now) => { frames++; seen.add(monochord.moment.time);
            now < end ? requestAnimationFrame(count) : done([frames, seen.size]); };
        requestAnimationFrame(count)})""")
    frames, moments = told
    assert moments > 5
    assert moments <= 70
    assert frames >= moments


def test_the_address_answers_first_and_an_estimate_follows_soon(tmp_path: Path) -> None:
    begin = time.monotonic()
    with demonstration(tmp_path) as address:
        with urllib.request.urlopen(address, timeout=30) as answer:  # noqa: S310  (our own)
            assert answer.status == 200
        answered = time.monotonic() - begin
        with connect(address.replace("http", "ws") + "live", open_timeout=30) as client:
            kinds: list[str] = []
            while "moment" not in kinds:
                told = client.recv(60)
                kinds += [json.loads(told)["type"]] if isinstance(told, str) else []
        passed = time.monotonic() - begin
    print(f"address after {answered:.1f} s, first estimate after {passed:.1f} s")  # noqa: T201
    assert kinds[0] == "waiting"
    assert passed < FIRST_ESTIMATE
