"""The figure of the real strings shows what the benchmark says."""

import numpy as np
import pytest

from monochord.evaluation import realstrings
from monochord.figures.realstrings import Realstrings, string_errors

pytestmark = pytest.mark.skipif(
    realstrings.folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)"
)


def test_every_string_with_an_open_note_is_shown() -> None:
    found = string_errors()
    assert len(found) >= 2
    errors = np.concatenate([e for takes in found.values() for _, e in takes])
    assert np.nanmean(np.abs(errors)) < 1.6e-3


def test_panels_axes_and_curves() -> None:
    page = Realstrings(ratios=(20.0,)).draw()
    errors, curves = page.axes
    assert errors.get_xlabel() == "fret position x (mm)"
    assert curves.get_xlabel() == "signal-to-noise ratio (dB)"
    assert len(curves.lines) == 3 * len(realstrings.takes(kind="interference"))
