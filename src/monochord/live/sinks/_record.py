"""An update as one flat table of plain values, with its wall-clock time."""

import math
import time
from collections.abc import Mapping
from typing import Any

from monochord.core.types import Prediction
from monochord.live.update import Update

NANO = 1_000_000_000
TRUE = ("true_contact", "true_slip", "true_position", "true_force")
"""Columns of a simulated source's truth, some of them empty in some windows."""
TRACKED = (
    "tracked_position", "tracked_position_std", "tracked_force", "tracked_force_std", "decided_contact",
    "decided_slip",
)  # fmt: skip
"""Columns of values over time, which the first windows do not yet fill."""


def record(update: Update, *, everything: bool) -> dict[str, Any]:
    """Return position and frequency of a window, and with `everything` all other values.

    These are the other estimates, truth, latency, counters, and the values over time: ``open_frequency`` in
    Hz with its ``_std`` and its ``_deviation`` relative to the nominal frequency, ``tracked_NAME`` with its
    ``_std``, ``decided_NAME`` true or false, ``events`` of this window as objects, and the stable keys of
    ``notes``. With several strings, the string's name comes first. NaN and infinity become None, since JSON
    has neither.
    """
    values = {"string": update.string} if update.string else {}
    values |= _position(update.prediction)
    if everything:
        values |= _others(update.prediction) | _context(update) | _followed(update)
    return {name: _finite(value) for name, value in values.items()}


def unix_nanoseconds(update: Update) -> int:
    """Return when the window's last frame was at the converter, in ns since the Unix epoch.

    Where the source does not know, it is when that frame became available. The system clock is read at each
    call, so that steps and NTP corrections take effect.
    """
    monotonic = update.at_hand if update.adc_time is None else update.adc_time + update.window.duration
    ahead = time.time_ns() - time.monotonic_ns()
    return ahead + (time.monotonic_ns() if monotonic is None else round(monotonic * NANO))


def _position(prediction: Prediction) -> dict[str, Any]:
    position = prediction.estimate("position")
    return {
        "time": prediction.time,
        "frequency": prediction.estimate("frequency").value,
        "position": position.value,
        "position_std": position.std,
        "valid": position.valid,
        "why_not": position.reason,
    }


def _others(prediction: Prediction) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, estimate in prediction.estimates.items():
        values |= {name: estimate.value, f"{name}_std": estimate.std}
    return values


def _context(update: Update) -> dict[str, Any]:
    truth: Mapping[str, float] = update.truth
    return {f"true_{name}": value for name, value in truth.items()} | {
        "latency": update.prediction.latency,
        "dropped": update.health.dropped,
        "gaps": update.health.gaps,
        "xruns": update.health.xruns,
        "skipped": update.skipped,
    }


def _followed(update: Update) -> dict[str, Any]:
    values: dict[str, Any] = {}
    if (condition := update.condition) is not None:
        open_, off = condition.open_frequency, condition.deviation
        values |= {"open_frequency": open_.value, "open_frequency_std": open_.std}
        values["open_frequency_deviation"] = math.nan if off is None else off
    for name, estimate in update.tracked.items():
        values |= {f"tracked_{name}": estimate.value, f"tracked_{name}_std": estimate.std}
    values |= {f"decided_{name}": decision for name, decision in update.decided.items()}
    events = [
        {"name": event.name, "on": event.on, "time": event.time, "delay": event.delay}
        | {"confidence": _finite(event.confidence)}
        for event in update.events
    ]
    return values | {"events": events, "notes": [note.key for note in update.notes]}


def _finite(value: Any) -> Any:
    if isinstance(value, (bool, str, int, list)):
        return value
    return float(value) if math.isfinite(value) else None
