"""A recording on disk."""
