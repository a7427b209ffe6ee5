"""The report of an evaluation: one self-contained HTML page, with the paper's figures in its tables."""

from base64 import b64encode
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from monochord.evaluation.paper import reported
from monochord.evaluation.scorecard import QUANTITIES, Scorecard
from monochord.evaluation.scores import Detection
from monochord.metrics import LIMITS, normal_coverage

TEMPLATE = "report.html.jinja"
UNITS: Mapping[str, tuple[float, str]] = {"position": (1e3, "mm"), "force": (1.0, "N")}
"""Scale factor from SI, and display unit, of a quantity."""


def page(card: Scorecard, drawings: Mapping[str, str]) -> str:
    """Return the report of a scorecard as the text of one HTML file, with `drawings` as SVG texts by title.

    ``monochord evaluate --out FOLDER`` writes it there as ``report.html``.
    """
    import jinja2  # noqa: PLC0415

    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    text = files("monochord.evaluation").joinpath(TEMPLATE).read_text(encoding="utf-8")
    template = environment.from_string(text)
    names = ("contact", "slip", *QUANTITIES)
    return template.render(
        card=card,
        quantities={name: _shown(name) for name in QUANTITIES},
        drawings={title: b64encode(svg.encode()).decode("ascii") for title, svg in drawings.items()},
        reported=reported,
        estimated=_is_estimated,
        normal=[normal_coverage(sigmas) for sigmas in (1.0, 2.0)],
        speeds=[
            (_millimetres(band), condition, scores)
            for condition, bands in card.slip_by_speed.items()
            for band, scores in bands.items()
        ],
        abstentions=[
            (condition, name, reason, share)
            for condition, by_name in card.abstentions.items()
            for name, reasons in by_name.items()
            if name in names
            for reason, share in reasons.items()
        ],
        options=repr(dict(card.options)),
    )


def _shown(quantity: str) -> dict[str, Any]:
    factor, unit = UNITS[quantity]
    return {"factor": factor, "unit": unit, "within": f"within {factor * LIMITS[quantity]:g} {unit}"}


def _is_estimated(scores: Mapping[str, Mapping[str, Detection]]) -> bool:
    return any(one.answered is not None for by_condition in scores.values() for one in by_condition.values())


def _millimetres(band: str) -> str:
    return " to ".join(f"{1e3 * float(edge):g}" for edge in band.split(" to "))
