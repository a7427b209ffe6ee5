"""From a window to estimates: features, encoders, heads, closed forms, models and their training."""
