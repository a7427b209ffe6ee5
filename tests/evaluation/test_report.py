"""The report is one HTML page that shows the scores and loads nothing."""

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


class Page(HTMLParser):
    """The cells of every table row; refuses tags that are closed out of order and links to elsewhere."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.marks: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            assert name not in ("src", "href") or str(value).startswith("data:image/svg+xml;base64,")
            self.marks += [str(value)] if (tag, name) == ("span", "class") else []
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data.strip()

    def row(self, *begin: str) -> list[str]:
        return next(row for row in self.rows if row[: len(begin)] == list(begin))


@pytest.fixture(name="results", scope="module")
def _results(oracle: Oracle) -> Results:
    clean = oracle(objects=OBJECTS, spread=1.0)
    noisy = [
        replace(clean, trials=tuple(replace(each, noise=noise, ratio=ratio) for each in clean.trials))
        for noise in ("music", "white")
        for ratio in (0.0, 20.0)
    ]
    return join([clean, *noisy])


def text_of(results: Results, baselines: dict[str, Results] | None = None) -> str:
    string = load_sensor("prototype").string
    card = scorecard(results, baselines=baselines, string=string, force_floor={"take0": 0.012}, draws=20)
    return page(card, {"a line": "<svg/>"})


def test_it_holds_its_figures_and_the_papers_beside_the_scores(results: Results) -> None:
    text = text_of(results, {"extra_trees": results})
    shown = Page(text)
    assert "http" not in text
    assert b64encode(b"<svg/>").decode() in text
    assert shown.marks == ["simulated"]
    assert shown.row("wood", "clean", "oracle")[8:] == ["8.8", "51.4 %", "0.863"]
    assert shown.row("wood", "white 0 dB", "oracle")[8:] == ["-", "-", "-"]
    row = shown.rows.index(shown.row("wood", "clean", "oracle"))
    assert shown.rows[row + 1][2:8] == ["extra trees", *shown.rows[row][3:8]]


def test_names_are_escaped_and_what_is_missing_is_left_out(results: Results) -> None:
    real = tuple(replace(trial, simulated=False) for trial in results.trials)
    value = {name: results.value[name] for name in ("position", "force")}
    text = text_of(replace(results, estimator="<b>bold</b>", notes=("a & b",), trials=real, value=value))
    assert Page(text).marks == []
    assert "<b>" not in text
    assert "a &amp; b" in text
    assert text.count("Not estimated.") == 2
