"""Messages to a page as JSON, which lacks NaN and infinity."""

import json
import math
from collections.abc import Mapping
from typing import Any


def packed(message: Mapping[str, Any]) -> str:
    """Return a message as JSON."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False)


def number(value: float, digits: int = 6) -> float | None:
    """Return a rounded number, or None for NaN and infinity.

    >>> number(0.123456789), number(float("nan"))
    (0.123457, None)
    """
    return round(float(value), digits) if math.isfinite(value) else None
