"""What is followed over time beside single windows: the same events, fewer false alarms."""

from typing import Any

import pytest
from studies.following import Following

from monochord.core.errors import InputError

SHORT = Following(builds=(301,), seconds=4.0, noises=("motors",), thresholds=(0.3, 0.6))


@pytest.mark.slow
def test_what_is_followed_is_compared_with_single_windows() -> None:
    numbers = SHORT.numbers()
    assert numbers["simulated"] is True
    for noise in SHORT.noises:
        for name in ("contact", "slip"):
            curves = numbers["curves"][noise][name]
            followed, single = curves["followed"], curves["windows"]
            assert [each["threshold"] for each in followed] == list(SHORT.thresholds)
            assert [each["events"] for each in followed] == [each["events"] for each in single]
            for one, other in zip(followed, single, strict=True):
                assert one["false_alarms"] <= other["false_alarms"]
        position = numbers["errors"][noise]["position"]
        assert position["windows"] > 50
        assert position["tracked_answered"] >= position["raw_answered"] - 0.05
    assert all(panel.lines for panel in SHORT.draw().axes)


@pytest.mark.parametrize(
    "wrong", [{"noises": ("wind",)}, {"builds": ()}, {"thresholds": (1.5,)}, {"seconds": 0.0}]
)
def test_a_comparison_that_cannot_be_made_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Following(**wrong)
