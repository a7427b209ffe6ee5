"""An evaluation as one page for people: HTML with everything in it, its tables beside the paper's figures."""

from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from itertools import chain

from monochord.evaluation.detection import Detection
from monochord.evaluation.paper import reported
from monochord.evaluation.regression import Regression, Score
from monochord.evaluation.results import CLEAN
from monochord.evaluation.scorecard import Row, Scorecard
from monochord.metrics import LIMITS, normal_coverage

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 78em; margin: 2em auto; padding: 0 1em }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums }
th, td { padding: 0.2em 0.6em; text-align: right; border-bottom: 1px solid #ddd }
td { white-space: nowrap }
th:first-child, td:first-child, th.word, td.word { text-align: left }
td.reference { color: #777; font-style: italic } small { color: #777 }
.simulated { background: #d55e00; color: white; padding: 0.1em 0.5em; border-radius: 0.2em }
.drawing { width: 100%; max-width: 62em } code { background: #f4f4f4 }
"""
SHOWN: Mapping[str, tuple[float, str]] = {"position": (1e3, "mm"), "force": (1.0, "N")}
"""How a quantity is shown: factor and unit."""
NOTHING = "-"
TOLD = ("contact", "slip", *LIMITS)
"""Estimates whose abstentions are shown."""
RULES = """
Scored are touched windows whose every sample was recorded and whose label is known; windows with the begin
or the end of a touch have no label. An abstention counts as a miss in the shares "within" and in accuracies;
mean absolute errors, correlations and areas are of what was answered, and the share answered stands beside
them. Brackets hold 95 % intervals, from drawing whole sessions anew where there are five or more, else
stretches of ten seconds. A delay counts from the begin of the first window that an event reaches into to the
end of the first one that tells it. Figures of the paper, in italics, are those of its one real sensor with a
pretrained Audio Spectrogram Transformer: a reference, measured on other sound.
"""


def page(card: Scorecard, drawings: Mapping[str, str]) -> str:
    """Return the report as the text of one HTML file that loads nothing.

    Parameters
    ----------
    card
        What the results tell.
    drawings
        Pictures as the text of SVG files, by what they show.

    Examples
    --------
    ``monochord evaluate --out FOLDER`` writes it there as ``report.html``.
    """
    mark = ' <span class="simulated">simulated</span>' if card.simulated else ""
    about = (
        f"{card.windows} windows of {1e3 * card.window:g} ms, {1e3 * card.hop:g} ms apart, "
        f"of {card.sessions} session{'' if card.sessions == 1 else 's'}."
    )
    title = f"Evaluation of {card.estimator}"
    parts = [
        f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{escape(title)}</title>",
        f"<style>{STYLE}</style></head><body>",
        f"<h1>{escape(title)}{mark}</h1><p>{escape(about)}</p>",
        *(f"<p><strong>Note:</strong> {escape(note)}</p>" for note in card.notes),
        *_regressions(card),
        *_drawings(drawings),
        *_detections(card),
        *_apart(card),
        *_trust(card),
        f"<h2>How it is scored</h2><p>{escape(RULES.strip())}</p>",
        f"<h2>Options</h2><p><code>{escape(repr(dict(card.options)))}</code></p></body></html>",
    ]
    return "\n".join(parts) + "\n"


def _regressions(card: Scorecard) -> Iterator[str]:
    for quantity in LIMITS:
        factor, unit = SHOWN[quantity]
        limit = f"within {factor * LIMITS[quantity]:g} {unit}"
        head = ["object", "condition", "windows", "answered", f"error ({unit})", limit, "r"]
        head += [f"paper ({unit})", limit, "r"]
        rows = [_regression(row, quantity) for row in card.table if row.state == "touched"]
        yield f"<h2>{quantity.capitalize()}</h2>" + _table(head, rows, words=2)
        others = [row for row in card.table if row.state != "touched" and row.condition == CLEAN]
        head[1] = "touch"
        rows = [[row.object, row.state, *_regression(row, quantity)[2:7]] for row in others]
        yield "<details><summary>At rest and sliding, clean</summary>" + _table(head[:7], rows, words=2)
        yield "</details>"


def _regression(row: Row, quantity: str) -> list[str]:
    told: Regression = getattr(row, quantity)
    factor = SHOWN[quantity][0]
    reference = reported(quantity, row.object, row.condition)
    beside = [NOTHING] * 3
    if reference is not None:
        beside = [f"{factor * reference.mae:.3g}", f"{100 * reference.within:.1f} %", f"{reference.r:.3f}"]
    return [
        row.object,
        row.condition,
        str(told.windows),
        _share(told.answered),
        _score(told.mae, factor),
        _score(told.within, 100.0, ".1f", " %"),
        _score(told.r, 1.0, ".3f"),
        *(f"~{text}" for text in beside),
    ]


def _drawings(drawings: Mapping[str, str]) -> Iterator[str]:
    if drawings:
        yield "<h2>Drawn</h2>"
    for title, svg in drawings.items():
        data = b64encode(svg.encode()).decode("ascii")
        yield f'<p><img class="drawing" alt="{escape(title)}" src="data:image/svg+xml;base64,{data}"></p>'


def _detections(card: Scorecard) -> Iterator[str]:
    head = ["windows", "yes", "answered", "told right", "area under curve"]
    head += ["events", "found", "delay p50/p90", "false alarms/min"]
    for name, held in (("contact", card.contact), ("slip", card.slip)):
        rows = [
            [body, condition, *_detection(told)]
            for body, each in held.items()
            for condition, told in each.items()
        ]
        yield f"<h2>{name.capitalize()}</h2>"
        told = any(each.answered is not None for several in held.values() for each in several.values())
        yield _table(["object", "condition", *head], rows, words=2) if told else "<p>Not estimated.</p>"
    rows = [
        [
            _speeds(band),
            condition,
            str(told.windows),
            _score(told.found, 100.0, ".1f", " %"),
            _score(told.area, 1.0, ".4f"),
        ]
        for condition, bands in card.slip_by_speed.items()
        for band, told in bands.items()
    ]
    if rows:
        yield "<h3>Slip by speed</h3><p>Sliding windows of each speed, beside all windows at rest.</p>"
        yield _table(
            ["speed (mm/s)", "condition", "windows", "told as sliding", "area under curve"], rows, words=2
        )


def _detection(told: Detection) -> list[str]:
    delay = "/".join(f"{1e3 * each:.0f}" for each in told.delay)
    return [
        str(told.windows),
        str(told.positive),
        _share(told.answered),
        _score(told.accuracy, 100.0, ".1f", " %"),
        _score(told.area, 1.0, ".4f"),
        str(told.events),
        _share(told.found),
        f"{delay} ms" if delay else NOTHING,
        NOTHING if told.false_alarms is None else f"{told.false_alarms:.2g}",
    ]


def _apart(card: Scorecard) -> Iterator[str]:
    """Yield what sessions differ in, in the clean condition."""
    head = ["", "windows", "answered", "position (mm)", "within 5 mm", "force (N)", "within 0.2 N"]
    for key, groups in card.by.items():
        if len(groups) < 2:
            continue
        rows = [[value, *_both(told)] for value, told in groups.items()]
        table = _table([key, *head[1:]], rows)
        yield f"<details><summary>By {key}</summary>{table}</details>"


def _both(told: Mapping[str, Regression]) -> list[str]:
    place, force = told["position"], told["force"]
    return [
        str(place.windows),
        _share(place.answered),
        _score(place.mae, 1e3),
        _share(place.within.value),
        _score(force.mae, 1.0),
        _share(force.within.value),
    ]


def _trust(card: Scorecard) -> Iterator[str]:
    yield "<h2>What it claims, and what is possible</h2>"
    honest = [f"{100 * normal_coverage(sigmas):.1f} %" for sigmas in (1.0, 2.0)]
    rows = [
        [
            row.object,
            row.condition,
            quantity,
            *(_share(each) for each in told.covered),
            *_bound(card, row, quantity),
        ]
        for row in card.table
        if row.state == "touched"
        for quantity, told in (("position", row.position), ("force", row.force))
        if told.covered
    ]
    head = ["object", "condition", "", f"within 1 std ({honest[0]})", f"within 2 std ({honest[1]})"]
    yield _table([*head, "times the Cramer-Rao bound (all objects)"], rows, words=3)
    floors = card.force_floor
    if floors:
        worst = max(floors.values())
        yield f"<p>Force sensor by itself: {1e3 * worst:.2g} mN mean absolute error at worst, "
        yield f"of {len(floors)} sessions' untouched stretches.</p>"
    rows = [
        [condition, name, reason, _share(share)]
        for condition, names in card.abstentions.items()
        for name, reasons in names.items()
        if name in TOLD
        for reason, share in reasons.items()
    ]
    if rows:
        table = _table(["condition", "estimate", "reason", "of touched windows"], rows, words=3)
        yield f"<details><summary>Abstentions</summary>{table}</details>"


def _bound(card: Scorecard, row: Row, quantity: str) -> list[str]:
    bound = card.bounds.get(row.condition, {}).get(quantity)
    return [NOTHING if bound is None else f"{bound.times:.0f} at {bound.ratio:g} dB"]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    """Return a table; the first `words` columns hold words, and what begins with ~ is a reference."""

    def cell(number: int, text: str, tag: str) -> str:
        kinds = ["word"] if number < words else ["reference"] if text.startswith("~") else []
        name = f' class="{kinds[0]}"' if kinds else ""
        shown = escape(text.removeprefix("~")).replace("[", "<small>[").replace("]", "]</small>")
        return f"<{tag}{name}>{shown}</{tag}>"

    lines = [
        "<tr>" + "".join(cell(at, text, tag) for at, text in enumerate(row)) + "</tr>"
        for tag, row in chain([("th", head)], (("td", row) for row in rows))
    ]
    return f"<table>{''.join(lines)}</table>"


def _score(score: Score, factor: float, form: str = ".3g", unit: str = "") -> str:
    if score.value is None:
        return NOTHING
    text = f"{factor * score.value:{form}}{unit}"
    if score.low is None or score.high is None:
        return text
    return f"{text} [{factor * score.low:{form}}, {factor * score.high:{form}}]"


def _share(value: float | None) -> str:
    return NOTHING if value is None else f"{100.0 * value:.1f} %"


def _speeds(band: str) -> str:
    return " to ".join(f"{1e3 * float(edge):g}" for edge in band.split(" to "))
