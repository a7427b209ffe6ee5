"""Compiled callbacks for JACK's threads: no Python, no allocation, no lock.

Each receives the address of an arena (see `arena`) and stores everything there. Handles and addresses are
passed as integers of pointer size. Importing this module compiles the callbacks or loads them from numba's
cache, so import it before activating a client.
"""

from collections.abc import Callable
from typing import Any
from zlib import crc32

import numpy as np
from llvmlite import binding
from numba import carray, njit, types  # pyright: ignore[reportPrivateImportUsage]
from numba.core.types import ExternalFunction

from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.atomics import load_acquire, store_release
from monochord.core.kernels import callback

binding.load_library_permanently(libjack.path())

_get_buffer = ExternalFunction("jack_port_get_buffer", types.intp(types.intp, types.uint32))
_connected = ExternalFunction("jack_port_connected", types.int32(types.intp))
_last_frame_time = ExternalFunction("jack_last_frame_time", types.uint32(types.intp))
_cycle_times = ExternalFunction("jack_get_cycle_times", types.int32(*[types.intp] * 5))
_write = ExternalFunction("write", types.intp(types.int32, types.intp, types.intp))
_copy = ExternalFunction("memcpy", types.intp(types.intp, types.intp, types.intp))
_fill = ExternalFunction("memset", types.intp(types.intp, types.int32, types.intp))

WORD, SAMPLE = 8, 4  # bytes
FAR_AHEAD = 1 << 62  # frames
HALF_SPAN = 1 << 31  # frames; JACK counts modulo twice as many


# Numba's cache looks at the age of this file only, but the arena's layout is in another: so that code for an
# old layout is never taken for the new one, its checksum is part of the name under which code is kept.
LAYOUT = crc32(repr([item for item in vars(at).items() if item[0].isupper()]).encode())


def _callback(result: Any, *arguments: Any) -> Callable[[Any], Any]:
    """Compile a function into a C function of this signature; the attribute `address` is its address."""

    def compiled(function: Any) -> Any:
        function.__qualname__ += f"_{LAYOUT:08x}"
        return callback(result(*arguments))(function)

    return compiled


@njit
def _words(arena: Any) -> Any:
    size = carray(arena, (at.PORTS,), np.int64)[at.WORDS]
    return carray(arena, (size,), np.int64)


@njit
def _wake(words: Any) -> None:
    _write(np.int32(words[at.WAKE]), words[at.SELF] + WORD * at.ONE, WORD)


@njit
def _all_connected(words: Any) -> bool:
    connected = 0
    for channel in range(words[at.CHANNELS]):
        connected += min(_connected(words[at.PORTS + channel]), 1)
    return connected == words[at.CHANNELS]


@njit
def _cycle_start(words: Any) -> int:
    """Return JACK's start time of this period in microseconds, 0 until its clock has settled."""
    scratch = words[at.SELF] + WORD * at.SCRATCH
    failed = _cycle_times(words[at.CLIENT], scratch, scratch + WORD, scratch + 2 * WORD, scratch + 3 * WORD)
    return 0 if failed else words[at.SCRATCH + 1]


@njit
def _frames_ahead(words: Any) -> int:
    """Return how many frames after this period's start playback begins; negative where it is late."""
    scheduled = load_acquire(words, at.SCHEDULED)
    if scheduled == 0:
        return 0
    if scheduled == 1:
        return FAR_AHEAD
    now = np.int64(_last_frame_time(words[at.CLIENT]))
    return (words[at.BEGIN] - now + HALF_SPAN) % (2 * HALF_SPAN) - HALF_SPAN


@_callback(types.int32, types.uint32, types.voidptr)
def capture(nframes: Any, arena: Any) -> Any:
    """Copy one period of every port into the ring and publish it, if every port is connected."""
    words = _words(arena)
    if not _all_connected(words):
        return 0
    frames, capacity = np.int64(nframes), words[at.FRAMES]
    channels, written, published = words[at.CHANNELS], words[at.WRITTEN], words[at.PUBLISHED]
    full = published - load_acquire(words, at.CONSUMED) >= words[at.PERIODS]
    if full or written - load_acquire(words, at.READ) + frames > capacity:
        words[at.OVERFLOWED] += frames
        return 0
    slot = written & (capacity - 1)
    first = min(frames, capacity - slot)
    for channel in range(channels):
        source = _get_buffer(words[at.PORTS + channel], nframes)
        target = words[at.SELF] + WORD * words[at.SAMPLES_AT] + SAMPLE * channel * capacity
        _copy(target + SAMPLE * slot, source, SAMPLE * first)
        _copy(target, source + SAMPLE * first, SAMPLE * (frames - first))
    header = at.PORTS + channels + at.HEADER * (published & (words[at.PERIODS] - 1))
    words[header] = np.int64(_last_frame_time(words[at.CLIENT]))
    words[header + 1] = _cycle_start(words)
    words[header + 2] = frames
    words[header + 3] = written
    words[at.WRITTEN] = written + frames
    store_release(words, at.PUBLISHED, published + 1)
    _wake(words)
    return 0


@_callback(types.int32, types.uint32, types.voidptr)
def play(nframes: Any, arena: Any) -> Any:
    """Play one period of the tape on every port; silence before its start and after its end.

    Playback starts when all ports are connected, or at the frame set beforehand; a late start skips frames.
    """
    words = _words(arena)
    frames, length, position = np.int64(nframes), words[at.FRAMES], words[at.READ]
    silence = np.int64(0)
    if position == 0:
        ahead = _frames_ahead(words) if _all_connected(words) else frames
        silence = min(max(ahead, 0), frames)
        position = min(max(-ahead, 0), length)
    count = min(frames - silence, length - position)
    for channel in range(words[at.CHANNELS]):
        target = _get_buffer(words[at.PORTS + channel], nframes)
        source = words[at.SELF] + WORD * words[at.SAMPLES_AT] + SAMPLE * (channel * length + position)
        _fill(target, 0, SAMPLE * silence)
        _copy(target + SAMPLE * silence, source, SAMPLE * count)
        _fill(target + SAMPLE * (silence + count), 0, SAMPLE * (frames - silence - count))
    ends = words[at.READ] < length and position + count == length
    store_release(words, at.READ, position + count)
    if ends:
        _wake(words)
    return 0


@_callback(types.int32, types.uint32, types.voidptr)
def relay(nframes: Any, arena: Any) -> Any:
    """Play one period of the ring on every port, on the server's clock once all ports are connected.

    Frame 0 is that of the first such period. A frame that was written too late is silence.
    """
    words = _words(arena)
    frames, capacity = np.int64(nframes), words[at.FRAMES]
    now = np.int64(_last_frame_time(words[at.CLIENT]))
    if words[at.SCHEDULED] == 0 and _all_connected(words):
        words[at.BEGIN] = now
        words[at.SCHEDULED] = 2
    begun = words[at.SCHEDULED] == 2
    before = words[at.READ]
    position = before + (now - words[at.BEGIN] - before + HALF_SPAN) % (2 * HALF_SPAN) - HALF_SPAN
    ready = min(max(load_acquire(words, at.WRITTEN) - position, 0), frames) if begun else 0
    slot = position & (capacity - 1)
    first = min(ready, capacity - slot)
    for channel in range(words[at.CHANNELS]):
        target = _get_buffer(words[at.PORTS + channel], nframes)
        source = words[at.SELF] + WORD * words[at.SAMPLES_AT] + SAMPLE * channel * capacity
        _copy(target, source + SAMPLE * slot, SAMPLE * first)
        _copy(target + SAMPLE * first, source, SAMPLE * (ready - first))
        _fill(target + SAMPLE * ready, 0, SAMPLE * (frames - ready))
    if begun:
        words[at.OVERFLOWED] += frames - ready
        store_release(words, at.READ, position + frames)
    _wake(words)
    return 0


@_callback(types.int32, types.voidptr)
def xrun(arena: Any) -> Any:
    """Count an xrun reported by the server."""
    _words(arena)[at.XRUNS] += 1
    return 0


@_callback(types.void, types.voidptr)
def shutdown(arena: Any) -> None:
    """Record that the server has shut down, and wake the reader."""
    words = _words(arena)
    store_release(words, at.GONE, 1)
    _wake(words)


@_callback(types.void, types.uint32, types.int32, types.voidptr)
def port_registration(_port: Any, _registered: Any, arena: Any) -> None:
    """Record that a port appeared or disappeared, and wake the reader, which connects it."""
    words = _words(arena)
    words[at.PORTS_CHANGED] += 1
    _wake(words)


@_callback(types.void, types.voidptr)
def silent(_message: Any) -> None:
    """Discard a message from the library."""
