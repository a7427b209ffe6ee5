import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.lab.glide import ACCELERATION, glide


@pytest.mark.parametrize(("way", "speed"), [(0.1, 0.25), (0.0008, 0.05), (1e-5, 0.2), (0.03, 0.003)])
def test_a_glide_goes_its_way_within_speed_and_acceleration(way: float, speed: float) -> None:
    time, gone, pace = np.array([(0.0, 0.0, 0.0), *glide(way, speed)]).T
    assert gone[-1] == pytest.approx(way)
    assert pace[-1] == pytest.approx(0.0, abs=1e-12)
    assert pace.max() <= speed * (1.0 + 1e-9)
    assert np.abs(np.diff(pace) / np.diff(time)).max() <= ACCELERATION * (1.0 + 1e-6)
    # The way between two points is what the speed, which runs linearly there, adds up to.
    np.testing.assert_allclose(np.diff(gone), 0.5 * (pace[1:] + pace[:-1]) * np.diff(time), rtol=1e-6)


def test_no_way_is_refused() -> None:
    with pytest.raises(InputError, match="a move of 0 m"):
        glide(0.0, 0.1)
