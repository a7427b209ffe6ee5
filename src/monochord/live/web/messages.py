"""Messages to the page of a run, as JSON and compact bytes, and what a page may ask of it."""

import math
from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from monochord.capture.sources.base import Controls
from monochord.core.reasons import Reason
from monochord.core.timing import Percentiles
from monochord.core.types import Audio, Estimate, Signal
from monochord.core.units import Hertz, Seconds
from monochord.dsp.levels import LOUD_LEVEL, levels
from monochord.live.events import Event
from monochord.live.health import shown_notes
from monochord.live.update import Update
from monochord.page.messages import number, packed
from monochord.perception.watching import Condition

TOP: Hertz = 10_000.0
"""Highest frequency of a transmitted spectrum, in Hz."""
BARS = 512
"""Number of spectrum values per channel, each the maximum of its band."""
FLOOR = -110.0
"""Level at byte 0 of a spectrum, in dB of full scale; 255 is 0 dB."""
MAX_CHANNELS = 8


class Touch(msgspec.Struct, tag_field="do", tag="touch", forbid_unknown_fields=True):
    """Touch the string at a position in m with a force in N, or move the object there.

    `across` is the object's speed across the string in m/s.
    """

    position: float
    force: float
    across: float = 0.0


class Release(msgspec.Struct, tag_field="do", tag="release", forbid_unknown_fields=True):
    """Lift the object."""


class Change(msgspec.Struct, tag_field="do", tag="change", forbid_unknown_fields=True):
    """Change a setting of the source."""

    name: str
    value: str


class Show(msgspec.Struct, tag_field="do", tag="show", forbid_unknown_fields=True):
    """Show another string, by its name."""

    string: str


def waiting() -> str:
    """Return the message sent before the source is open."""
    return packed({"type": "waiting"})


def hello(signal: Signal, length: float, simulated: bool, controls: Controls | None) -> dict[str, Any]:  # noqa: FBT001
    """Return everything a page needs once about a run, without its history."""
    string = signal.string
    known = string is not None and string.linear_density > 0.0
    return {
        "type": "hello",
        "rate": signal.sample_rate,
        "channels": signal.channels,
        "length": length,
        "speed": math.sqrt(string.tension / string.linear_density) if string and known else None,
        "range": signal.sensing_range,
        "drivers": signal.drivers,
        "ends": ["nut", "bridge"] if signal.channels == 1 else ["pickup 1", "pickup 2"],
        "simulated": simulated,
        "controls": None
        if controls is None
        else {"positions": controls.positions, "forces": controls.forces, "settings": settings(controls)},
    }


def settings(controls: Controls) -> list[dict[str, Any]]:
    """Return the source's changeable settings with their current values."""
    return [{"name": s.name, "choices": s.choices, "value": s.value} for s in controls.settings]


def state(update: Update) -> dict[str, Any]:
    """Return an update for the page: estimates, tracked estimates, truth, levels and counters."""
    health, measured = update.health, [levels(row) for row in update.window.samples[:MAX_CHANNELS]]
    return {
        "type": "moment",
        "string": update.string,
        "time": update.prediction.time,
        "window": _estimates(update.prediction.estimates),
        "tracked": _estimates(update.tracked),
        "decided": dict(update.decided),
        "pitch": _pitch(update.condition),
        "truth": {name: number(value) for name, value in update.truth.items()},
        "levels": [[number(each, 1) for each in row] for row in measured],
        "clips": [peak >= LOUD_LEVEL for _, peak in measured],
        "notes": [
            {"key": n.key, "level": n.level, "sentence": n.sentence, "remedy": n.remedy, "since": n.since}
            for n in shown_notes(update.notes, update.time)
        ],
        "latency": number(1e3 * update.prediction.latency, 3),
        "health": {
            "frames": health.frames,
            "dropped": health.dropped,
            "gaps": health.gaps,
            "xruns": health.xruns,
            "reconnects": health.reconnects,
            "skipped": update.skipped,
        },
    }


def string_summary(update: Update) -> dict[str, Any]:
    """Return a string's summary beside other strings: its name, touch, and worst note's level."""
    row_, touched = row(update), update.decided.get("contact")
    levels_ = {note.level for note in update.notes}
    worst = next((level for level in ("error", "warning") if level in levels_), None)
    return {"name": update.string, "contact": touched, "position": row_[3], "force": row_[5], "note": worst}


def event(event: Event, count: int) -> dict[str, Any]:
    """Return an event; `count` identifies it."""
    values = {"number": count, "name": event.name, "on": event.on, "time": number(event.time, 3)}
    return values | {"delay": number(event.delay, 3), "confidence": number(event.confidence, 3)}


def row(update: Update) -> list[float | None]:
    """Return an update as a row of the history; see `static/history.js` for the columns."""
    tracked, estimates, truth = update.tracked, update.prediction.estimates, update.truth
    position = tracked.get("position") or update.prediction.estimate("position")
    force = tracked.get("force") or update.prediction.estimate("force")
    names = ("contact", "slip")
    chances = [number(e.value, 3) if (e := estimates.get(name)) else None for name in names]
    decided = [None if (on := update.decided.get(name)) is None else float(on) for name in names]
    return [
        round(update.prediction.time, 3),
        *chances,
        number(position.value, 5), number(position.std, 5), number(force.value, 3), number(force.std, 3),
        *(number(truth[name], 5) if name in truth else None for name in (*names, "position", "force")),
        *decided,
    ]  # fmt: skip


def timing(percentiles: Percentiles, counts: list[int], edges: tuple[Seconds, ...]) -> dict[str, Any]:
    """Return the estimation times of windows: percentiles in ms, and a histogram with edges in ms."""
    named = {"p50": percentiles.p50, "p95": percentiles.p95, "p99": percentiles.p99}
    return {
        "count": percentiles.count,
        **{name: number(1e3 * value, 3) for name, value in named.items()},
        "longest": number(1e3 * percentiles.longest, 3),
        "edges": [round(1e3 * edge, 4) for edge in edges],
        "counts": counts,
    }


def spectrum(samples: Audio, sample_rate: int) -> bytes:
    """Return the spectrum of every microphone; a full-scale sine reads 0 dB.

    Format: the number of channels, 3 bytes of padding, the highest frequency as a little-endian float32, then
    `BARS` bytes per channel, from `FLOOR` to 0 dB of full scale.
    """
    sound = np.nan_to_num(samples[:MAX_CHANNELS].astype(np.float64), nan=0.0, posinf=1.0, neginf=-1.0)
    sound = np.clip(sound, -1e3, 1e3)
    size = sound.shape[-1]
    taper = np.hanning(size + 1)[:-1]
    padded = max(1 << math.ceil(math.log2(max(1.5 * size, 16))), 16)
    top = min(TOP, 0.5 * sample_rate)
    bins = np.abs(np.fft.rfft(sound * taper, padded, axis=-1)) * (2.0 / max(float(taper.sum()), 1e-9))
    count = min(int(top / sample_rate * padded), bins.shape[-1])
    edges = np.linspace(0, count, BARS + 1).astype(np.intp)[:-1]
    highest = np.maximum.reduceat(bins[:, :count], edges, axis=-1)
    decibels = 20.0 * np.log10(np.maximum(highest, 1e-9))
    scaled = np.clip(255.0 * (1.0 - decibels / FLOOR), 0.0, 255.0).astype(np.uint8)
    head = bytes([scaled.shape[0], 0, 0, 0]) + np.float32(top).astype("<f4").tobytes()
    return head + scaled.tobytes()


def _pitch(condition: Condition | None) -> dict[str, Any] | None:
    if condition is None:
        return None
    open_, off = condition.open_frequency, condition.deviation
    return {
        "frequency": number(open_.value, 3),
        "std": number(open_.std, 3),
        "deviation": None if off is None else number(off),
        "follows": condition.follows,
    }


def _estimates(estimates: Mapping[str, Estimate]) -> dict[str, Any]:
    return {
        name: {
            "value": number(each.value),
            "std": number(each.std),
            "unit": each.unit,
            "why": each.reason,
            "key": Reason.of(each.reason).key,
        }
        for name, each in estimates.items()
    }
