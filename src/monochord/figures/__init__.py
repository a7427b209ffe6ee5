"""Figures for people: one file a figure, found by its name."""

from monochord.core.registry import Registry
from monochord.figures.base import Figure

FIGURES: Registry[Figure] = Registry("monochord.figures", Figure)

__all__ = ["FIGURES"]
