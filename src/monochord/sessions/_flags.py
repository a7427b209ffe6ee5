"""What of a session's streams is not as it should be, in a sentence each."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from monochord.core.units import Seconds

if TYPE_CHECKING:
    from monochord.sessions.alignment import Lateness, Limits
    from monochord.sessions.reader import Session

AUDIO = "audio"
"""What the microphones' stream is called."""


def flags_of(stream: str, late: "Lateness", spacing: Seconds, limits: "Limits") -> list[str]:
    """Return what is not as it should be with a stream, in a sentence each."""
    flags: list[str] = []
    drift = limits.drift if stream == AUDIO else limits.intervals * spacing
    std = limits.std if stream == AUDIO else limits.intervals * spacing
    ends = 2 if late.times[1] > late.times[0] else 1
    for place, offset in zip(("begin", "end")[:ends], late.offsets[:ends], strict=True):
        if not offset.known:
            flags.append(f"{stream} notices no taps within {limits.offset:g} s at the {place}")
            continue
        if offset.taps < limits.taps:
            flags.append(f"{stream} notices {offset.taps} taps at the {place}; {limits.taps} are needed")
        if offset.std > std:
            flags.append(
                f"{stream}'s offset at the {place} is uncertain by {1e3 * offset.std:.2f} ms;"
                f" allowed is {1e3 * std:.2f} ms"
            )
        if abs(offset.value) > limits.offset:
            flags.append(
                f"{stream} is {abs(offset.value):.2f} s {'late' if offset.value > 0.0 else 'early'} at the"
                f" {place}; allowed is {limits.offset:g} s"
            )
    if abs(late.drift) > drift:
        flags.append(
            f"{stream} drifts by {1e3 * late.drift:+.2f} ms ({late.ppm:+.0f} ppm) from the begin to the end;"
            f" allowed is {1e3 * drift:.2f} ms"
        )
    return flags


def mute(session: "Session", seen: Iterable[str]) -> list[str]:
    """Return a sentence for each force and pose of which nothing came."""
    due = {feed.stream for feed in session.description.feeds if {"fz", "z"} & set(feed.columns)}
    return [f"{stream} has no readings" for stream in sorted(due - set(seen))]


def steps_of_the_wall_clock(session: "Session", limits: "Limits") -> list[str]:
    """Return a sentence for each leap of the wall clock against the monotonic one."""
    track = session.clocks
    offsets = track.offsets.get("realtime", np.zeros(0))
    leaps = np.diff(offsets)
    return [
        f"the wall clock was set by {leaps[k]:+.3f} s"
        f" between {track.time[k]:.1f} s and {track.time[k + 1]:.1f} s"
        for k in np.flatnonzero(np.abs(leaps) > limits.step)
    ]


def strays(session: "Session", limits: "Limits") -> list[str]:
    """Return a sentence where a sound server lost frames that it did not count."""
    stray = session.audio.unevenness
    if stray <= limits.stray:
        return []
    lost = (
        f"audio's times stray from its frames by {1e3 * stray:.1f} ms: the sound server lost some uncounted"
    )
    return [f"{lost}; allowed is {1e3 * limits.stray:g} ms"]
