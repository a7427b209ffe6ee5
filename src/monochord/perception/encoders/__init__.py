"""Frozen networks, trained by others on other sounds, and their weights."""
