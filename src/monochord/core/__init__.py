"""Shared building blocks: units, types, errors, clock, configuration, registries, presets, windows."""
