"""The sensing range on the page in a real Chromium: drawn where it is known; a touch outside has no place."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from tests.e2e.browser import Page, chromium, opened
from tests.e2e.press_anywhere import Count, pressed, zones
from tests.e2e.test_web import READY, String, demonstration
from tests.live.web.run_server import RunServer
from tests.live.web.test_server import LENGTH, SIGNAL, update

from monochord.lab.demonstration import ruled_length, twin_options
from monochord.physics.sensors import load_sensor
from monochord.physics.setup import lengthened

pytestmark = [
    pytest.mark.slow,
    pytest.mark.real_time,
    pytest.mark.timeout(600),
    pytest.mark.skipif(chromium() is None, reason="Chromium is not installed (Debian: apt install chromium)"),
]
OUTSIDE = "outside the sensing range"
PLACES = (30.0, 45.0, 80.0, 120.0, 160.0)
HOLD = 1.5
SENSOR = load_sensor("prototype")
LOW, HIGH = SENSOR.range
COLOURS = """((places) => {
    const v = monochord.view, ratio = v.canvas.width / v.width;
    const pixel = (x) => v.context.getImageData(ratio * v.pixel(x, monochord.run.length), ratio * 40, 1, 1);
    return places.map((x) => [...pixel(x).data].join());})"""
"""Colours of the canvas above the string, at places in m."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with demonstration(tmp_path_factory.mktemp("page")) as started, opened(started.address) as page:
        page.size(1200, 900)
        page.wait(READY)
        yield page
        assert page.complaints == []


@pytest.fixture(scope="module")
def counts(page: Page) -> dict[float, Count]:
    page.size(1200, 900)
    return pressed(page, PLACES, HOLD)


def texts(page: Page) -> dict[str, Any]:
    return page.ask("""(() => {
        const of = (id) => document.getElementById(id), text = (node) => node.firstChild?.textContent;
        return {
            where: of("where").textContent.replaceAll("\\u00a0", " "),
            legend: ["range", "drivers"].map((name) => !of(`legend-${name}`).hidden),
            position: [...of("reading-position").children].slice(1).map(text),
            presence: monochord.view.shown.presence,
        };})()""")


def test_the_sensing_range_is_a_band_behind_the_string(page: Page) -> None:
    page.size(390, 844, scale=2.0, mobile=True)
    page.ask("document.getElementById('string').scrollIntoView({block: 'nearest'})")
    page.ask("new Promise((done) => setTimeout(done, 300))")
    inside, outside = [LOW + 2e-3, 0.085, HIGH - 2e-3], [0.01, LOW - 2e-3, HIGH + 2e-3, 0.195]
    band, paper = (set(page.ask(f"{COLOURS}({places})")) for places in (inside[::2], outside))
    assert band.isdisjoint(paper)
    assert texts(page)["legend"] == [True, True]
    length = ruled_length(twin_options("prototype", 0))
    assert page.ask("monochord.run.length") == length
    drivers = [[each.sense, each.drive] for each in lengthened(SENSOR, length / SENSOR.string.length).drivers]
    assert np.allclose(page.ask("monochord.run.drivers"), drivers, atol=1e-9)
    assert page.ask("monochord.run.range") == [LOW, HIGH]
    page.size(1200, 900)


def test_of_an_unknown_sensor_nothing_is_drawn_or_said() -> None:
    with (
        RunServer(port=0) as server,
        server.show(SIGNAL, LENGTH, None) as writer,
        opened(server.address) as page,
    ):
        page.size(1200, 900)
        page.wait("window.monochord?.run ? 1 : 0")
        writer.write(update(5))
        page.wait(READY)
        page.wait("monochord.counts.drawn > 0")
        assert page.ask("[monochord.run.range, monochord.run.drivers]") == [None, []]
        assert len(set(page.ask(f"{COLOURS}({[0.01, 0.04, 0.06, 0.19]})"))) == 1
        told = texts(page)
        assert told["legend"] == [False, False]
        assert "mm" not in told["where"]


def test_a_typed_touch_outside_the_range_is_refused_where_it_is_typed(page: Page) -> None:
    valid = page.ask("""(() => { const place = document.getElementById("known-position");
        return ["49", "50", "100", "150", "150.5"].map((value) => {
            place.value = value;
            place.dispatchEvent(new Event("input"));
            return place.checkValidity(); });})()""")
    assert valid == [False, True, True, True, False]


def test_the_table_counts_every_place(counts: dict[float, Count]) -> None:
    assert [*counts] == [*PLACES]
    for place, count in counts.items():
        assert count.moments > 20, place
        assert count.answered + count.reasons.total() == count.moments
        assert count.contact_wrong <= 0.05 * count.moments, place


def test_no_position_is_far_off_inside_the_range_and_there_is_none_outside(
    counts: dict[float, Count],
) -> None:
    zone = zones(counts, SENSOR.range)
    inside, outside = zone["inside"], zone["outside"]
    assert inside.answered > 0
    assert inside.far <= 0.005 * inside.moments
    assert inside.shown_far <= 0.005 * inside.moments
    assert (outside.answered, outside.shown) == (0, 0)
    assert outside.reasons.most_common(1)[0][0] == OUTSIDE


def test_outside_the_range_contact_is_shown_without_a_place(page: Page) -> None:
    string, share = String(page), 0.03 / SENSOR.string.length
    page.wait("monochord.moment.decided.contact === false")  # what is spoken may be a note of before
    string.mouse("mousePressed", share)
    try:
        page.wait("monochord.moment.decided.contact && monochord.view.shown.withheld > 0.9", 10.0)
        page.wait(
            f"document.getElementById('spoken').textContent.includes('{OUTSIDE}')", 10.0
        )  # state or note
        told = texts(page)
    finally:
        string.mouse("mouseReleased", share)
    assert told["position"] == ["\N{EN DASH}", OUTSIDE]
    assert told["presence"] < 0.05
    page.wait("monochord.moment.truth.contact === 0")
