"""What is left of the vibration when the touch changes."""

import numpy as np
import pytest

from monochord.core.types import Contact, Floats
from monochord.physics.split_string import SplitString
from monochord.physics.split_string.carry_over import carry_over
from monochord.physics.split_string.modes import ModalString, find_modes, plucked
from monochord.physics.strings import load_string

STRING = load_string("appendix").string
PLUCKED = SplitString(string=STRING, contact=Contact(position=0.2, force=0.0))
OPEN = SplitString(string=STRING)


def shape(string: ModalString, q: Floats, places: Floats) -> Floats:
    result, first = np.zeros(places.size), 0
    for segment, count in zip(string.segments, string.counts, strict=True):
        local = (places - segment.origin) * segment.direction
        inside = (local > 0.0) & (local < segment.length)
        waves = np.sin(np.outer(local, np.arange(1, count + 1)) * np.pi / segment.length)
        result += np.where(inside, waves @ q[first : first + count], 0.0)
        first += count
    return result


def test_nothing_changes_when_the_segments_stay() -> None:
    string = find_modes(PLUCKED, 44100)
    q = plucked(PLUCKED.pluck, string)
    q_after, v_after = carry_over(string, q, q * 1000.0, string)
    assert q_after == pytest.approx(q, abs=1e-12 * np.abs(q).max())
    assert v_after == pytest.approx(q * 1000.0, abs=1e-9 * np.abs(q).max())


def test_a_release_keeps_the_shape() -> None:
    touched, free = find_modes(PLUCKED, 44100), find_modes(OPEN, 44100)
    q = plucked(PLUCKED.pluck, touched)
    q_after, _ = carry_over(touched, q, q, free)
    places = np.linspace(0.01, 0.64, 60)
    # The kink at the old touch is rounded by the end of the audio band, and no more than that.
    assert shape(free, q_after, places) == pytest.approx(shape(touched, q, places), abs=0.05e-4)
    assert np.abs(shape(free, q_after, places)).max() > 0.9e-4


def test_a_new_touch_takes_the_string_to_rest_there_along_the_static_triangle() -> None:
    free, touched = find_modes(OPEN, 44100), find_modes(PLUCKED, 44100)
    q = plucked(OPEN.pluck, free)
    q_after, _ = carry_over(free, q, q, touched)
    places = np.linspace(0.005, 0.645, 120)
    depth = shape(free, q, np.array([0.2]))[0]
    ramp = np.interp(places, [0.0, 0.2, 0.65], [0.0, 1.0, 0.0])
    expected = shape(free, q, places) - depth * ramp
    assert depth > 0.5e-4
    assert shape(touched, q_after, places) == pytest.approx(expected, abs=0.01e-4)
