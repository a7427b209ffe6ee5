"""What every feature promises: finite rows of a stated width, each of its own window alone."""

import re
from functools import cache

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor, Feature
from monochord.physics.strings import load_string

RATE, SIZE = 44100, 4410
SIGNAL = Signal(sample_rate=RATE, channels=2, string=load_string("prototype").string)
each_feature = pytest.mark.parametrize("name", FEATURES.names())


def built(name: str) -> Feature:
    return FEATURES.build(name)


@cache
def prepared(name: str) -> Extractor | str:
    try:
        return built(name).prepare(SIGNAL, SIZE)
    except InputError as error:
        return str(error)


@pytest.fixture
def extract(name: str) -> Extractor:
    """The feature `name`, prepared; one that needs weights that are not here says how to get them."""
    extractor = prepared(name)
    if isinstance(extractor, str):
        assert re.search(r"monochord weights get \w+", extractor), extractor
        assert "\n" not in extractor
        pytest.skip(extractor)
    return extractor


def sounds() -> Audio:
    time = np.arange(SIZE) / RATE
    touched = np.sin(2.0 * np.pi * np.array([[2430.0], [1730.0]]) * time) * np.array([[0.2], [0.1]])
    stream = np.random.default_rng(7)
    return np.stack(
        (touched, 0.1 * stream.standard_normal((2, SIZE)), touched[::-1] + 0.01, 1e-4 * touched)
    ).astype(np.float32)


def awkward() -> dict[str, Audio]:
    plain = sounds()[0]
    hole, spike, one = plain.copy(), plain.copy(), plain.copy()
    hole[0, 100:2000] = np.nan
    spike[1, 700] = np.inf
    one[1] = 0.0
    alternating = np.where(np.arange(SIZE) % 2, 1.0, -1.0)
    return {
        "silence": np.zeros_like(plain),
        "a constant": np.full_like(plain, 0.5),
        "no numbers": np.full_like(plain, np.nan),
        "some that are not numbers": hole,
        "infinity": spike,
        "minus infinity everywhere": np.full_like(plain, -np.inf),
        "full scale": np.stack((np.ones(SIZE), alternating)).astype(np.float32),
        "a square wave": np.sign(plain),
        "the largest numbers": np.finfo(np.float32).max * np.sign(plain),
        "the smallest numbers": np.finfo(np.float32).tiny * plain,
        "one microphone dead": one,
    }


@each_feature
def test_its_columns_are_named_and_none_twice(extract: Extractor) -> None:
    columns = extract.columns
    assert len(set(columns)) == len(columns) > 0
    assert all(column and column == column.strip() for column in columns)


@each_feature
def test_rows_are_float32_of_the_stated_width(extract: Extractor) -> None:
    for count in (0, 1, 3):
        rows = extract(sounds()[:count])
        assert rows.dtype == np.float32
        assert rows.shape == (count, len(extract.columns))


@each_feature
def test_rows_are_finite_whatever_is_heard(extract: Extractor) -> None:
    finite = {kind: np.isfinite(extract(sound[np.newaxis])).all() for kind, sound in awkward().items()}
    assert not [kind for kind, is_so in finite.items() if not is_so]


@each_feature
def test_a_row_is_the_same_alone_and_in_any_batch(extract: Extractor) -> None:
    windows = np.concatenate((sounds(), np.stack(list(awkward().values()))))
    batch = extract(windows)
    alone = np.concatenate([extract(window[np.newaxis]) for window in windows])
    assert np.array_equal(batch, alone)
    assert np.array_equal(extract(windows[::-1]), batch[::-1])
    assert np.array_equal(extract(windows[2:5]), batch[2:5])


@each_feature
def test_a_row_is_the_same_however_the_window_lies_in_memory(extract: Extractor) -> None:
    windows = sounds()
    track = np.zeros((2, 3 * SIZE), np.float32)
    track[:, 501 : 501 + SIZE] = windows[0]
    track.setflags(write=False)
    assert np.array_equal(extract(track[np.newaxis, :, 501 : 501 + SIZE]), extract(windows[:1]))
    assert np.array_equal(extract(np.asfortranarray(windows)), extract(windows))


@each_feature
def test_it_is_the_same_each_time_and_leaves_the_windows_alone(extract: Extractor, name: str) -> None:
    windows = sounds()
    first = extract(windows)
    assert np.array_equal(windows, sounds())
    extract(np.stack(list(awkward().values())))
    assert np.array_equal(extract(windows), first)
    again = built(name).prepare(SIGNAL, SIZE)
    assert again.columns == extract.columns
    assert np.array_equal(again(windows), first)


@each_feature
def test_rows_of_different_sounds_differ(extract: Extractor) -> None:
    rows = extract(sounds())
    assert not np.array_equal(rows[0], rows[1])
    assert not np.array_equal(rows[0], rows[2])


@each_feature
@pytest.mark.parametrize(
    ("signal", "size"),
    [(SIGNAL, 8), (Signal(sample_rate=100, channels=2, string=SIGNAL.string), SIZE)],
    ids=["window of 8 frames", "rate of 100 Hz"],
)
def test_what_it_cannot_serve_is_refused_in_one_line(name: str, signal: Signal, size: int) -> None:
    with pytest.raises(InputError) as caught:
        built(name).prepare(signal, size)
    assert "\n" not in str(caught.value)
