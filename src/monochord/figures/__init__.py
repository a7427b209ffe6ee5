"""Figures for people: one file a figure, found by its name; `style` is the look that they share."""

from monochord.core.registry import Registry
from monochord.figures import _style as style
from monochord.figures._style import COLOURS
from monochord.figures.base import Figure

FIGURES: Registry[Figure] = Registry("monochord.figures", Figure)

__all__ = ["COLOURS", "FIGURES", "style"]
