"""Figures: one module per figure, found by name; `_style` holds their common look."""

from monochord.core.registry import Registry
from monochord.figures import _style as style
from monochord.figures._style import COLOURS
from monochord.figures.base import Figure

FIGURES: Registry[Figure] = Registry("monochord.figures", Figure)

__all__ = ["COLOURS", "FIGURES", "style"]
