"""The page in a real Chromium: it loads without a network, is touched, shows slip, resumes and reconnects."""

import itertools
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from tests.cli import terminal
from tests.e2e.browser import Page, chromium, opened
from websockets.sync.client import ClientConnection, connect

from monochord.sessions import read_session

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
SECONDS = 240
READY = "window.monochord?.moment ? 1 : 0"
NONE = "\N{EN DASH}"
"""What stands for a number that is not known."""


FIRST_ESTIMATE = 5.0
"""Seconds from the command to the first estimate at a page, where everything is installed."""


@dataclass
class Demonstration:
    """A demonstration that runs, and the address of its page."""

    process: "subprocess.Popen[str]"
    address: str
    ended: str | None = None

    def end(self) -> str:
        """End it, unless it has ended, and return what it printed after the address."""
        if self.ended is None:
            self.process.terminate()
            self.ended, _ = self.process.communicate(timeout=60)
            assert self.process.returncode == 0
        return self.ended

    def kill(self) -> None:
        self.process.kill()
        self.ended, _ = self.process.communicate()


@contextmanager
def demonstration(folder: Path, *options: str) -> Generator[Demonstration]:
    """Run a demonstration in a folder."""
    command = [sys.executable, "-m", "monochord", "demo", "--no-browser", "--seconds", str(SECONDS), *options]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=folder, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("page: http://127.0.0.1:"), line
        started = Demonstration(process, line.split()[1])
        try:
            yield started
            started.end()
        finally:
            process.kill()  # of a test that failed


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    with demonstration(folder) as started:
        yield started.address


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
        page.ask("document.getElementById('string').scrollIntoView({block: 'nearest'})")
        script = """(() => {const v = monochord.view, r = v.canvas.getBoundingClientRect();
            return [r.left + v.pixel(0, 1), r.left + v.pixel(1, 1), r.top + v.rest]})()"""
        self._left, self._right, self._y = page.ask(script)

    def mouse(self, kind: str, share: float, down: float = 0.0) -> None:
        self._page.mouse(kind, self._left + share * (self._right - self._left), self._y + down)

    def finger(self, kind: str, share: float = 0.0) -> None:
        touches = [] if kind == "touchEnd" else [(self._left + share * (self._right - self._left), self._y)]
        self._page.touch(kind, touches)


def shown(page: Page) -> dict[str, Any]:
    return json.loads(page.ask("JSON.stringify(monochord.moment)"))


def test_the_page_needs_nothing_but_its_server(page: Page, address: str) -> None:
    assert page.requests
    assert all(request.startswith(address) for request in page.requests), page.requests
    assert page.ask("document.getElementById('connection').dataset.state") == "live"
    assert page.ask("document.getElementById('simulated').hidden") is False
    assert page.ask("document.querySelectorAll('.uplot').length") == 4


def check_estimated(page: Page, position: float) -> None:
    """Check that a touch, when it has settled, is estimated where it is."""
    page.wait("monochord.moment.decided.contact && monochord.moment.truth.contact === 1")
    time.sleep(1.0)
    told = shown(page)
    assert told["truth"]["position"] == pytest.approx(position, abs=1e-3)
    assert told["tracked"]["position"]["value"] == pytest.approx(position, abs=5e-3)


def moved_until(move: Callable[[int], object], condition: Callable[[], object], steps: int = 200) -> int:
    """Move so many steps to and fro until something is so; return the step at which it is."""
    deadline = time.monotonic() + 60.0
    for count in itertools.count(1):
        step = steps - abs(count % (2 * steps) - steps)
        move(step)
        if condition():
            return step
        assert time.monotonic() < deadline
    raise AssertionError


def test_a_press_is_estimated_where_it_is_and_a_drag_is_slip(page: Page) -> None:
    string = String(page)
    length = page.ask("monochord.run.length")
    string.mouse("mousePressed", 0.30)
    check_estimated(page, 0.30 * length)
    words = page.ask("document.querySelector('#reading-position .value').textContent")
    assert float(words.split()[0]) == pytest.approx(300.0 * length, abs=5.0)
    truth = [1.0, 0.0, pytest.approx(0.30 * length, abs=1e-3), pytest.approx(1.0, rel=0.1)]
    decided = [1, 0]  # contact and slip
    assert page.ask("monochord.history.rows.at(-1)")[-6:] == [*truth, *decided]
    place = 0.30 + 0.002 * moved_until(
        lambda step: string.mouse("mouseMoved", 0.30 + 0.002 * step),
        lambda: shown(page)["decided"].get("slip"),
    )
    page.wait("monochord.moment.decided.slip === false")
    page.wait(f"Math.abs(monochord.moment.truth.position - {place * length}) < 1e-3")
    string.mouse("mouseReleased", place)
    page.wait("monochord.moment.truth.contact === 0 && monochord.moment.decided.contact === false")
    page.wait("document.querySelector('#events li').textContent")


def test_a_drag_across_the_string_is_slip_at_one_place(page: Page) -> None:
    string = String(page)
    page.ask("document.getElementById('vertical').value = 'across'")
    string.mouse("mousePressed", 0.4)
    page.wait("monochord.moment.truth.contact === 1 && monochord.moment.truth.slip === 0")
    moved_until(
        lambda step: string.mouse("mouseMoved", 0.4, down=2.0 * step),
        lambda: shown(page)["truth"].get("slip") == 1.0,
        steps=100,
    )
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

    first, last = (str(round(1e3 * end)) for end in page.ask("monochord.run.range"))
    value = "monochord.view.canvas.getAttribute('aria-valuenow')"
    page.ask("monochord.view.canvas.focus()")
    for key, expected in (("End", last), ("Home", first)):
        press(key)
        assert page.ask(value) == expected
    press(" ")
    page.wait("monochord.moment.decided.contact && monochord.moment.truth.contact === 1")
    page.wait("!monochord.view.canvas.getAttribute('aria-valuetext').startsWith('not')")
    press("End")
    page.wait("Math.abs(monochord.moment.truth.position - monochord.run.range[1]) < 1e-3")
    press("Escape")
    page.wait("monochord.moment.truth.contact === 0")


def test_a_session_is_recorded_and_the_sensor_is_tuned(page: Page, folder: Path) -> None:
    def click(name: str) -> None:
        page.ask(f"document.getElementById('{name}').click()")

    click("record")
    page.wait("monochord.moment.tasks.recording?.seconds > 1")
    assert str(folder) in page.ask("document.getElementById('recorded').textContent")
    click("record")
    page.wait("monochord.moment.tasks.saved.includes('.mcap')")
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
    page.wait("monochord.moment.tasks.guided?.position > 0")  # it asks for a touch, once the string is let go
    string = String(page)
    string.mouse("mousePressed", 0.5)
    page.wait(f"{says}.includes('2 of 6')")
    string.mouse("mouseReleased", 0.5)
    page.ask("document.getElementById('cancel').click()")
    page.wait("document.getElementById('guided').hidden")


def choose(page: Page, name: str, value: str) -> None:
    """Choose a setting in its menu, and wait until it is in effect."""
    page.ask(f"""(() => {{const s = document.querySelector('select[name={name}]');
        s.value = '{value}'; s.dispatchEvent(new Event('change'))}})()""")
    page.wait(f"monochord.moment.settings.find((s) => s.name === '{name}').value === '{value}'")


def test_the_pitch_that_is_followed_is_shown(page: Page) -> None:
    choose(page, "touches", "by hand")
    before = page.wait("monochord.moment.pitch.deviation !== null && 1 + monochord.moment.pitch.deviation")
    choose(page, "tuning", "+3 %")
    pitch = f"(1 + (monochord.moment.pitch.deviation ?? -1)) / {before}"
    page.wait(f"Math.abs({pitch} - 1.03) < 0.005")
    numbers = "document.getElementById('pitch').textContent.match(/[\\d.]+/g)"
    page.wait(f"({numbers} ?? []).length === 4")
    hertz, _, cents, known = map(float, page.ask(numbers))
    assert hertz == pytest.approx(1.03 * before * known, rel=0.005)
    assert cents == pytest.approx(1200.0 * np.log2(hertz / known), abs=1.0)
    choose(page, "tuning", "as built")
    page.wait(f"Math.abs({pitch} - 1) < 0.005")


def test_a_reload_resumes_and_knows_what_was_before(page: Page) -> None:
    before = shown(page)["time"]
    page.call("Page.reload")
    time.sleep(0.5)
    page.wait(READY)
    assert shown(page)["time"] > before
    assert page.ask("monochord.run.history.length") > 20
    assert page.ask("monochord.run.history[0][0]") < before


def check_pace(page: Page) -> None:
    """Check what a browser without a graphics card, beside the run on two cores, can keep for ten seconds."""
    pace = page.ask("""new Promise((done) => {
        const { counts } = monochord, lost = () => monochord.moment.health.dropped;
        const from = { ...counts, lost: lost() }, begin = performance.now();
        const count = () => {
            const seconds = (performance.now() - begin) / 1000, since = (name) => counts[name] - from[name];
            if (seconds < 10) return requestAnimationFrame(count);
            done({ seconds, frames: since('frames'), received: since('received'), drawn: since('drawn'),
                replaced: since('replaced'), lost: lost() - from.lost });
        };
        requestAnimationFrame(count)})""")
    assert 10.0 * pace["seconds"] <= pace["received"] <= 31.0 * pace["seconds"], pace
    assert pace["frames"] >= pace["drawn"] >= 0.5 * pace["received"], pace
    assert pace["drawn"] + pace["replaced"] == pytest.approx(pace["received"], abs=1)
    assert pace["lost"] == 0


def test_it_is_drawn_at_the_screens_pace_not_at_that_of_messages(page: Page) -> None:
    check_pace(page)


def test_a_finger_is_estimated_where_it_is_and_slides(page: Page) -> None:
    page.size(360, 740, scale=2.0, mobile=True)
    string, length = String(page), page.ask("monochord.run.length")
    string.finger("touchStart", 0.30)
    check_estimated(page, 0.30 * length)
    place = 0.30 + 0.002 * moved_until(
        lambda step: string.finger("touchMove", 0.30 + 0.002 * step),
        lambda: shown(page)["decided"].get("slip"),
    )
    page.wait(f"Math.abs(monochord.moment.truth.position - {place * length}) < 1e-3")
    string.finger("touchEnd")
    page.wait("monochord.moment.truth.contact === 0 && monochord.moment.decided.contact === false")
    page.size(1200, 900)


def test_a_screen_reader_finds_the_string_the_meters_and_the_status(page: Page) -> None:
    page.wait("document.querySelector('[data-section=spectra]').open")  # after the size of a phone
    tree = page.accessible()
    (string,) = [node for node in tree if node["role"] == "slider"]
    assert 0 < int(string["value"]) < 1000 * page.ask("monochord.run.length")
    meters = [node for node in tree if node["role"] == "meter"]
    assert all(-60 <= int(node["value"]) < 0 for node in meters)
    assert len(meters) == 2
    assert sum(node["role"] == "status" for node in tree) >= 2
    controls = [node for node in tree if node["role"] in {"button", "combobox", "spinbutton", "slider"}]
    assert all(node["name"] for node in controls)


WATCH = """(() => {
    window.said = []; window.places = [];
    const spoken = document.getElementById('spoken'), below = document.getElementById('controls');
    new MutationObserver(() => said.push(spoken.textContent)).observe(spoken, { childList: true });
    const notes = document.getElementById('notes').children;
    const look = () => { // two notes need more room
        if (notes.length < 2) places.push(below.getBoundingClientRect().y);
        requestAnimationFrame(look);
    };
    look()})()"""
"""Keep what a screen reader is told, and where the section below the notes is in each frame."""


def test_each_touch_is_spoken_and_moves_nothing_on_the_page(page: Page) -> None:
    page.size(1200, 900)
    choose(page, "touches", "by hand")
    page.wait("document.getElementById('spoken').textContent && monochord.moment.decided.contact === false")
    string, length = String(page), page.ask("monochord.run.length")
    time.sleep(1.5)
    page.ask(WATCH)
    for count, share in enumerate((0.3, 0.6, 0.45), 1):
        string.mouse("mousePressed", share)
        place = f"Number(text.match(/^touched at (\\d+) /)?.[1]) - {1e3 * share * length}"
        page.wait(f"said.some((text) => Math.abs({place}) < 6)", 3.0)
        string.mouse("mouseReleased", share)
        page.wait(f"said.filter((text) => text === 'untouched').length === {count}", 3.0)
        time.sleep(1.0)
    assert len(set(page.ask("places"))) == 1


@pytest.mark.parametrize(
    ("contact", "shown_as"),
    [
        ("null", [NONE, "microphone 1 is silent"]),
        ("0.97", ["touched", "97 % likely"]),
        ("0.004", ["untouched", "99.6 % likely"]),
    ],
)
def test_where_contact_is_not_known_it_is_not_called_untouched(
    page: Page, contact: str, shown_as: list[str]
) -> None:
    why = "microphone 1 is silent"
    texts = page.ask(f"""import("/static/numbers.js").then((numbers) => {{
        const why = {{ value: null, std: null, unit: "", why: {json.dumps(why)} }};
        const contact = {contact} === null ? why : {{ value: {contact}, std: 0.1, unit: "", why: "" }};
        const window = {{ contact, position: why, force: why, slip: why }};
        numbers.showNumbers({{ ...monochord.moment, window, tracked: window, decided: {{}}, truth: {{}} }});
        const texts = (name) => [...document.getElementById(`reading-${{name}}`).children].slice(1);
        return ["contact", "position"].map((name) => texts(name).map((each) => each.textContent));
    }})""")
    assert texts == [shown_as, [NONE, "no contact" if shown_as[0] == "untouched" else why]]


STATE = "document.getElementById('connection')?.dataset.state"


def test_it_connects_again_by_itself(tmp_path: Path) -> None:
    with demonstration(tmp_path) as first, opened(first.address) as page:
        page.wait(f"{STATE} === 'live'")
        page.ask("window.kept = 'not reloaded'")
        first.process.send_signal(signal.SIGSTOP)
        page.wait(f"{STATE} === 'silent'")
        first.process.send_signal(signal.SIGCONT)
        page.wait(f"{STATE} === 'live'")
        first.kill()
        page.wait(f"{STATE} === 'lost'")
        with demonstration(tmp_path, "--port", str(urlsplit(first.address).port)) as second:
            assert second.address == first.address
            page.wait(f"{STATE} === 'live'")
            time_ = page.ask("monochord.moment.time")
            page.wait(f"monochord.moment.time > {time_ + 1.0}")
            string = String(page)
            string.mouse("mousePressed", 0.30)
            page.wait("monochord.moment.decided.contact && monochord.moment.truth.contact === 1")
            string.mouse("mouseReleased", 0.30)
        assert page.ask("window.kept") == "not reloaded"
        assert all("WebSocket connection" in each for each in page.complaints), page.complaints


@pytest.mark.jack
def test_through_a_jack_server_the_page_is_touched_and_no_sound_is_lost(tmp_path: Path) -> None:
    with demonstration(tmp_path, "--jack") as started, opened(started.address) as page:
        page.size(1200, 900)
        page.wait(READY)
        with connect(started.address.replace("http", "ws") + "live", open_timeout=30) as client:
            told = touched_by(client, 0.06, 1.0)
        assert told["truth"]["position"] == pytest.approx(0.06, abs=1e-3)
        assert told["tracked"]["position"]["value"] == pytest.approx(0.06, abs=5e-3)
        assert told["tracked"]["force"]["value"] == pytest.approx(1.0, abs=0.8)
        check_pace(page)
        assert page.complaints == []
        summary = started.end()
    lost = re.search(r"dropped (\d+)  gaps (\d+)  xruns (\d+)", summary)
    assert lost, summary
    assert lost.group(1) == "0"


def touched_by(client: ClientConnection, position: float, force: float) -> dict[str, Any]:
    """Hold a touch for 3 s by a page's own messages, and return the newest moment of a contact."""
    touch = json.dumps({"do": "touch", "position": position, "force": force})
    begun, newest, next_ = 0.0, {}, 0.0
    deadline = time.monotonic() + 60.0
    while not begun or time.monotonic() < begun + 3.0:
        assert time.monotonic() < deadline, newest
        if time.monotonic() >= next_:
            client.send(touch)
            next_ = time.monotonic() + 0.4
        told = client.recv(30)
        if isinstance(told, str) and (moment := json.loads(told))["type"] == "moment":
            by_hand = moment["truth"].get("position") == pytest.approx(position, abs=1e-3)
            if by_hand and moment["decided"].get("contact"):
                begun, newest = begun or time.monotonic(), moment
    return newest


LOCAL: Mapping[str, str] = {"DISPLAY": ":99"}
OVER_SSH: Mapping[str, str] = {
    "SSH_CONNECTION": "192.0.2.1 50000 192.0.2.2 22", "SSH_TTY": "/dev/pts/9", "DISPLAY": "localhost:10.0",
}  # fmt: skip


@pytest.mark.parametrize(
    ("options", "environment", "opens"),
    [
        pytest.param([], LOCAL, True, id="at-the-machine"),
        pytest.param(["--no-browser"], LOCAL, False, id="no-browser"),
        pytest.param([], OVER_SSH, False, id="ssh"),
        pytest.param([], {}, False, id="no-display"),
    ],
)
def test_it_opens_a_browser_only_where_it_is_seen(
    tmp_path: Path,
    options: list[str],
    environment: Mapping[str, str],
    opens: bool,  # noqa: FBT001
) -> None:
    browser, shown_at = tmp_path / "browser", tmp_path / "opened"
    browser.write_text(f'#!/bin/sh\necho "$1" > {shown_at}\n', encoding="utf-8")
    browser.chmod(0o755)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    printed = on_a_terminal(
        ["--port", str(port), "--seconds", "2", *options], {**environment, "BROWSER": str(browser)}
    )
    address = f"http://127.0.0.1:{port}/"
    assert f"page: {address}" in printed
    assert shown_at.exists() == opens
    if opens:
        assert shown_at.read_text(encoding="utf-8").strip() == address


def on_a_terminal(options: list[str], environment: Mapping[str, str]) -> str:
    """Return what a demonstration prints on a terminal of its own."""
    remote = ("SSH_CONNECTION", "SSH_TTY", "DISPLAY", "WAYLAND_DISPLAY", "NO_COLOR")
    own = {name: value for name, value in os.environ.items() if name not in remote}
    own |= {"TERM": "xterm-256color", "COLUMNS": "100", "LINES": "40", **environment}
    command = [sys.executable, "-m", "monochord", "demo", *options]
    return terminal.on_a_terminal(command, environment=own)


def test_the_address_answers_first_and_an_estimate_follows_soon(tmp_path: Path) -> None:
    begin = time.monotonic()
    with demonstration(tmp_path) as started:
        address = started.address
        with urllib.request.urlopen(address, timeout=30) as answer:  # noqa: S310  (our own)
            assert answer.status == 200
        with connect(address.replace("http", "ws") + "live", open_timeout=30) as client:
            kinds: list[str] = []
            while "moment" not in kinds:
                told = client.recv(60)
                kinds += [json.loads(told)["type"]] if isinstance(told, str) else []
        passed = time.monotonic() - begin
    assert kinds[0] == "waiting"
    assert passed < FIRST_ESTIMATE
