"""Estimates from windows of sound: features, heads, closed forms, models and their training."""

MOVED = {"ast": "monochord-encoders", "log_mel": "monochord-encoders", "yamnet": "monochord-yamnet"}
"""Features that another package of the repository has, with its name."""
