import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.encoders.ast.tensors import AstWeights, cropped, random_weights, shapes


def test_the_published_network_has_86_million_numbers() -> None:
    numbers = sum(int(np.prod(shape)) for _, shape in shapes(depth=12, width=768, columns=101))
    assert numbers == 86_187_264


def test_a_draw_is_repeatable_and_labelled(small: AstWeights) -> None:
    again, other = (random_weights(seed=seed, depth=2, width=128) for seed in (1, 2))
    assert all(np.array_equal(small.tensors[name], again.tensors[name]) for name in small.tensors)
    assert not np.array_equal(small.tensors["cls"], other.tensors["cls"])
    assert (small.random, small.label) == (True, "random(1)")


@pytest.mark.parametrize(("depth", "width"), [(0, 64), (1, 0), (1, 100)])
def test_a_network_that_cannot_be_is_refused(depth: int, width: int) -> None:
    with pytest.raises(InputError, match="1 or more, of a multiple of 64"):
        random_weights(seed=0, depth=depth, width=width)


def test_positions_are_the_middle_of_each_row(small: AstWeights) -> None:
    whole = small.tensors["positions"]
    fitting = cropped(small, 100).tensors["positions"]
    assert np.array_equal(fitting[:2], whole[:2])
    rows, own = fitting[2:].reshape(12, 9, 128), whole[2:].reshape(12, 101, 128)
    assert np.array_equal(rows, own[:, 46:55])


def test_the_length_of_training_changes_nothing(small: AstWeights) -> None:
    assert np.array_equal(cropped(small, 1024).tensors["positions"], small.tensors["positions"])


def test_what_is_longer_than_training_or_shorter_than_a_patch_is_refused(small: AstWeights) -> None:
    with pytest.raises(InputError, match="1026 frames: allowed is 1025 frames or fewer"):
        cropped(small, 1026)
    with pytest.raises(InputError, match="15 frames: allowed is 16 frames or more"):
        cropped(small, 15)
