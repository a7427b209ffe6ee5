"""Groups are assigned by their shares, in each stratum too."""

import numpy as np
import pytest

from monochord.datasets._strategies import assign_groups


def shares(part: np.ndarray, sizes: np.ndarray, count: int) -> np.ndarray:
    return np.bincount(part, weights=sizes, minlength=count) / sizes.sum()


@pytest.mark.parametrize("seed", range(5))
def test_shares_are_met_in_all_and_in_every_stratum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(50, 150, 200)
    strata = [f"kind{number % 4}" for number in range(200)]
    part = assign_groups(sizes, strata, (0.7, 0.15, 0.15), rng)
    assert shares(part, sizes, 3) == pytest.approx([0.7, 0.15, 0.15], abs=0.02)
    for each in set(strata):
        own = np.array([name == each for name in strata])
        assert shares(part[own], sizes[own], 3) == pytest.approx([0.7, 0.15, 0.15], abs=0.05)


@pytest.mark.parametrize("seed", range(10))
def test_every_part_gets_a_group_where_there_are_enough(seed: int) -> None:
    part = assign_groups([100, 100, 1], ["a"] * 3, (0.9, 0.05, 0.05), np.random.default_rng(seed))
    assert sorted(part.tolist()) == [0, 1, 2]
    lonely = [assign_groups([5], [""], (0.8, 0.2), np.random.default_rng(seed)).tolist()]
    assert lonely == [[0]]


def test_a_share_of_nought_gets_nothing_and_no_groups_are_fine() -> None:
    assert 1 not in assign_groups([1] * 50, [""] * 50, (0.5, 0.0, 0.5), np.random.default_rng(0))
    assert assign_groups([], [], (0.5, 0.5), np.random.default_rng(0)).size == 0


def test_the_order_is_drawn() -> None:
    splits = {
        tuple(assign_groups([1] * 9, [""] * 9, (0.6, 0.4), np.random.default_rng(seed)).tolist())
        for seed in range(9)
    }
    assert len(splits) > 4
