"""A segment laid out on its grid."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.errors import InputError
from monochord.physics.split_string import Pluck, SplitString
from monochord.physics.split_string.grid import lay_out, refuse_unstable
from monochord.physics.split_string.reference import leapfrog
from monochord.physics.split_string.segments import split
from monochord.physics.strings import load_string

APPENDIX = load_string("appendix")
SETUP = SplitString(string=APPENDIX.string, contact=APPENDIX.contact, nodes=101, pluck=Pluck(width=1e-3))


def test_a_plucked_segment_starts_as_a_triangle_at_rest() -> None:
    grid = lay_out(SETUP, split(SETUP)[0])
    assert grid.now.max() == pytest.approx(SETUP.pluck.height, rel=0.02)
    assert np.argmax(grid.now) == 40
    assert grid.now[20] == pytest.approx(SETUP.pluck.height / 2.0, rel=1e-6)
    silent, heard = np.zeros((2, 2)), np.zeros((2, 2))
    grid.step(leapfrog, silent, heard)
    assert abs(heard[0, 0]) < 1e-12 * SETUP.pluck.height  # y(dt) = y(-dt)
    assert heard[1].tolist() == [0.0, 0.0]  # the other segment's ear is left alone


def test_the_newest_displacement_is_at_hand_after_odd_and_even_numbers_of_steps() -> None:
    whole, parted = (lay_out(SETUP, split(SETUP)[0]) for _ in range(2))
    heard = np.zeros((2, 6))
    whole.step(leapfrog, np.zeros((2, 6)), heard)
    again = [np.zeros((2, n)) for n in (1, 3, 2)]
    for part in again:
        parted.step(leapfrog, np.zeros_like(part), part)
    assert parted.now.tolist() == whole.now.tolist()
    assert np.concatenate(again, axis=1).tolist() == heard.tolist()


def test_an_unstable_step_is_refused_with_its_limit_and_the_remedy_works() -> None:
    segment = split(SETUP)[0]
    limit = 0.95 * (0.2275 / 100) / 316.2278
    wild = replace(SETUP, time_step=limit * 1.0001)
    with pytest.raises(InputError, match=rf"below {limit:.4g} s = 0.95 dxi/v.*at most 100 nodes") as refusal:
        refuse_unstable(wild, segment)
    assert "\n" not in str(refusal.value)
    remedied = replace(wild, nodes=100)
    refuse_unstable(remedied, split(remedied)[0])
    refuse_unstable(replace(SETUP, time_step=limit * 0.9999), segment)
