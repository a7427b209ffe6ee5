"""A session cut into frames of equal length, as a LeRobot episode."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.sessions import Session
from monochord.sessions.alignment import AUDIO, Alignment, align, aligned_readings

Frames: TypeAlias = dict[str, np.ndarray[Any, np.dtype[Any]]]
"""Features by name, (frames,) or (frames, values)."""
STATE, GAP, LABEL = "observation.state", "observation.gap", "label."
MOST_FRAMES_A_SECOND = 200


def refuse_unlike(sessions: Sequence[Session]) -> None:
    """Raise `InputError` where the sessions' features would not be the same; all episodes share them."""
    if not sessions:
        raise InputError("no session", "1 or more")
    forms = [_form(session) for session in sessions]
    for session, form in zip(sessions, forms, strict=True):
        for what, (ours, first) in {k: (form[k], forms[0][k]) for k in form}.items():
            if ours != first:
                given = f"session {session.path} with {what} {ours}"
                raise InputError(given, f"{first}, as {sessions[0].path} has", "export them apart")


def _form(session: Session) -> dict[str, Any]:
    told = session.description
    names = {stream: told.feed(stream).columns for stream in session.streams}
    microphones = f"{told.channels} at {told.sample_rate} Hz"
    return {"microphones": microphones, "streams": names, "labels": sorted(session.labels.columns)}


def frames_of(session: Session, fps: int, *, aligned: bool, force: bool = False) -> Frames:
    """Return a session's frames; raises `InputError` where a frame is not a whole number of samples.

    With `aligned`, readings count from when they were taken, and what taps tell of the streams' offsets is
    taken off; without, from when they arrived. A session whose alignment warns of something is then refused
    unless `force` is set.
    """
    audio = session.audio
    size, rest = divmod(audio.sample_rate, fps)
    if rest:
        fitting = (n for n in range(1, MOST_FRAMES_A_SECOND + 1) if audio.sample_rate % n == 0)
        allowed = ", ".join(map(str, fitting)) + f" at {audio.sample_rate} Hz"
        raise InputError(f"{fps} frames a second", allowed, "or a frame is no whole number of samples")
    count = audio.samples.shape[1] // size
    if not count:
        raise InputError(f"session {session.path} (shorter than a frame)", f"{1 / fps:g} s or more")
    parts = audio.samples[:, : count * size].reshape(-1, count, size)
    found: Frames = {f"observation.microphone_{n}": part for n, part in enumerate(parts, start=1)}
    found[GAP] = np.zeros(count, dtype=bool)
    for first, stop in audio.gaps:
        found[GAP][first // size : -(-stop // size)] = True
    ends = audio.time(size * np.arange(1, count + 1))
    alignment = align(session) if aligned and session.streams else None
    if alignment and alignment.flags and not force:
        first, *others = alignment.flags
        given = f"session {session.path}: {first}" + (f" (and {len(others)} more)" if others else "")
        raise InputError(given, "streams on one clock", "leave it out, or set force=true or aligned=false")
    when = ends if alignment is None else alignment.correct(AUDIO, ends)
    states = [_held(session, stream, when, alignment) for stream in session.streams]
    if states:
        with np.errstate(over="ignore"):  # what float32 does not hold is infinite there
            state = np.concatenate(states, axis=1).astype(np.float32)
        found[STATE] = state if state.shape[1] > 1 else state[:, 0]
    labels = session.labels
    for name, column in sorted(labels.columns.items()):
        if len(labels.time):
            latest = np.searchsorted(np.maximum.accumulate(labels.time), when, side="right") - 1
            values = np.where(latest < 0, np.nan, column[np.maximum(latest, 0)])
            found[LABEL + name] = values.astype(np.float32)
    return found


def state_names(session: Session) -> list[str]:
    """Return the names of the state's values."""
    feeds = (session.description.feed(stream) for stream in session.streams)
    return [f"{feed.stream}.{column}" for feed in feeds for column in feed.columns]


def _held(session: Session, stream: str, at: Floats, alignment: Alignment | None) -> Floats:
    """Return the latest reading at each time, so that none is of the future; the first one before that."""
    bare = alignment is None
    track = session.readings(stream) if bare else aligned_readings(session, stream, alignment)
    if not len(track.time):
        allowed = "at least one reading of each stream"
        raise InputError(f"stream '{stream}' of session {session.path} (empty)", allowed)
    latest = np.searchsorted(np.maximum.accumulate(track.time), at, side="right") - 1
    return track.values[np.maximum(latest, 0)]


def task_of(session: Session) -> str:
    """Return what the episode is about, in words."""
    told = session.description
    touched = "touch the string" + (f" with {told.object}" if told.object else "")
    return told.more.get("task", touched)
