"""From a window to estimates: features, encoders, heads, closed forms, models and their training."""

MOVED = {"yamnet": "it is a package of its own: pip install ./studies/monochord-yamnet, in the repository"}
"""Features, and their weights, that are in another package now, each with the way to get it."""
