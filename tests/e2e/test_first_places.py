"""The places that somebody presses first, on the page of the demonstration: README's, and those it proposes.

A pointer presses each for as long as the page asks; windows from 0.3 s on count, as in `press_anywhere`.
"""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.browser import Page, chromium, opened
from tests.e2e.press_anywhere import COLLECT, SETTLED
from tests.e2e.test_web import READY, String, demonstration

from monochord.core.units import Metres

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.timeout(900),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
README = Path(__file__).parents[2] / "README.md"
PROPOSED = 9
MOMENTS, REST = 20, 1.0
"""How many moments of a touch count, and how long the string is left alone after it, in s."""
CLOSE: Metres = 5e-3
ANSWERED = 0.95
"""Least share of a touch's windows that state a position within `CLOSE`."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with (
        demonstration(tmp_path_factory.mktemp("page"), "--seconds", "600") as started,
        opened(started.address) as page,
    ):
        page.size(1200, 900)
        page.wait(READY)
        page.ask(COLLECT)
        page.ask("document.querySelectorAll('details').forEach((each) => { each.open = true })")
        yield page
        assert page.complaints == []


def press(page: Page, place: Metres, until: str = "true") -> list[tuple[float, float | None]]:
    """Press a place for `MOMENTS` and until something is so; return their true and stated positions."""
    string, share = String(page), place / page.ask("monochord.run.length")
    string.mouse("mousePressed", share)
    page.wait(f"Math.abs((monochord.moment.truth.position ?? 9) - {place}) < 1e-3")
    time.sleep(SETTLED)
    page.ask("window.moments.length = 0")
    page.wait(f"window.moments.length >= {MOMENTS} && ({until})")
    moments: list[Any] = json.loads(page.ask("JSON.stringify(window.moments)"))
    string.mouse("mouseReleased", share)
    page.wait("monochord.moment.truth.contact === 0")
    time.sleep(REST)
    touched = [each for each in moments if each[2].get("contact") == 1.0 and each[2].get("position")]
    return [(truth["position"], window["position"]["value"]) for window, _, truth in touched]


def answered(moments: list[tuple[float, float | None]]) -> float:
    """Return the share of moments with a position close to the truth."""
    assert len(moments) >= MOMENTS
    return sum(stated is not None and abs(stated - true) <= CLOSE for true, stated in moments) / len(moments)


def test_each_place_that_is_pressed_first_is_answered(page: Page, capsys: pytest.CaptureFixture[str]) -> None:
    named = [float(text) for text in re.findall(r"\.press\((0\.\d+)", README.read_text(encoding="utf-8"))]
    assert named
    shares = {place: answered(press(page, place)) for place in named}
    page.ask("document.getElementById('label').click()")
    for count in range(PROPOSED):
        guided = "monochord.moment.tasks.guided"
        page.wait(f"{guided}?.phase === 'press' && {guided}.count === {count}")
        place = page.ask(f"{guided}.position")
        shares[place] = answered(press(page, place, until=f"{guided}?.count > {count}"))
    page.ask("document.getElementById('cancel').click()")
    with capsys.disabled():
        for place, share in shares.items():
            print(f"\n{1e3 * place:6.1f} mm  {share:6.1%} answered within 5 mm", end="")  # noqa: T201
    assert len(shares) == len(named) + PROPOSED
    assert min(shares.values()) >= ANSWERED, shares


def test_the_place_that_the_keyboard_begins_with_is_answered(page: Page) -> None:
    page.ask("monochord.view.canvas.focus()")
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", type=kind, key=" ", text=" ")
    page.wait("monochord.moment.truth.contact === 1 && monochord.moment.decided.contact")
    time.sleep(SETTLED)
    page.ask("window.moments.length = 0")
    page.wait(f"window.moments.length >= {MOMENTS}")
    moments = json.loads(page.ask("JSON.stringify(window.moments)"))
    page.call("Input.dispatchKeyEvent", type="keyDown", key="Escape")
    assert answered([(m[2]["position"], m[0]["position"]["value"]) for m in moments]) >= ANSWERED
