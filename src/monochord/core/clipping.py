"""When sound is clipped: at a sample of a recording, at an input, and in a window too clipped to trust."""

FULL_SCALE = 0.999
"""Absolute value from which a recorded sample is at full scale and counts as clipped; 16-bit samples reach
0.99997. Below, a sample is taken for what it is, and a dataset may learn from it."""
LOUD, LOUD_SHARE = 0.98, 1e-3
"""Absolute value, and share of a channel's samples there, from which its gain is too high: the sound is
called clipped. Some converters limit below full scale, and resampling moves the samples of a top that was
cut off. Single shocks reach it, too."""
DISTORTED_SHARE = 0.1
"""Share of samples at a window's own lowest and highest value from which nothing is estimated. A stage before
the converter may cut off sound far below full scale."""
