"""Press the page's string all along it, and count what it says: ``python -m tests.e2e.press_anywhere``.

A pointer presses each place three times: pressed and held; lifted to 0.4 N and led back to 1 N; brought down
3 mm beside the place and led there. The moments that the page gets count, from 0.3 s after the place is
reached; the truth is where the hand is. A position is far off if its error is above five stated errors and
above 1 mm; contact is wrong if it is valid and below a half. `shown` is what the page shows: the estimate
over time.
"""

import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.e2e.browser import Page, opened
from tests.e2e.test_web import READY, String, demonstration

from monochord.core.units import Metres, Seconds

PLACES = (
    10, 20, 30, 40, 45, 48, 50, 55, 60, 66.7, 80, 95, 98, 99, 99.5, 100, 100.5, 101, 102, 105, 120, 133.3,
    140, 145, 150, 152, 155, 160, 170, 180, 190,
)  # fmt: skip
"""In mm: both ends, outside the sensing range, and the nodes of the string's low modes."""
WAYS = 3
SETTLED: Seconds = 0.3
MARGIN: Metres = 2e-3
"""Places nearer than this to an end of the sensing range are in neither zone."""
FAR, LEAST = 5.0, 1e-3
"""Stated errors, and metres, from which a position is far off."""
COLLECT = """(() => { const h = monochord.history, add = h.add.bind(h); window.moments = [];
    h.add = (m) => { window.moments.push([m.window, m.tracked, m.truth]); add(m); }})()"""


@dataclass
class Count:
    """What was said of a place, or of several: numbers of moments."""

    moments: int = 0
    answered: int = 0
    far: int = 0
    contact_wrong: int = 0
    shown: int = 0
    shown_far: int = 0
    reasons: Counter[str] = field(default_factory=Counter[str])

    def take(self, window: dict[str, Any], tracked: dict[str, Any], truth: dict[str, Any]) -> None:
        """Count a moment."""
        raw, over = window["position"], tracked.get("position", window["position"])
        contact = window["contact"]["value"]
        self.moments += 1
        self.answered += raw["value"] is not None
        self.far += _is_far(raw, truth["position"])
        self.shown += over["value"] is not None
        self.shown_far += _is_far(over, truth["position"])
        self.contact_wrong += contact is not None and contact < 0.5
        if raw["value"] is None:
            self.reasons[raw["why"]] += 1

    def add(self, other: "Count") -> None:
        """Add another count to this one."""
        for name in ("moments", "answered", "far", "contact_wrong", "shown", "shown_far"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.reasons += other.reasons

    def line(self, name: str) -> str:
        """Return it as a row of the table."""
        numbers = (self.moments, self.answered, self.far, self.contact_wrong, self.shown, self.shown_far)
        (why, count), *_ = self.reasons.most_common(1) or [("", 0)]
        return f"{name:>9}" + "".join(f"{n:14d}" for n in numbers) + (f"  {why} ({count})" if why else "")


HEAD = f"{'place':>9}" + "".join(
    f"{name:>14}" for name in ("windows", "answered", "far off", "contact wrong", "shown", "shown far off")
)


def _is_far(position: dict[str, Any], truth: Metres) -> bool:
    value, std = position["value"], position["std"]
    return value is not None and abs(value - truth) > max(FAR * std, LEAST)


def press(page: Page, place: Metres, way: int, hold: Seconds) -> Count:
    """Press a place with the pointer, hold it, let go, and return what was said meanwhile."""
    length, string = page.ask("monochord.run.length"), String(page)
    share = place / length
    if way == 0:
        string.mouse("mousePressed", share)
    elif way == 1:
        string.mouse("mousePressed", share)
        for up in (25.0, 50.0, 50.0, 35.0, 20.0, 10.0, 0.0):  # 12 mN a pixel
            time.sleep(0.03)
            string.mouse("mouseMoved", share, down=-up)
    else:
        beside = share + (3e-3 if share < 0.5 else -3e-3) / length
        string.mouse("mousePressed", beside)
        for step in range(1, 6):
            time.sleep(0.03)
            string.mouse("mouseMoved", beside + (share - beside) * step / 5)
    page.wait(f"Math.abs((monochord.moment.truth.position ?? 9) - {place}) < 5e-4")
    time.sleep(SETTLED)
    page.ask("window.moments.length = 0")
    time.sleep(hold - SETTLED)
    moments: list[Any] = json.loads(page.ask("JSON.stringify(window.moments)"))
    string.mouse("mouseReleased", share)
    page.wait("monochord.moment.truth.contact === 0")
    time.sleep(0.3)
    count = Count()
    for window, tracked, truth in moments:
        if truth.get("contact") == 1.0 and truth.get("position") is not None:
            count.take(window, tracked, truth)
    return count


def pressed(page: Page, places: Iterable[float], hold: Seconds) -> dict[float, Count]:
    """Press places (in mm) in every way, print a row for each, and return the counts by place."""
    page.ask(COLLECT)
    counts: dict[float, Count] = {}
    print(HEAD)  # noqa: T201
    for place in places:
        counts[place] = Count()
        for way in range(WAYS):
            counts[place].add(press(page, 1e-3 * place, way, hold))
        print(counts[place].line(f"{place:g} mm"), flush=True)  # noqa: T201
    return counts


def zones(counts: dict[float, Count], span: Sequence[Metres]) -> dict[str, Count]:
    """Return the counts of places inside a sensing range, outside, and between."""
    zones = {name: Count() for name in ("inside", "outside", "between")}
    for place, count in counts.items():
        depth = min(1e-3 * place - span[0], span[1] - 1e-3 * place)
        zones["inside" if depth >= MARGIN else "outside" if depth < -MARGIN else "between"].add(count)
    return zones


def main() -> None:
    """Press all places, or those that are named in mm, for 3 s each time, and print a table."""
    places = [float(each) for each in sys.argv[1:]] or PLACES
    with (
        tempfile.TemporaryDirectory() as folder,
        demonstration(Path(folder), "--seconds", "1200") as started,
        opened(started.address) as page,
    ):
        page.size(1200, 900)
        page.wait(READY)
        counts = pressed(page, places, 3.0)
        for name, count in zones(counts, page.ask("monochord.run.range")).items():
            print(count.line(name))  # noqa: T201


if __name__ == "__main__":
    main()
