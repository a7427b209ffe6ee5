"""Segments, and the shapes that live on them."""

import numpy as np
import pytest

from monochord.core.types import Contact
from monochord.physics.split_string.segments import (
    drive_density,
    gaussian_modes,
    pluck_amplitudes,
    split,
    support,
)
from monochord.physics.split_string.setup import Drive, Pluck, SplitString
from monochord.physics.strings import load_string
from monochord.physics.theory import geometric_tension, segment_frequencies

APPENDIX = load_string("appendix").string


def test_a_touch_makes_two_segments_with_the_closed_form_fundamentals() -> None:
    contact = Contact(position=0.2275, force=1.5)
    first, second = split(SplitString(string=APPENDIX, contact=contact))
    fundamentals = [segment.speed / (2.0 * segment.length) for segment in (first, second)]
    assert fundamentals == pytest.approx(segment_frequencies(APPENDIX, contact), rel=1e-12)
    assert (first.channels, second.channels) == (slice(0, 1), slice(1, 2))
    assert (second.origin, second.direction) == (APPENDIX.length, -1)


def test_an_untouched_string_is_one_segment_that_carries_both_ends_mirrored() -> None:
    (whole,) = split(SplitString(string=APPENDIX))
    assert whole.length == APPENDIX.length
    assert whole.pickups == pytest.approx((0.25 * 0.65, 0.75 * 0.65))
    assert whole.channels == slice(0, 2)


def test_the_geometric_law_sets_the_speed() -> None:
    string, contact = load_string("plain_010").string, Contact(position=0.2, force=2.0)
    first, _ = split(SplitString(string=string, contact=contact, tension_law="geometric"))
    tension = geometric_tension(string, 0.2, 2.0)
    assert first.speed**2 * string.linear_density == pytest.approx(tension, rel=1e-12)


@pytest.mark.parametrize("place", [0.25, 0.01])
def test_a_normalised_driver_pushes_with_its_amplitude_wherever_it_stands(place: float) -> None:
    drive = Drive(amplitude=0.003, place=place)
    segment, _ = split(SplitString(string=APPENDIX, contact=Contact(position=0.2, force=0.0), drive=drive))
    nodes, weights = support(drive, segment, segment.drivers[0])
    assert weights @ drive_density(drive, segment, segment.drivers[0], nodes) == pytest.approx(
        0.003, rel=1e-9
    )


def test_a_printed_driver_pushes_its_middle_node_with_its_amplitude() -> None:
    drive = Drive(amplitude=0.003, profile="printed")
    segment, _ = split(SplitString(string=APPENDIX, contact=Contact(position=0.2, force=0.0), drive=drive))
    middle = np.array([segment.drivers[0]])
    force = drive_density(drive, segment, segment.drivers[0], middle) * segment.spacing
    assert force == pytest.approx(0.003)


def test_a_pluck_sums_to_its_rounded_triangle() -> None:
    pluck = Pluck(height=1e-3, place=0.3, width=1e-3)
    (whole,) = split(SplitString(string=APPENDIX))
    count = gaussian_modes(pluck.width, whole.length)
    places = np.array([0.0, 0.1, 0.3, 0.8]) * whole.length
    waves = np.sin(np.outer(places, np.arange(1, count + 1)) * np.pi / whole.length)
    shape = waves @ pluck_amplitudes(pluck, whole, count)
    assert shape[[0, 1, 3]] == pytest.approx([0.0, 1e-3 / 3.0, 1e-3 * 2.0 / 7.0], rel=1e-6, abs=1e-12)
    assert 0.99e-3 < shape[2] < 1e-3  # the tip alone is rounded
