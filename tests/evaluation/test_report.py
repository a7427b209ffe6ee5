"""The page says what the scorecard says, loads nothing, and does not hide that a sound is simulated."""

import re
from base64 import b64encode
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from monochord.evaluation.report import page
from monochord.evaluation.results import Results, join
from monochord.evaluation.scorecard import scorecard
from monochord.physics.sensors import load_sensor

Oracle = Callable[..., Results]
OBJECTS = ("plastic", "plastic", "wood", "wood", "metal_tube", "allen_key")


class Tags(HTMLParser):
    """Keeps the open tags, and complains of one that is closed out of turn."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            assert name not in ("src", "href") or str(value).startswith("data:image/svg+xml;base64,")
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(name="told")
def _told(oracle: Oracle) -> Results:
    clean = oracle(objects=OBJECTS, spread=1.0)
    noisy = [
        replace(clean, trials=tuple(replace(each, noise=noise, ratio=ratio) for each in clean.trials))
        for noise in ("music", "white")
        for ratio in (0.0, 20.0)
    ]
    return join([clean, *noisy])


def text_of(results: Results) -> str:
    card = scorecard(results, string=load_sensor("prototype").string, force_floor={"take0": 0.012}, draws=20)
    return page(card, {"a line": "<svg/>"})


def test_it_is_one_whole_page_that_loads_nothing(told: Results) -> None:
    text = text_of(told)
    tags = Tags()
    tags.feed(text)
    assert tags.open == []
    assert "http" not in text
    assert b64encode(b"<svg/>").decode() in text


def test_it_says_that_sound_is_simulated_only_where_it_is(told: Results) -> None:
    mark = '<span class="simulated">simulated</span>'
    assert mark in text_of(told)
    real = replace(told, trials=tuple(replace(each, simulated=False) for each in told.trials))
    assert mark not in text_of(real)


def test_the_papers_figures_stand_beside_as_a_reference(told: Results) -> None:
    rows = re.findall(r"<tr>.*?</tr>", text_of(told))
    wood = next(row for row in rows if ">wood<" in row and ">clean<" in row)
    assert '<td class="reference">8.8</td><td class="reference">51.4 %</td>' in wood
    hiss = next(row for row in rows if ">wood<" in row and ">white 0 dB<" in row)
    assert hiss.count('<td class="reference">-</td>') == 3


def test_notes_and_names_are_shown_as_text(told: Results) -> None:
    text = text_of(replace(told, estimator="<b>bold</b>", notes=("random weights & no more",)))
    assert "<b>" not in text
    assert "random weights &amp; no more" in text


def test_what_is_not_estimated_is_said_so(told: Results) -> None:
    text = text_of(replace(told, value={name: told.value[name] for name in ("position", "force")}))
    assert "<h2>Slip</h2>\n<p>Not estimated.</p>" in text
    assert "12 mN" in text
