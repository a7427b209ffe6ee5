"""The table of what known touches are worth."""

import pytest
from studies.calibration_curves import COLUMNS, rows_of


@pytest.mark.parametrize(
    ("calibrated", "mark"), [((0.9, 1.9, 2.9), ""), ((1.01, 2.02, 3.0), ""), ((1.1, 2.4, 3.2), "!")]
)
def test_a_loss_is_marked(calibrated: tuple[float, ...], mark: str) -> None:
    """A mean that is larger, with an upper end above 5 % of the error, is a loss; a smaller one never is."""
    before = (1.0, 2.0, 3.0)
    builds = [{"force": {"5": [a, b, 9.0, 0.7]}} for a, b in zip(before, calibrated, strict=True)]
    builds.append({"force": {}})  # nothing could be estimated
    ((sensor, count, touches, *_, off, trees, covered),) = rows_of({"twin": builds}, "force")
    assert len(COLUMNS) == 9
    assert (sensor, count, touches, covered) == ("twin", "3", "5", "70 %")
    assert off.endswith("!") == bool(mark)
    assert trees.startswith("-")
