"""The force of a touch: against a plain root, and what it does to energy."""

import numpy as np
import pytest
from scipy.optimize import brentq

from monochord.physics.twin import press

K2, REST, EASE = 1.3e8, 4e-6, 5e-5


def lossless(s: float, s_old: float, eta_old: float) -> float:
    """The rise of stored energy over that of eta."""
    rise = press.energy_at(s, 0.0, K2, REST) - press.energy_at(s_old, 0.0, K2, REST)
    return rise / (press.approach_at(s, 0.0, K2, REST) - eta_old)


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 2e-6, 5e-5])
@pytest.mark.parametrize("start", [1e-6, 3e-4, 5e-3])
def test_first_contact_solves_its_equation(gap: float, start: float) -> None:
    def miss(s: float) -> float:
        return press.approach_at(s, 0.0, K2, REST) + EASE * lossless(s, 0.0, -1e-5) - gap

    true = brentq(miss, 1e-12, np.sqrt(gap), xtol=1e-18)
    s, eta, force = press.press(gap, EASE, start, 0.0, -1e-5, 0.0, K2, REST, 0.0)
    assert s == pytest.approx(true, rel=1e-7)  # where the iteration ends; it starts far off here
    assert eta + EASE * force == pytest.approx(gap, rel=1e-7)


def test_energy_given_is_energy_stored() -> None:
    rng = np.random.default_rng(3)
    s, eta = 0.0, -1e-6
    for gap in rng.uniform(-2e-5, 6e-5, 300):
        before, stored = eta, press.energy_at(s, 0.0, K2, REST)
        s, eta, force = press.press(gap, EASE, max(s, 1e-4), s, eta, 0.0, K2, REST, 0.0)
        rise = press.energy_at(s, 0.0, K2, REST) - stored
        assert force >= 0.0
        assert force * (eta - before) == pytest.approx(rise, rel=1e-5, abs=1e-14)


def test_loss_only_takes() -> None:
    rng = np.random.default_rng(4)
    s, eta = 0.0, -1e-6
    for gap in rng.uniform(-2e-5, 6e-5, 300):
        before, stored = eta, press.energy_at(s, 0.0, K2, REST)
        s, eta, force = press.press(gap, EASE, max(s, 1e-4), s, eta, 0.0, K2, REST, 3e4)
        assert force * (eta - before) >= press.energy_at(s, 0.0, K2, REST) - stored - 1e-14


def test_static_press_and_no_touch() -> None:
    s = press.root_of_compression(2.0, 1e4, K2)
    assert press.force_at(s, 1e4, K2) == pytest.approx(2.0, rel=1e-12)
    assert press.root_of_compression(0.0, 1e4, K2) == 0.0
    assert press.press(-1e-6, EASE, 0.0, 0.0, -1.0, 0.0, K2, REST, 0.0) == (0.0, -1e-6, 0.0)
