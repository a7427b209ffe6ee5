"""From a dataset to a perceiver."""
