"""What `evaluate` says of six sessions stays what it said, of the bundled model and of the closed form."""

import json
import math
import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.evaluation import golden

RELATIVE = 1e-6
"""Difference that another library's rounding may make."""


def leaves(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of a tree with its place, such as ``demo contact.wood.clean.windows``."""
    if isinstance(tree, dict | list):
        entries = tree.items() if isinstance(tree, dict) else enumerate(tree)
        for key, value in entries:
            yield from leaves(value, f"{path}.{key}".lstrip("."))
    else:
        yield path, tree


def same(one: Any, other: Any) -> bool:
    numbers = isinstance(one, float) and isinstance(other, float)
    return math.isclose(one, other, rel_tol=RELATIVE, abs_tol=1e-12) if numbers else bool(one == other)


@pytest.mark.skipif(platform.machine() != "x86_64", reason="rendered by x86-64: others round otherwise")
def test_six_sessions_score_as_before(tmp_path: Path) -> None:
    before = dict(leaves(json.loads(golden.FILE.read_text(encoding="utf-8"))))
    now = dict(leaves(golden.scores(tmp_path)))
    assert len(before) > 2000
    moved = [name for name in before.keys() | now if not same(before.get(name), now.get(name, math.nan))]
    assert not moved, f"{len(moved)} scores, such as {sorted(moved)[:5]}"
