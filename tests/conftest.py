"""Settings for all tests."""

from hypothesis import settings

# A time limit for each example fails on a machine that is busy, and says nothing of the code.
settings.register_profile("monochord", deadline=None)
settings.load_profile("monochord")
