"""What a setup refuses, in one line each."""

from typing import Any

import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.split_string import Drive, Pluck, SplitString
from monochord.physics.strings import load_string

STRING = load_string("appendix").string


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (
            {"contact": Contact(position=0.65, force=1.0)},
            r"position 0.65 m: allowed is strictly between 0 and",
        ),
        ({"contact": Contact(position=-0.1, force=1.0)}, r"position -0.1 m"),
        ({"contact": Contact(position=float("nan"), force=1.0)}, r"position nan m"),
        ({"contact": Contact(position=0.3, force=-1.0)}, r"force -1 N: allowed is 0 N or more"),
        ({"mixing": (0.9, 1.1)}, r"mixing share 1.1: allowed is 0 to 1"),
        ({"pickup_place": 1.0}, r"pickup place 1"),
        ({"nodes": 3}, r"3 nodes: allowed is 8"),
        ({"time_step": 0.0}, r"time step 0 s"),
        ({"alpha": 1.5}, r"alpha 1.5"),
        ({"initial": "rest"}, r"without start frequencies.*set drive.start_frequencies"),
    ],
)
def test_a_setup_that_cannot_be_is_refused_in_one_line(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line) as refusal:
        SplitString(string=STRING, **options)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"amplitude": float("inf")}, "drive amplitude inf N"),
        ({"place": 0.0}, "drive place 0"),
        ({"width": 0.0}, "drive width 0 m"),
        ({"window": 0.01, "hop": 0.02}, "drive window 0.01 s, hop 0.02 s"),
        ({"pull": 1.1}, "drive pull 1.1"),
        ({"start_frequencies": (0.0, 1.0)}, "start frequency 0 Hz"),
    ],
)
def test_a_drive_that_cannot_be_is_refused(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line):
        Drive(**options)


@pytest.mark.parametrize("options", [{"place": 1.0}, {"width": -1.0}, {"height": float("nan")}])
def test_a_pluck_that_cannot_be_is_refused(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match="pluck"):
        Pluck(**options)
