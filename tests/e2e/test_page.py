"""The page's look in a real Chromium: nothing overlaps or is cut, sections fold, history shows errors."""

import json
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.browser import Page, chromium, opened
from tests.e2e.test_web import READY, String, choose, demonstration
from tests.live.web.run_server import RunServer
from tests.live.web.test_server import SIGNAL, Keep, update

from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Signal, Tracked
from monochord.live.guides.run_tasks import RunTasks
from monochord.live.health import Note
from monochord.live.update import Update
from monochord.physics.sensors import load_sensor, with_sensor

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
SIZES = ((844, 390), (360, 740), (1280, 800))
PHONE = (390, 844)
SENSOR = load_sensor("prototype")
LONG = {
    "position": Estimate(value=1.23456, std=0.12345, unit="m"),
    "force": Estimate(value=12.345, std=10.234, unit="N"),
}
TRUTH = {"contact": 1.0, "slip": 1.0, "position": 1.23456, "force": 12.345}
SLIP = Estimate(value=0.99, std=0.01, unit="")
REASONS = (Reason.OUTSIDE_RANGE, Reason.CONSTANT_TENSION, Reason.SOFT_TOUCH)
NOTES = tuple(
    Note(
        key=f"{level}{k}",
        level=level,
        sentence="The sound of a new touch is still settling, and the string is 123 cents above its pitch.",
        remedy="Leave it untouched for a second. If that does not help, tune it nearer to its known pitch.",
        since=0.0,
    )
    for k, level in enumerate(("error", "warning"))
)


def abstained(why_not: str) -> dict[str, Estimate]:
    units = {"position": "m", "force": "N", "slip": ""}
    return {name: Estimate.abstain(unit, why_not) for name, unit in units.items()}


CASES = {"long": {**LONG, "slip": SLIP}, **{why_not: abstained(why_not) for why_not in REASONS}}


def telling(estimates: dict[str, Estimate]) -> Update:
    """Return an update of a touch with these estimates, and the longest that may stand beside them."""
    plain = update(1)
    contact = Estimate(value=0.999, std=0.001, unit="")
    prediction = replace(plain.prediction, estimates={"contact": contact, **estimates})
    return replace(plain, prediction=prediction, truth=TRUTH, notes=NOTES, tracked=Tracked())


@contextmanager
def telling_page(signal: Signal, controls: Keep | None, folder: Path) -> Generator[tuple[Page, list[Update]]]:
    """Give a page that is shown an update again and again, and the list in which that stands alone."""
    ended, now = threading.Event(), [telling(CASES["long"])]

    def write(writer: Any) -> None:
        for number in range(10**6):
            window = replace(now[0].window, start=441 * number)
            prediction = replace(now[0].prediction, time=number / 50)
            writer.write(replace(now[0], window=window, prediction=prediction))
            if ended.wait(0.02):
                return

    with (
        RunServer(port=0) as server,
        server.show(signal, 1.3, controls, tasks=RunTasks(signal, 1.3, folder, "demo")) as writer,
        opened(server.address) as page,
    ):
        thread = threading.Thread(target=write, args=(writer,))
        thread.start()
        try:
            page.wait(READY)
            yield page, now
            assert page.complaints == []
        finally:
            ended.set()
            thread.join()


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Page, list[Update]]]:
    signal = replace(with_sensor(SIGNAL, SENSOR), sensing_range=(0.3, 1.0))
    with telling_page(signal, Keep(), tmp_path_factory.mktemp("told")) as both:
        yield both


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with demonstration(tmp_path_factory.mktemp("page")) as started, opened(started.address) as page:
        page.size(1200, 900)
        page.wait(READY)
        yield page
        assert page.complaints == []


TEXTS = """(() => {
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), found = [];
    const unseen = '.unseen, .skip, [hidden]';
    const clipped = (each) => each.closest(unseen) || getComputedStyle(each).clipPath !== 'none';
    for (let node; (node = walker.nextNode());) {
        const parent = node.parentElement;
        if (!node.textContent.trim() || !parent.checkVisibility() || clipped(parent)) continue;
        if (parent.closest('select, script, noscript, .uplot')) continue;
        const range = document.createRange();
        range.selectNodeContents(node);
        for (const { left, top, right, bottom } of range.getClientRects()) {
            if (right - left < 1 || bottom - top < 1) continue;
            const outer = parent.closest('.reading, .note, summary, header, .card, dialog');
            const box = outer?.getBoundingClientRect();
            found.push({ text: node.textContent, left, top, right, bottom,
                box: box && [box.left, box.top, box.right, box.bottom] });
        }
    }
    return found;})()"""
"""Each line of visible text with its rectangle, and that of the box in which it belongs."""


def overlaps(texts: Sequence[dict[str, Any]]) -> list[tuple[str, str]]:
    """Return the pairs of texts of which one covers more than a pixel of the other, in both directions."""
    pairs: list[tuple[str, str]] = []
    for k, one in enumerate(texts):
        for other in texts[k + 1 :]:
            wide = min(one["right"], other["right"]) - max(one["left"], other["left"])
            high = min(one["bottom"], other["bottom"]) - max(one["top"], other["top"])
            if wide > 1.0 and high > 3.0:  # lines of text reach a little into each other
                pairs.append((one["text"], other["text"]))
    return pairs


def outside(texts: Sequence[dict[str, Any]]) -> list[str]:
    """Return the texts that leave their box."""
    return [
        each["text"]
        for each in texts
        if (box := each["box"])
        and not (box[0] - 1 <= each["left"] and each["right"] <= box[2] + 1 and each["bottom"] <= box[3] + 2)
    ]


def sized(page: Page, size: tuple[int, int]) -> None:
    page.size(*size, mobile=min(size) < 700)
    page.ask("scrollTo(0, 0)")
    page.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")


def press(page: Page, name: str, number: int, text: str = "") -> None:
    for kind in ("keyDown", "keyUp"):
        more = {"windowsVirtualKeyCode": number, "text": text}
        page.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, **more)


@pytest.mark.parametrize("size", SIZES)
def test_no_text_overlaps_another_or_is_cut(told: tuple[Page, list[Update]], size: tuple[int, int]) -> None:
    page, now = told
    sized(page, size)
    for name, estimates in CASES.items():
        now[0] = telling(estimates)
        shown = "123.5 mm" if name == "long" else name
        page.wait(f"document.getElementById('reading-position').textContent.includes({json.dumps(shown)})")
        sized(page, size)
        texts = page.ask(TEXTS)
        assert len(texts) > 20
        assert overlaps(texts) == [], name
        assert outside(texts) == [], name
        assert page.ask("document.documentElement.scrollWidth") == size[0]


@pytest.mark.parametrize("width", [320, 360])
def test_on_a_phone_the_header_is_one_line(page: Page, width: int) -> None:
    sized(page, (width, 640))
    middles = page.ask("""[...document.querySelectorAll('header > :not(h1, [hidden])')].map((each) => {
        const { top, bottom } = each.getBoundingClientRect(); return (top + bottom) / 2})""")
    assert max(middles) - min(middles) < 3.0
    assert any(node["role"] == "link" and "What is this?" in node["name"] for node in page.accessible())


def test_a_note_of_one_line_moves_nothing(told: tuple[Page, list[Update]]) -> None:
    page, now = told
    sized(page, (1280, 800))
    short = replace(NOTES[0], sentence="It hums.", remedy="Ground it.")
    below = set[float]()
    for notes in ((), (short,)):
        now[0] = replace(telling(CASES["long"]), notes=notes)
        page.wait(f"document.querySelectorAll('#notes > .note').length === {len(notes)}")
        below.add(page.ask("document.getElementById('controls').getBoundingClientRect().y"))
    assert len(below) == 1


def test_what_is_not_on_the_screen_is_drawn_for_a_capture_and_for_paper(
    told: tuple[Page, list[Update]],
) -> None:
    page, _ = told
    sized(page, (1280, 800))
    page.call("Page.reload")
    time.sleep(0.5)
    page.wait(READY)
    assert page.ask("document.getElementById('spectra').getBoundingClientRect().top") > 800
    last, later = "monochord.history.plots[2].scales.x.max", page.ask("monochord.moment.time") + 3.0
    page.wait(f"{last} > {later}", 10.0)
    page.wait(f"monochord.spectra.views.every(({{ drawn }}) => drawn.split(' ').at(-1) > {later})", 10.0)
    newest = "monochord.history.rows.at(-1)[0]"
    page.ask(f"addEventListener('beforeprint', () => {{ window.paper = [{last}, {newest}]; }})")
    page.call("Page.printToPDF")
    drawn, told_last = page.ask("paper")
    assert drawn == told_last


LABELS = """new Promise((done) => {
    const canvas = CanvasRenderingContext2D.prototype, draw = canvas.fillText, seen = {};
    canvas.fillText = function (text, x, y) {
        const name = this.canvas.getAttribute('aria-label') ?? '', mark = this.font.startsWith('600');
        if (name.startsWith('Spectrum')) (seen[name] ??= {})[mark ? `mark ${text}` : text] = x;
        draw.call(this, text, x, y);
    };
    setTimeout(() => { canvas.fillText = draw; done(seen); }, 1000);
})"""
"""The labels that a second writes into each spectrum, kHz and numbers of partials, with their places."""


def test_each_spectrum_has_the_partials_of_its_own_segment(told: tuple[Page, list[Update]]) -> None:
    page, now = told
    now[0] = telling(CASES["long"])
    sized(page, (1280, 800))
    page.ask("document.getElementById('spectra').scrollIntoView({block: 'center'})")
    page.wait("document.getElementById('reading-position').textContent.includes('1234.6 mm')")
    place, labels = LONG["position"].value, page.ask(LABELS)
    speed = 1.03 * page.ask("monochord.run.speed")  # at the pitch that is followed
    for end, segment in (("pickup 1", place), ("pickup 2", 1.3 - place)):
        at = labels[f"Spectrum of {end}"]
        hertz = 2000.0 * (at["mark 1"] - at["0"]) / (at["2"] - at["0"])
        assert hertz == pytest.approx(speed / (2.0 * segment), rel=0.01)


def test_a_section_stays_as_a_person_left_it(told: tuple[Page, list[Update]]) -> None:
    page, _ = told
    open_ = "document.querySelector('[data-section=history]').open"
    for size, left in ((PHONE, True), ((1280, 800), False)):
        sized(page, size)
        before = page.ask(open_)
        if before is not left:
            page.ask("document.querySelector('[data-section=history] summary').click()")
        page.call("Page.reload")
        time.sleep(0.5)
        page.wait(READY)
        assert page.ask(open_) is left
        assert page.ask("document.querySelectorAll('#history .uplot').length") == 4
    page.ask("localStorage.clear()")


def test_sections_are_opened_with_the_keyboard(told: tuple[Page, list[Update]]) -> None:
    page, _ = told
    sized(page, PHONE)
    page.ask("document.querySelector('[data-section=tasks] summary').focus()")
    press(page, "Enter", 13, "\r")
    page.wait("document.querySelector('[data-section=tasks]').open", 10.0)
    page.ask("localStorage.clear()")


def test_a_link_explains_the_page(page: Page, tmp_path: Path) -> None:
    is_open, words = "document.getElementById('about').open", "document.getElementById('about').innerText"
    requests = len(page.requests)
    assert not page.ask(is_open)
    page.ask("document.getElementById('what').focus()")
    page.ask("document.getElementById('what').click()")
    assert page.ask(is_open)
    length = page.ask("window.monochord.run.length")
    assert 0.198 < length < 0.203
    assert f"a steel string of {1e3 * length:.0f} mm" in page.ask(words)
    assert any(node["role"] == "dialog" for node in page.accessible())
    press(page, "Escape", 27)
    page.wait(f"!{is_open}", 5.0)
    assert page.ask("document.activeElement.id") == "what"
    assert len(page.requests) == requests
    with (
        RunServer(port=0) as server,
        server.show(SIGNAL, 0.2, None) as writer,
        opened(f"{server.address}#about") as other,
    ):
        other.wait("window.monochord?.run ? 1 : 0")
        writer.write(replace(update(1), truth={}))
        other.wait(READY)
        assert other.ask(is_open)
        assert other.ask(words) != page.ask(words)  # it is not simulated, and cannot be pressed


PLOT = "monochord.history.plots[2]"
"""The history of position."""


@pytest.mark.real_time
def test_the_history_shows_the_error_of_position_and_gaps(page: Page) -> None:
    page.size(1200, 900)
    choose(page, "touches", "by hand")
    for share in (0.45, 0.1):  # 90 mm, and 20 mm, where the sensor tells no place
        string = String(page)
        string.mouse("mousePressed", share)
        page.wait(f"Math.abs(monochord.moment.truth.position - {0.2 * share}) < 1e-3")
        page.wait("monochord.moment.decided.contact")
        time.sleep(1.5)
        begin = page.ask("monochord.moment.time")
        time.sleep(0.5)
        page.ask("document.getElementById('history').scrollIntoView({block: 'center'})")
        time.sleep(0.3)
        time_, upper, lower, value, _ = page.ask(f"{PLOT}.data")
        rows = [k for k, each in enumerate(time_) if each > begin]
        assert len(rows) > 2
        if share == 0.1:
            assert all(column[k] is None for k in rows for column in (upper, lower, value))
        else:
            k = rows[-1]
            std = page.ask(f"monochord.history.rows.find((row) => row[0] === {time_[k]})[4]")
            assert value[k] == pytest.approx(90.0, abs=3.0)
            assert upper[k] - value[k] == pytest.approx(2e3 * std)
            assert upper[k] - value[k] == pytest.approx(value[k] - lower[k])
        string.mouse("mouseReleased", share)
        page.wait("monochord.moment.truth.contact === 0 && monochord.moment.decided.contact === false")


@pytest.mark.real_time
def test_record_pressed_twice_records_and_stops(page: Page) -> None:
    press = "document.getElementById('record').click()"
    words = "document.getElementById('record').textContent"
    page.ask(press)
    stop = page.ask(words)  # at once
    page.ask(press)
    assert page.ask(words) != stop
    page.wait("monochord.moment.tasks.saved.includes('.mcap') && !monochord.moment.tasks.recording")


def test_a_command_that_cannot_be_sent_is_said(tmp_path: Path) -> None:
    with demonstration(tmp_path) as started, opened(started.address) as page:
        page.wait(READY)
        started.kill()
        page.wait("document.getElementById('connection').dataset.state === 'lost'")
        before = page.ask("document.getElementById('record').textContent")
        page.ask("document.getElementById('record').click()")
        assert page.ask("document.getElementById('answer').textContent")
        assert page.ask("document.getElementById('record').textContent") == before
