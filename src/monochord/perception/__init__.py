"""Estimates from windows of sound: features, encoders, heads, closed forms, models and their training."""

MOVED = {"yamnet": "it is a package of its own: pip install ./packages/monochord-yamnet, in the repository"}
"""Features that another package provides, with how to install each."""
