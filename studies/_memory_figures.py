"""What the reader's network tells of sessions of unheard builds: a window alone, and over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from studies._memory_training import (
    DENSITY,
    FORCE,
    SLIP,
    Rows,
    outputs_of,
    peaks,
    probabilities,
    stated_force,
)
from studies._reader_sessions import ORDINARY

from monochord.core.types import Audio, Flags, Floats

ANSWERED, NEAR, WRONG = 0.95, 0.005, 0.010
"""Probability from which a place counts as answered; errors in m of right and of wrong places."""
LENGTH = 0.2
"""Length in m that errors over the length are stated for."""
RANGE = (0.05, 0.15)
"""Positions in m between which touches are scored."""
AFTER = 10
"""Windows after a touch before a released string is scored: 0.2 s."""
SURE = 0.05
"""Probability of no touch below which a touch is stated, and of an ordinary window below which it is odd."""
ALL = "all"


def figures(
    arrays: Mapping[str, Audio], sessions: Sequence[Rows], groups: Sequence[str], horizon: int = 0
) -> dict[str, Any]:
    """Return the figures of each group of sessions, and of all: "alone" of single windows, and "memory".

    `contact` is the share of right contact; of touches within `RANGE`: `answered`, `right` of the answered
    within `NEAR`, `wrong` of all windows answered more than `WRONG` off, `median_mm`; `force_n` the mean
    error; `slip` the area under the curve; `released` the share of windows after a touch that are told
    untouched with `ANSWERED`, and `false` where a touch is stated. `fault` is the share of odd windows whose
    kind is told, and `alarm` that of ordinary ones that are told to be odd.
    """
    told = dict[str, list[dict[str, NDArray[Any]]]]()
    for rows, group, outputs in zip(sessions, groups, outputs_of(arrays, sessions, horizon), strict=True):
        alone = probabilities(rows.density.astype(np.float32))
        over_time = probabilities(outputs[:, :DENSITY])
        scored = {
            "contact": rows.contact,
            "place": rows.place,
            "force": rows.force,
            "slip": rows.slip,
            "placed": rows.placed,
            "released": _released(rows.contact),
            "alone": np.stack((alone[:, 0], *peaks(alone)), axis=1),
            "memory": np.stack((over_time[:, 0], *peaks(over_time)), axis=1),
            "stated": np.stack((stated_force(outputs[:, FORCE]), outputs[:, SLIP]), axis=1),
            "kind": rows.kind,
            "kinds": probabilities(outputs[:, DENSITY:FORCE]),
        }
        for name in (group, ALL):
            told.setdefault(name, []).append(scored)
    return {
        group: _figures({key: np.concatenate([part[key] for part in parts]) for key in parts[0]})
        for group, parts in told.items()
    }


def _released(contact: Audio) -> Flags:
    """Return which windows are untouched, and have been for a while, after a touch."""
    touched = contact != 0.0
    last = np.maximum.accumulate(np.where(touched, np.arange(len(contact)), -1))
    return ~touched & (last >= 0) & (np.arange(len(contact)) - last > AFTER)


def _figures(own: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    known = own["placed"]
    single = (
        known
        & (own["contact"] == 1.0)
        & (own["place"] * LENGTH > RANGE[0])
        & (own["place"] * LENGTH < RANGE[1])
    )
    rest = own["released"] & known
    result: dict[str, Any] = {"windows": len(known), "touched": int(single.sum())}
    for name in ("alone", "memory"):
        untouched, peak, mass = own[name].T
        error = LENGTH * np.abs(peak - own["place"])[single]
        answered = mass[single] > ANSWERED
        result[name] = {
            "contact": _share(((untouched > 0.5) == (own["contact"] == 0.0))[known]),
            "answered": _share(answered),
            "right": _share(error[answered] < NEAR),
            "wrong": _share(answered & (error > WRONG)),
            "median_mm": round(1e3 * float(np.median(error)), 3) if len(error) else None,
            "released": _share((untouched > ANSWERED)[rest]),
            "false": _share((untouched < SURE)[rest]),
        }
    pressed = single & np.isfinite(own["force"])
    force, slip = own["stated"].T
    if pressed.any():
        result["memory"]["force_n"] = round(float(np.abs(force - own["force"])[pressed].mean()), 4)
    slipping = known & np.isfinite(own["slip"])
    result["memory"]["slip"] = _area(slip[slipping], own["slip"][slipping])
    kind, kinds = own["kind"], own["kinds"]
    odd = kind > ORDINARY
    right = kinds[np.flatnonzero(odd), kind[odd]] > 0.5
    result["memory"]["fault"] = _share(right)
    result["memory"]["alarm"] = _share(kinds[kind == ORDINARY, ORDINARY] < SURE)
    return result


def _share(flags: NDArray[Any]) -> float | None:
    return round(float(flags.mean()), 4) if len(flags) else None


def _area(score: Floats, truth: Floats) -> float | None:
    """Return the area under the curve of a score (n,) for a truth of 0 and 1."""
    positive = int((truth == 1.0).sum())
    negative = len(truth) - positive
    if not positive or not negative:
        return None
    rank = np.empty(len(score))
    rank[np.argsort(score)] = np.arange(1, len(score) + 1)
    return round(float((rank[truth == 1.0].sum() - positive * (positive + 1) / 2) / (positive * negative)), 4)


def table(result: Mapping[str, Any]) -> list[str]:
    """Return the figures as lines, a group each."""
    heads = " contact  answered  right  wrong%  med.mm  rel. |"
    lines = [f"{'group':<24}{'touched':>8} |{2 * heads}  false%  force  slip  fault  alarm%"]
    for group, own in sorted(result.items(), key=lambda item: item[0] != ALL):
        cells = f"{group:<24}{own['touched']:>8} |"
        for name in ("alone", "memory"):
            part = own[name]
            cells += "".join(
                _cell(part[key], factor, form)
                for key, factor, form in (
                    ("contact", 100, "8.2f"),
                    ("answered", 100, "10.1f"),
                    ("right", 100, "7.1f"),
                    ("wrong", 100, "8.2f"),
                    ("median_mm", 1, "8.2f"),
                    ("released", 100, "6.1f"),
                )
            )
            cells += " |"
        cells += _cell(own["memory"]["false"], 100, "8.2f") + _cell(own["memory"].get("force_n"), 1, "7.3f")
        cells += _cell(own["memory"]["slip"], 1, "6.3f") + _cell(own["memory"]["fault"], 100, "7.1f")
        lines.append(cells + _cell(own["memory"]["alarm"], 100, "8.2f"))
    return lines


def _cell(value: float | None, factor: float, form: str) -> str:
    width = int(form.split(".", maxsplit=1)[0])
    return " " * (width - 1) + "-" if value is None else format(factor * value, form)
