"""The report of a bring-up: one self-contained HTML page with plots, to send to a colleague."""

from collections.abc import Mapping, Sequence
from importlib.resources import files

import numpy as np

from monochord.bringup.check import Take
from monochord.bringup.examine import BringUp, number
from monochord.bringup.inputs import line_levels
from monochord.core.types import Floats

TEMPLATE = "page.html.jinja"
WIDTH, HEIGHT, MARGIN = 560.0, 150.0, 34.0
"""Size of a plot and of its margins, in pixels."""
POINTS = 280
"""Points of a curve."""
COLOURS = "#0072b2", "#d55e00"
"""Colours of the two microphones."""
LOWEST_DB, TOP_HZ = -110.0, 16000.0


def page(result: BringUp) -> str:
    """Return the report as the text of one HTML file.

    Examples
    --------
    ``monochord doctor --sensor prototype --source twin --out mine.toml`` writes it as ``mine.html``.
    """
    import jinja2  # noqa: PLC0415

    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    text = files("monochord.bringup").joinpath(TEMPLATE).read_text(encoding="utf-8")
    plots = {step: (_level_plot(take), _spectrum_plot(take)) for step, take in result.takes.items()}
    return environment.from_string(text).render(
        result=result, number=number, plots=plots, marks={True: "ok", False: "failed", None: "left out"}
    )


def _level_plot(take: Take) -> str:
    """Return the level of both microphones over time, in dBFS, as SVG."""
    size = max(1, take.samples.shape[1] // POINTS)
    count = take.samples.shape[1] // size
    frames = take.samples[:, : count * size].reshape(2, count, size).astype(np.float64)
    levels = 20.0 * np.log10(np.sqrt((frames**2).mean(axis=2)) + 1e-9)
    time = (np.arange(count) + 0.5) * size / take.sample_rate
    seconds = take.samples.shape[1] / take.sample_rate
    return _plot(time, levels, (0.0, seconds), "s", "level (dBFS)")


def _spectrum_plot(take: Take) -> str:
    """Return the spectrum of the last second of both microphones, in dBFS, as SVG."""
    end = take.samples[:, -take.sample_rate :]
    lines = line_levels(end)
    top = min(TOP_HZ, 0.5 * take.sample_rate)
    lines = lines[:, : int(top * end.shape[1] / take.sample_rate)]
    size = max(1, lines.shape[1] // POINTS)
    count = lines.shape[1] // size
    highest = lines[:, : count * size].reshape(2, count, size).max(axis=2)
    frequency = (np.arange(count) + 0.5) * size * take.sample_rate / end.shape[1]
    return _plot(frequency / 1e3, 20.0 * np.log10(highest + 1e-9), (0.0, top / 1e3), "kHz", "line (dBFS)")


def _plot(x: Floats, curves: Floats, span: tuple[float, float], unit: str, label: str) -> str:
    wide, high = WIDTH - 2.0 * MARGIN, HEIGHT - 2.0 * MARGIN

    def place(value: float) -> float:
        return MARGIN + wide * (value - span[0]) / (span[1] - span[0])

    def level(value: float) -> float:
        return MARGIN + high * min(1.0, max(0.0, value / LOWEST_DB))

    parts = [f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{label}">']
    parts += [
        f'<line x1="{MARGIN:g}" x2="{WIDTH - MARGIN:g}" y1="{level(at):.1f}" y2="{level(at):.1f}" '
        f'stroke="#ddd"/>'
        f'<text x="{MARGIN - 4.0:g}" y="{level(at) + 4.0:.1f}" text-anchor="end">{at:g}</text>'
        for at in (0.0, -50.0, -100.0)
    ]
    parts += [
        f'<text x="{place(at):.1f}" y="{HEIGHT - 14.0:g}" text-anchor="middle">{at:.3g} {unit}</text>'
        for at in np.linspace(*span, 5)
    ]
    parts.append(f'<text x="{MARGIN:g}" y="18">{label}</text>')
    for curve, colour in zip(curves, COLOURS, strict=True):
        points = " ".join(f"{place(a):.1f},{level(b):.1f}" for a, b in zip(x, curve, strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1"/>')
    return "".join([*parts, "</svg>"])


def rows(result: BringUp) -> Sequence[Mapping[str, object]]:
    """Return the checks as plain values, as ``--json`` prints them."""
    return [
        {
            "step": check.step,
            "name": check.name,
            "value": check.value,
            "unit": check.unit,
            "passed": check.passed,
            "fault": check.fault,
            "advice": check.advice,
        }
        for check in result.checks
    ]
