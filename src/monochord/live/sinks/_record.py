"""An update as one flat table of plain values, and the time of day that goes with it."""

import math
import time
from collections.abc import Mapping
from typing import Any

from monochord.core.types import Prediction
from monochord.live.sinks.base import Update

NANO = 1_000_000_000


def record(update: Update, *, everything: bool) -> dict[str, Any]:
    """Return position and frequency, and with `everything` the rest of what is known of a window.

    That is the other estimates, truth, latency, counters, and what is followed over time: ``open_frequency``
    in Hz with its ``_std`` and its ``_deviation``, the share by which it lies above the known one,
    ``tracked_NAME`` with its ``_std``, ``decided_NAME`` true or false, ``events`` of this window as objects,
    and the stable keys of ``notes``. The name of one of several strings comes first. What is no finite number
    is None, as JSON has neither NaN nor infinity.
    """
    values = {"string": update.string} if update.string else {}
    values |= _position(update.prediction)
    if everything:
        values |= _others(update.prediction) | _context(update) | _followed(update)
    return {name: _finite(value) for name, value in values.items()}


def unix_nanoseconds(update: Update) -> int:
    """Return when the window's last frame was at the converter, in ns since the Unix epoch.

    Where the source does not know, it is when that frame was at hand. The system's clock is read here, so
    that a clock that is set, or slewed by NTP, is followed.
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
