"""Features of a sound: an array whose columns have names."""

import copy
import pickle

import numpy as np
import pytest

import monochord as mc
from monochord.core.errors import InputError
from monochord.perception.data import FeatureRows


@pytest.fixture(scope="module")
def rows() -> FeatureRows:
    sound = np.random.default_rng(0).normal(size=(2, 8820)).astype(np.float32)
    return mc.features(0.1 * sound, sensor="prototype")


def test_columns_have_names_and_the_array_is_one(rows: FeatureRows) -> None:
    assert isinstance(rows, np.ndarray)
    assert rows.shape == (11, 300)
    assert rows.dtype == np.float32
    assert len(rows.columns) == len(set(rows.columns)) == 300
    assert type(rows.values) is np.ndarray
    assert np.array_equal(rows.column(rows.columns[7]), rows.values[:, 7])
    with pytest.raises(InputError, match="nonsense"):
        rows.column("nonsense")


def test_names_follow_the_columns(rows: FeatureRows) -> None:
    names = rows.columns
    assert rows[2:5].columns == names
    assert rows[[0, 3]].columns == rows[np.arange(11) > 4].columns == names
    assert rows[..., 3:5].columns == rows[:, 3:5].columns == names[3:5]
    assert rows[:, ::-1].columns == names[::-1]
    assert rows[1:, [5, 2]].columns == (names[5], names[2])
    assert rows[np.ix_([0, 1], [5, 2])].columns == (names[5], names[2])
    assert rows[:, np.array([name == names[9] for name in names])].columns == (names[9],)
    pickled = pickle.loads(pickle.dumps(rows))  # noqa: S301
    for same in (rows.copy(), copy.deepcopy(rows), rows.astype(np.float32), pickled):
        assert isinstance(same, FeatureRows)
        assert same.columns == names
        assert np.array_equal(same, rows)
    assert rows[0].columns == rows[:, 3].columns == rows[:, :, None].columns == ()
    square = rows[:, :11]
    assert square.T.columns == ()


def test_what_is_computed_is_a_plain_array(rows: FeatureRows) -> None:
    plain = rows.values
    for given, expected in (
        (rows @ np.ones((300, 300), np.float32), plain @ np.ones((300, 300), np.float32)),
        (np.log1p(np.abs(rows)), np.log1p(np.abs(plain))),
        (2.0 * rows[:, 0], 2.0 * plain[:, 0]),
        (np.concatenate([rows, rows]), np.concatenate([plain, plain])),
    ):
        assert np.array_equal(given, expected)
        assert getattr(given, "columns", ()) == ()
    assert float(rows.mean()) == float(plain.mean())
    assert np.array_equal(rows.std(axis=0), plain.std(axis=0))
    assert rows[0, 0] == plain[0, 0]
    assert type(rows[0, 0]) is type(plain[0, 0])
    assert np.array_equal(rows.tolist(), plain.tolist())


def test_names_and_columns_are_as_many() -> None:
    with pytest.raises(InputError, match="2 names"):
        FeatureRows(np.zeros((4, 3), np.float32), ("a", "b"))


def test_a_window_with_a_sample_that_is_no_number_has_no_features() -> None:
    sound = np.random.default_rng(0).normal(scale=0.1, size=(2, 8820)).astype(np.float32)
    sound[1, 6000] = np.nan
    rows, clean = mc.features(sound), mc.features(np.nan_to_num(sound))
    torn = np.array([441 * k <= 6000 < 441 * k + 4410 for k in range(11)])
    assert np.isnan(rows[torn]).all()
    assert np.array_equal(rows[~torn], clean[~torn])
