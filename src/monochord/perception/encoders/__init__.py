"""Frozen networks that others have trained on general sounds, and their weights."""
