"""Rows of the live view: an estimate in figures, and where it lies on its scale beside the truth."""

import math
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np
from rich.text import Text

from monochord.core.types import Estimate, Truth
from monochord.core.units import Metres, Newtons
from monochord.live.sinks._string import TOUCH, TRUTH

LABEL, FAINT, WARN, BAND = "grey62", "grey42", "bold orange1", "cyan"
HARDEST: Newtons = 2.0
"""Force at the right end of its scale; what is above lies at that end."""
WORDS = {"contact": ("untouched", "touched"), "slip": ("rests", "slides")}
"""What no and yes mean of a chance."""
ESTIMATED, TRUE, BOTH = "●", "◆", "◉"
ROOMY = 72
"""Columns from which the ends of a scale are named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """What a quantity's track goes from and to, in the unit of the estimate, and how its ends are called."""

    low: float
    high: float
    left: str
    right: str

    def at(self, value: float, width: int) -> int:
        """Return the cell of a value on a track."""
        share = (value - self.low) / (self.high - self.low)
        return round(float(np.clip(share, 0.0, 1.0)) * (width - 1))


def scale_of(name: str, length: Metres) -> Scale | None:
    """Return the scale of a quantity, None where it has none.

    >>> scale_of("force", 0.2).right, scale_of("tension", 0.2)
    ('2 N', None)
    """
    if name in WORDS:
        return Scale(low=0.0, high=1.0, left="no", right="yes")
    ends = {"position": (length, f"{1e3 * length:.0f} mm"), "force": (HARDEST, f"{HARDEST:g} N")}
    if name not in ends:
        return None
    high, right = ends[name]
    return Scale(low=0.0, high=high, left="0", right=right)


def chance_in_words(name: str, probability: float) -> tuple[str, str]:
    """Return the likelier answer, and how likely it is.

    >>> chance_in_words("slip", 0.03)
    ('rests', '97 %')
    """
    share = max(probability, 1.0 - probability)
    digits = 0 if share < 0.99 else 1
    # Rounding must not make a certainty of what is none.
    return WORDS[name][probability >= 0.5], f"{math.floor(share * 1000.0) / 10.0:.{digits}f} %"


def track(scale: Scale, estimate: Estimate, truth: float | None, width: int) -> Text:
    """Return the track: estimate, one standard error to each side, and the truth where it is known."""
    cells, styles = ["─"] * width, [FAINT] * width
    if estimate.valid and math.isfinite(estimate.std):
        first = scale.at(estimate.value - estimate.std, width)
        for cell in range(first, scale.at(estimate.value + estimate.std, width) + 1):
            cells[cell], styles[cell] = "━", BAND
    if truth is not None:
        cell = scale.at(truth, width)
        cells[cell], styles[cell] = TRUE, TRUTH
    if estimate.valid:
        cell = scale.at(estimate.value, width)
        cells[cell], styles[cell] = (BOTH if cells[cell] == TRUE else ESTIMATED), TOUCH
    line = Text()
    for style, alike in groupby(zip(cells, styles, strict=True), key=itemgetter(1)):
        line.append("".join(cell for cell, _ in alike), style)
    return line


def known(name: str, truth: Truth) -> float | None:
    """Return what is true of a quantity; None where that is not known, or nothing touches."""
    if name != "contact" and not truth.get("contact", 1.0):
        return None
    value = truth.get(name, math.nan)
    return value if math.isfinite(value) else None


def legend(truth: Truth) -> Text:
    """Return what the marks of a track mean."""
    line = Text.assemble(("  ", ""), (ESTIMATED, TOUCH), (" estimate  ", FAINT), ("━", BAND))
    line.append(" one standard error to each side", FAINT)
    if truth:
        line.append("  ").append(TRUE, TRUTH).append(" truth  ", FAINT)
        line.append(BOTH, TOUCH).append(" both", FAINT)
    return line
