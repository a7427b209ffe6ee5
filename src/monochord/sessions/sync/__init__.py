"""One clock: when readings were taken, and the offsets between streams."""
