import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest
from msgspec import Meta

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.ranges import (
    Checked,
    Count,
    Finite,
    InnerShare,
    NonNegative,
    PartialShare,
    Positive,
    Share,
)
from monochord.core.units import Hertz, Metres, Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Checked):
    rate: Positive[Hertz] = 100.0
    delay: NonNegative[Seconds] = 0.0
    place: Finite[Metres] = 0.0
    share: Share = 1.0
    lost: PartialShare = 0.0
    inner: InnerShare = 0.5
    count: Count = 1
    hold: Annotated[Seconds, Meta(gt=0.0)] = math.inf
    limit: Annotated[float, Meta(ge=1.0, le=2.0)] | None = None
    pair: tuple[Share, Positive[float]] = (0.5, 1.0)
    many: tuple[Count, ...] | None = None
    plain: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep(Scan):
    stop: Positive[Hertz] = 200.0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.stop < self.rate:
            raise InputError(f"stop {self.stop:g}", "rate or more")


ALLOWED: list[Mapping[str, Any]] = [
    {"rate": 1e-300, "delay": 1e308, "place": -1e308, "share": 0, "lost": 0.0, "count": 10**18},
    {"hold": math.inf, "limit": 2.0, "pair": (1.0, 5.0), "many": (1, 2), "plain": (math.inf, -1.0)},
    {"limit": None, "many": None, "share": 1.0},
]
REFUSED: list[tuple[str, Any, str, str]] = [
    ("rate", 0.0, "rate", "a finite number above 0 Hz"),
    ("rate", math.inf, "rate", "a finite number above 0 Hz"),
    ("delay", -1e-9, "delay", "a finite number of 0 s or more"),
    ("place", -math.inf, "place", "a finite number in m"),
    ("share", 1.5, "share", "a number from 0 to 1"),
    ("lost", 1.0, "lost", "a number of 0 or more and below 1"),
    ("inner", 0.0, "inner", "a number above 0 and below 1"),
    ("inner", 1.0, "inner", "a number above 0 and below 1"),
    ("count", 0, "count", "a whole number of 1 or more"),
    ("hold", 0.0, "hold", "a number above 0 s"),
    ("limit", 3.0, "limit", "a number from 1 to 2"),
    ("pair", (0.5, 0.0), "pair[1]", "a finite number above 0"),
    ("many", (1, 0), "many[1]", "a whole number of 1 or more"),
]


@pytest.mark.parametrize("values", ALLOWED)
def test_what_is_within_its_range_is_taken(values: Mapping[str, Any]) -> None:
    assert Scan(**values) == from_tree(Scan, {k: v for k, v in values.items() if v is not None})


@pytest.mark.parametrize(("name", "value", "place", "allowed"), REFUSED)
def test_python_refuses_what_a_file_may_not_hold(name: str, value: Any, place: str, allowed: str) -> None:
    with pytest.raises(InputError) as built:
        Scan(**{name: value})
    assert built.value.given.startswith(f"option 'Scan.{place}' = ")
    with pytest.raises(InputError) as read:
        from_tree(Scan, {name: value}, "scan")
    assert read.value.given.startswith(f"option 'scan.{place}' = ")
    for error in (built.value, read.value):
        assert allowed in error.expected


@pytest.mark.parametrize("name", ["rate", "delay", "place", "share", "lost", "inner", "hold", "limit"])
def test_no_range_holds_nan(name: str) -> None:
    values: dict[str, Any] = {name: math.nan}
    with pytest.raises(InputError, match=f"Scan.{name}' = nan"):
        Scan(**values)


def test_numbers_of_numpy_count() -> None:
    scan = Scan(count=np.int64(3), share=np.float32(0.5))  # pyright: ignore[reportArgumentType]
    assert (type(scan.count), type(scan.share)) == (int, float)
    with pytest.raises(InputError, match="share' = 2"):
        Scan(share=np.float64(2.0))


def test_a_subclass_keeps_its_checks_and_those_of_its_base() -> None:
    assert Sweep().stop == 200.0
    refused: list[dict[str, Any]] = [{"stop": 0.0}, {"share": 2.0}, {"stop": 50.0}]
    for values in refused:
        with pytest.raises(InputError):
            Sweep(**values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Served(Checked):
    server: "Server | None" = None  # type: ignore[name-defined]  # pyright: ignore[reportUndefinedVariable]  # noqa: F821


def test_a_type_for_type_checkers_alone_stops_no_one_who_builds_in_python() -> None:
    assert Served(server="one").server == "one"
