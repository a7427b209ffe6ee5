"""A segment laid out on its grid."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.split_string import Pluck, SplitString
from monochord.physics.split_string.grid import lay_out, time_step
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
    limit = 0.95 * (0.2275 / 100) / 316.2278
    wild = replace(SETUP, time_step=limit * 1.0001)
    with pytest.raises(InputError, match=rf"below {limit:.4g} s = 0.95 dxi/v.*at most 100 nodes") as refusal:
        time_step(wild)
    assert "\n" not in str(refusal.value)
    for part in ("--set time_step=1e-06", "--route modal"):
        assert part in str(refusal.value)
    assert time_step(replace(wild, nodes=100)) == wild.time_step
    assert time_step(replace(SETUP, time_step=limit * 0.9999)) == limit * 0.9999


@pytest.mark.parametrize(
    ("nodes", "step"), [(8, 1e-6), (256, 1e-6), (1001, 1e-6 / 2), (5001, 1e-6 / 8), (60001, 1e-6 / 88)]
)
def test_a_step_left_open_is_the_appendixs_or_a_whole_fraction_of_it(nodes: int, step: float) -> None:
    assert time_step(replace(SETUP, nodes=nodes)) == pytest.approx(step, rel=1e-12)


def test_a_grid_too_fine_for_any_step_is_refused() -> None:
    close = replace(SETUP, contact=Contact(position=1e-4, force=0.0))
    with pytest.raises(InputError, match=r"steps of 1e-08 s or more; set fewer nodes, or take --route modal"):
        time_step(close)
