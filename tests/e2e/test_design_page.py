"""The design's page in a real Chromium: sliders, figures, charts, the downloaded sensor, and bad input."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.browser import Page, chromium, opened
from tests.e2e.test_page import SIZES, TEXTS, outside, overlaps, sized
from tests.live.web.test_server import free
from tests.waiting import wait_for

import monochord as mc
from monochord.front.design import design_string
from monochord.front.page import design_page
from monochord.page.server import Server
from monochord.physics.design import Wishes

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
IDLE = "window.monochord?.own && monochord.advice && !monochord.busy ? 1 : 0"
PATIENCE = 240.0
"""A sweep takes seconds, on a busy machine many."""


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server([design_page()], port=free()) as server:
        yield server


@pytest.fixture(scope="module")
def page(server: Server) -> Iterator[Page]:
    with opened(server.address) as page:
        page.size(1280, 800)
        page.wait(IDLE, PATIENCE)
        yield page
        assert page.complaints == []
        assert all(request.startswith(("blob:", server.address)) for request in page.requests)


def typed(page: Page, name: str, text: str) -> None:
    """Type into a field, as an input event tells it."""
    field = f"document.getElementById({json.dumps(name)})"
    page.ask(f"{field}.value = {json.dumps(text)}; {field}.dispatchEvent(new Event('input'))")


def words(page: Page, name: str) -> str:
    return page.ask(f"document.getElementById({json.dumps(name)}).innerText")


def of(tension: float) -> Any:
    return design_string(Wishes(gauge=0.254e-3, tension=tension)).chosen


def test_a_slider_changes_every_figure_and_the_address_keeps_it(page: Page) -> None:
    typed(page, "tension-slider", "40")
    page.wait("monochord.own.string.tension === 40 && !monochord.busy", PATIENCE)
    assert page.ask("document.getElementById('tension').value") == "40"
    assert page.ask("monochord.own.force_std") == pytest.approx(of(40.0).force_std)
    assert "It lacks: clearance" in words(page, "verdict")
    assert "The model demo refuses it." in words(page, "verdict")
    assert "793 Hz" in words(page, "figures")
    assert "it squeals at 1.5 mm" in words(page, "figures")
    page.call("Page.reload")
    time.sleep(0.5)
    page.wait(IDLE, PATIENCE)
    assert page.ask("monochord.own.string.tension") == 40


def test_the_recommended_string_is_taken_with_a_button(page: Page) -> None:
    assert "fastest of the" in words(page, "reasons")
    page.ask("document.getElementById('take').click()")
    page.wait("monochord.own.title === monochord.advice.title && !monochord.busy", PATIENCE)
    assert words(page, "verdict") == "It meets every wish."


def test_charts_are_drawn_and_told_in_words(page: Page) -> None:
    assert page.ask("document.querySelectorAll('#charts .uplot canvas').length") == 5
    images = [node["name"] for node in page.accessible() if node["role"] in ("image", "img")]
    for title in (
        "Fundamental of each segment",
        "Force, standard error",
        "Pairs of modes",
        "Speed and force",
    ):
        assert any(name.startswith(title) and "Infinity" not in name for name in images), title
    sliders = {node["name"] for node in page.accessible() if node["role"] == "slider"}
    assert {"Gauge, mm", "Tension, N", "Length, mm", "Sensing range, mm", "Largest press, N"} <= sliders


def test_the_sensor_is_downloaded(page: Page, tmp_path: Path) -> None:
    page.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    page.ask("document.getElementById('download').click()")
    file = tmp_path / "sensor.toml"
    wait_for(file.exists, 30.0)
    string, own = mc.load_sensor(str(file)).string, page.ask("monochord.own.string")
    assert (string.core_diameter, string.tension, string.length) == pytest.approx(
        (own["gauge"], own["tension"], own["length"])
    )


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("length", "0", "expected a number from 0.08 to 2 m"),
        ("tension", "", "expected a number from 2 to 500 N"),
        ("gauge", "-1", "expected a number from 0.0001"),
        ("range", "5000", "expected"),
        ("least", "9", "least < largest"),
    ],
)
def test_bad_input_is_one_line_and_the_page_goes_on(page: Page, name: str, text: str, line: str) -> None:
    good = page.ask(f"document.getElementById('{name}').value")
    typed(page, name, text)
    page.wait("!document.getElementById('refusal').hidden", PATIENCE)
    assert line in words(page, "refusal")
    assert "\n" not in words(page, "refusal")
    assert page.ask("document.getElementById('download').disabled")
    typed(page, name, good)
    page.wait("document.getElementById('refusal').hidden && !monochord.busy", PATIENCE)
    assert not page.ask("document.getElementById('download').disabled")


@pytest.mark.parametrize("size", SIZES)
def test_no_text_overlaps_another_or_is_cut(page: Page, size: tuple[int, int]) -> None:
    for scheme in ("light", "dark"):
        page.scheme(scheme)
        page.ask("document.getElementById('more').open = true")
        sized(page, size)
        texts = page.ask(TEXTS)
        assert len(texts) > 60
        assert overlaps(texts) == []
        assert outside(texts) == []
        assert page.ask("document.documentElement.scrollWidth") == size[0]
    page.scheme("light")
    page.size(1280, 800)
