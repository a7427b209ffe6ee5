"""What a session holds, as plain values and as lines for a person."""

from datetime import UTC, datetime
from typing import Any

import numpy as np

from monochord.core.config import Tree, to_tree
from monochord.sessions.reader import SessionReader

LABEL_WIDTH = 12
MAX_LOOKS = 60
"""Largest number of places at which two channels are compared."""
MAX_KINDS = 8
"""Kinds of events that the lines name."""


def facts_of(session: SessionReader) -> Tree:
    """Return a session's content as values for JSON."""
    description, audio = session.description, session.audio
    rate, begin = audio.line
    frames = audio.samples.shape[1]
    about = to_tree(description)
    for name in ("name", "sample_rate", "channels", "feeds", "plan"):
        about.pop(name, None)
    ending = "closed" if session.complete else "repaired" if session.recovered else "cut off"
    return {
        "path": str(session.path),
        "name": description.name,
        "begin": datetime.fromtimestamp(session.clock.epoch_ns / 1e9, UTC).isoformat(timespec="milliseconds"),
        "ending": ending,
        "seconds": frames / description.sample_rate,
        "content_checksum": session.ending.get("checksum"),
        "audio": {
            "channels": description.channels,
            "sample_rate": description.sample_rate,
            "measured_rate": rate,
            "first_frame": begin,
            "frames": frames,
            "gaps": len(audio.gaps),
            "lost_frames": sum(stop - first for first, stop in audio.gaps),
            "inputs": _inputs(session),
        },
        "streams": {stream: _stream(session, stream) for stream in session.streams},
        "labels": {"columns": list(session.labels.columns), "rows": len(session.labels.time)},
        "events": _kinds(session),
        "about": about,
    }


def _inputs(session: SessionReader) -> str:
    """Return why two channels are not two microphones; empty where they are, or where nothing tells."""
    from monochord.dsp.microphones import LOOK, inputs_of  # noqa: PLC0415 (loads numba)

    samples, rate = session.audio.samples, session.description.sample_rate
    size = round(LOOK * rate)
    if len(samples) != 2 or samples.shape[1] < size:
        return ""
    starts = np.unique(np.linspace(0, samples.shape[1] - size, MAX_LOOKS).astype(int))
    return inputs_of((samples[:, start : start + size] for start in starts.tolist()), rate).reason


def _stream(session: SessionReader, stream: str) -> Tree:
    track = session.readings(stream)
    count = len(track.time)
    span = float(track.time[-1] - track.time[0]) if count > 1 else 0.0
    return {
        "columns": list(track.feed.columns),
        "units": list(track.feed.units),
        "rate": track.feed.rate,
        "measured_rate": (count - 1) / span if span > 0.0 else None,
        "readings": count,
        "missing": track.missing,
        "faulty": int((track.status != 0).sum()),
    }


def _kinds(session: SessionReader) -> dict[str, int]:
    kinds = [event.kind for event in session.events]
    return {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}


def facts_lines(facts: Tree) -> list[str]:
    """Return the facts as text lines."""
    about, audio = facts["about"], facts["audio"]
    lines = [f"{facts['name']}  ({facts['path']})"]

    def say(name: str, text: str) -> None:
        lines.append(f"  {name:<{LABEL_WIDTH}} {text}")

    say("touched by", _touched(about))
    if about.get("simulated"):
        drawn = (f"{key} {about[key]}" for key in ("day", "build", "seed") if key in about)
        say("simulated", ", ".join(drawn) or "yes")
    say("begun", str(facts["begin"]))
    say("length", f"{facts['seconds']:.2f} s, {facts['ending']}")
    channels = f"{audio['channels']} channel{'' if audio['channels'] == 1 else 's'}"
    measured = f"{channels} at {audio['sample_rate']} Hz ({audio['measured_rate']:.2f} measured)"
    say("audio", f"{measured}; {audio['lost_frames']} frames lost in {audio['gaps']} gaps")
    if audio["inputs"]:
        say("inputs", audio["inputs"])
    for stream, each in facts["streams"].items():
        came = "" if each["measured_rate"] is None else f" ({each['measured_rate']:.2f} measured)"
        lost = f"{each['missing']} missing, {each['faulty']} faulty of {each['readings']}"
        due = f"{each['rate']:g} Hz" if each["rate"] else "rate unknown"
        say(stream, f"{' '.join(each['columns'])} at {due}{came}; {lost}")
    labels = facts["labels"]
    say("labels", f"{' '.join(labels['columns']) or 'none'}; {labels['rows']} rows")
    counted = [f"{count} {kind}" for kind, count in facts["events"].items()]
    more = [f"{len(counted) - MAX_KINDS} more kinds"] if len(counted) > MAX_KINDS else []
    say("events", ", ".join(counted[:MAX_KINDS] + more) or "none")
    if about.get("notes"):
        say("notes", " ".join(about["notes"].split()))
    if facts["content_checksum"]:
        say("content", facts["content_checksum"])
    if "figure" in facts:
        say("figure", facts["figure"])
    return lines


def _touched(about: dict[str, Any]) -> str:
    parts = [about["material"]]
    if "radius" in about:
        parts.append(f"radius {1e3 * about['radius']:g} mm")
    # The bench names an object by its material and radius.
    details = [part for part in parts if part and part not in about["object"]]
    return ", ".join(part for part in (about["object"], *details) if part) or "unknown"
