"""One memory block shared by a compiled callback and Python: counters, port handles, headers, samples.

It is an array of int64 words, so that a callback needs only its address: counters first, then the port
handles, then one header per period, then the samples as float32, channel by channel.
"""

import os
import select
import weakref

import numpy as np
from numpy.typing import NDArray

from monochord.capture.jack.atomics import load
from monochord.core.types import Audio
from monochord.core.units import Samples, Seconds

# Words of the arena. Those that two threads change at full pace stand on cache lines of their own.
PUBLISHED = 0  # periods written so far (by the writer; release)
WRITTEN = 1  # frames written so far (by the writer)
CONSUMED = 8  # periods read so far (by the reader; release)
READ = 9  # frames read, or played, so far (by the reader; release)
CHANNELS = 16
FRAMES = 17  # capacity in frames; a power of two where it is a ring
PERIODS = 18  # capacity in headers, a power of two
SAMPLES_AT = 19  # word at which the samples begin
WORDS = 20  # length of the arena
WAKE = 21  # file descriptor that is sent ONE when something happened
CLIENT = 22  # the device's handle
SELF = 23  # address of the arena
OVERFLOWED = 24  # frames that found the ring full
XRUNS = 25
GONE = 26  # 1 once the server has gone
PORTS_CHANGED = 27  # ports registered or unregistered so far
ONE = 28  # the constant 1
BEGIN = 29  # the device's frame count, modulo 2^32, at which the first frame is to be played
SCHEDULED = 30  # 0: play when connected; 1: wait, the frame is not yet known; 2: play from BEGIN on
SCRATCH = 32  # four words into which the device writes its times
PORTS = 40  # port handles begin here, one a channel
HEADER = 4  # words a header: device's frame count and its clock in microseconds, frames, first frame's count


class Arena:
    """Memory for `frames` frames of `channels` channels in at most `periods` periods, initialised to zero.

    `words` is the whole memory; `samples` (channels, frames) and `headers` (periods, `HEADER`) are views.
    """

    def __init__(self, channels: int, frames: Samples, periods: int) -> None:
        headers_at = PORTS + channels
        samples_at = headers_at + HEADER * periods
        size = samples_at + (channels * frames + 1) // 2
        self.words: NDArray[np.int64] = np.zeros(size, np.int64)
        self.headers = self.words[headers_at:samples_at].reshape(periods, HEADER)
        floats = self.words[samples_at:].view(np.float32)
        self.samples: Audio = floats[: channels * frames].reshape(channels, frames)
        descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._close = weakref.finalize(self, os.close, descriptor)
        self._close.atexit = False  # a callback may still run then
        constants = {
            CHANNELS: channels,
            FRAMES: frames,
            PERIODS: periods,
            SAMPLES_AT: samples_at,
            WORDS: size,
            WAKE: descriptor,
            SELF: self.words.ctypes.data,
            ONE: 1,
        }
        for field, value in constants.items():
            self.words[field] = value

    @property
    def address(self) -> int:
        """Address of the memory, as passed to a compiled callback."""
        return int(self.words[SELF])

    @property
    def ports(self) -> list[int]:
        """JACK's port handles, one per channel."""
        return self.words[PORTS : PORTS + self.samples.shape[0]].tolist()

    def count(self, field: int) -> int:
        """Return a counter, such as `XRUNS`, with acquire ordering."""
        return load(self.words, field)

    def wake(self) -> None:
        """Wake the thread in `wait`; after `close`, do nothing."""
        descriptor = int(self.words[WAKE])
        if descriptor >= 0:
            os.eventfd_write(descriptor, 1)

    def wait(self, seconds: Seconds) -> None:
        """Wait until a callback or `wake` wakes this thread, or until the timeout."""
        descriptor = int(self.words[WAKE])
        if select.select((descriptor,), (), (), seconds)[0]:
            os.eventfd_read(descriptor)

    def close(self) -> None:
        """Close the file descriptor; no callback may run any more. A second call does nothing.

        An unreferenced arena is closed automatically.
        """
        self.words[WAKE] = -1
        self._close()
