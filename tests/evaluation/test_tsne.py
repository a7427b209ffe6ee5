"""Neighbours stay neighbours: groups stay apart, a curve stays one, the same rows give the same places."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.evaluation.tsne import affinities, tsne

STREAM = np.random.default_rng(0)


def nearest(places: Floats, count: int) -> np.ndarray:
    apart = ((places[:, None] - places) ** 2).sum(axis=2)
    np.fill_diagonal(apart, np.inf)
    return apart.argsort(axis=1)[:, :count]


def test_groups_stay_apart() -> None:
    middle = 3.0 * STREAM.normal(size=(4, 20))
    rows = np.repeat(middle, 50, axis=0) + STREAM.normal(size=(200, 20))
    group = np.repeat(np.arange(4), 50)
    places = tsne(rows, perplexity=15.0, steps=400)
    assert (group[nearest(places, 10)] == group[:, None]).mean() > 0.99


def test_what_lies_along_a_curve_stays_in_its_order() -> None:
    along = np.sort(STREAM.uniform(0.0, 6.0, 150))
    rows = np.column_stack([np.sin(along), np.cos(along), along, 0.01 * STREAM.normal(size=150)])
    places = tsne(rows[:, :3], perplexity=10.0, steps=400)
    assert np.abs(nearest(places, 2) - np.arange(150)[:, None]).mean() < 3.0


def test_units_and_columns_that_never_vary_do_not_matter() -> None:
    rows = STREAM.normal(size=(60, 5))
    places = tsne(rows, perplexity=10.0, steps=250)
    same = np.column_stack([1024.0 * rows, np.full(60, 7.0)])
    np.testing.assert_array_equal(tsne(same, perplexity=10.0, steps=250), places)


def test_each_row_has_as_many_neighbours_as_asked_for() -> None:
    near, far = STREAM.normal(size=(90, 4)), 1e3 + STREAM.normal(size=(30, 4))
    likeness = affinities(np.concatenate([near, far]), 12.0)
    np.testing.assert_allclose(likeness.sum(axis=1), 1.0, atol=1e-12)
    assert (np.diag(likeness) == 0.0).all()
    entropy = -np.sum(likeness * np.log(np.maximum(likeness, 1e-300)), axis=1)
    np.testing.assert_allclose(np.exp(entropy), 12.0, rtol=1e-4)


def test_one_column_and_equal_rows_will_do() -> None:
    assert np.isfinite(tsne(STREAM.normal(size=(40, 1)), perplexity=5.0, steps=250)).all()
    twins = np.repeat(STREAM.normal(size=(20, 3)), 2, axis=0)
    assert np.isfinite(tsne(twins, perplexity=5.0, steps=250)).all()


def test_what_cannot_be_laid_out_is_refused() -> None:
    some = STREAM.normal(size=(30, 3))
    with pytest.raises(InputError, match="perplexity 10: allowed is above 1, below a third of 30 rows"):
        tsne(some, perplexity=10.0)
    with pytest.raises(InputError, match="of numbers"):
        tsne(np.where(some > 2.0, some, np.nan))
    with pytest.raises(InputError, match="30 rows that are all alike"):
        tsne(np.ones((30, 3)), perplexity=5.0)
    with pytest.raises(InputError, match="5001 rows: allowed is 5000 at most"):
        tsne(np.zeros((5001, 1)))
    with pytest.raises(InputError, match="10 steps: allowed is 250 or more"):
        tsne(some, perplexity=5.0, steps=10)
