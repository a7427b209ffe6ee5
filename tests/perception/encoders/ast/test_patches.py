import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.encoders.ast.patches import DEVIATION, MEAN, columns_of, patches_of


def test_a_patch_is_16_bands_by_16_frames_band_by_band(energies: Audio) -> None:
    patches = patches_of(energies).reshape(2, 12, 9, 16, 16)
    even = (energies - MEAN) / (2.0 * DEVIATION)
    for row, column in [(0, 0), (3, 5), (11, 8)]:
        frames, bands = slice(10 * column, 10 * column + 16), slice(10 * row, 10 * row + 16)
        assert np.allclose(patches[:, row, column], even[:, frames, bands].transpose(0, 2, 1), atol=1e-6)


@pytest.mark.parametrize(("frames", "columns"), [(16, 1), (25, 1), (26, 2), (100, 9), (1024, 101)])
def test_as_many_columns_as_fit(frames: int, columns: int) -> None:
    assert columns_of(frames) == columns
    assert patches_of(np.zeros((1, frames, 128), np.float32)).shape == (1, 12 * columns, 256)


def test_other_spectrograms_are_refused() -> None:
    with pytest.raises(InputError, match="64 bands: allowed is 128 bands"):
        patches_of(np.zeros((2, 100, 64), np.float32))
    with pytest.raises(InputError, match="10 frames: allowed is 16 frames or more"):
        patches_of(np.zeros((2, 10, 128), np.float32))
