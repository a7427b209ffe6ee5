"""Frozen networks that others trained: their weights, and what runs them."""
