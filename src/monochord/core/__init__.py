"""The vocabulary: units, types, errors, clock, configuration, registries, presets, windows."""
