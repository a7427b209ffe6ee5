"""Figures for people: one file a figure, found by its name."""

from monochord.figures.base import Figure
from monochord.registry import Registry

FIGURES: Registry[Figure] = Registry("monochord.figures", Figure)

__all__ = ["FIGURES"]
