"""Plays samples into a real JACK server, without gaps and from a known first frame.

As a process it plays a file that `write_script` wrote. It prints its ports as one line of JSON, reads each
line of its standard input as the start, in s of the monotonic clock, and ends when that input does::

    python -m monochord.lab.player FILE.npz
"""

import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.arena import Arena
from monochord.capture.jack.atomics import store
from monochord.capture.jack.client import JackClient
from monochord.core.closing import Closing
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio
from monochord.core.units import Samples, Seconds
from monochord.lab._script import follow_input, read_script, write_script

__all__ = ["Player", "PlayerSettings", "serve", "write_script"]

SCHEDULE_AHEAD: Seconds = 0.2
"""Time before the start at which the first frame is scheduled, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayerSettings:
    """Options of a player process, which plays its samples `repeat` times; see `Player`."""

    sample_rate: int = 44100
    repeat: int = 1
    client_name: str = "player"
    server: str = ""


class Player(Closing):
    """A JACK client with one output per channel, which plays once all of them are connected.

    The whole signal (channels, n) is in memory, and a compiled callback plays it, so that another client can
    capture every sample from the first on. There is silence before and after. `sample_rate` must equal the
    server's. The outputs ``CLIENT_NAME:out_1`` and so on are connected to the ports `connect`; by default,
    the receiver connects. `begin` is the first sample's time, in s of the monotonic clock: `wait` schedules
    it, and late samples are skipped. Infinity: set later by `begin_at`. None: as soon as all ports are
    connected.
    """

    def __init__(
        self,
        samples: Audio,
        sample_rate: int,
        *,
        client_name: str = "player",
        server: str = "",
        connect: tuple[str, ...] = (),
        begin: Seconds | None = None,
    ) -> None:
        if samples.ndim != 2 or not samples.size:
            raise InputError(f"samples of shape {samples.shape}", "(channels, n), none of them zero")
        self._tape = Arena(*samples.shape, periods=0)
        self._tape.samples[:] = samples
        self._tape.words[at.SCHEDULED] = begin is not None
        self._begin = begin
        self._client = JackClient(client_name, server)
        try:
            self._refuse_other_rate(sample_rate)
            self.ports = self._start()
            self._connect(connect)
        except BaseException:
            self.close()
            raise

    @property
    def position(self) -> Samples:
        """Number of frames played so far."""
        return self._tape.count(at.READ)

    @property
    def ended(self) -> bool:
        """Whether all samples have been played."""
        return self.position == self._tape.samples.shape[1]

    @property
    def gone(self) -> bool:
        """Whether the server has shut down."""
        return bool(self._tape.count(at.GONE))

    def wait(self, seconds: Seconds) -> bool:
        """Wait up to `seconds` for the end of the samples or of the server.

        Return whether all were played.
        """
        deadline = time.monotonic() + seconds
        if self._begin is not None and self._begin < math.inf:
            self._schedule(self._begin, deadline)
        while not (self.ended or self.gone) and (left := deadline - time.monotonic()) > 0.0:
            self._tape.wait(left)
        return self.ended

    def begin_at(self, begin: Seconds) -> None:
        """Set the time of the first sample; waits until shortly before it."""
        self._schedule(begin, math.inf)

    def close(self) -> None:
        """Leave the server."""
        self._client.close()
        self._tape.close()

    def _schedule(self, begin: Seconds, deadline: Seconds) -> None:
        """Schedule the first frame shortly before its time, when JACK's clock predicts it best."""
        while (left := min(begin - SCHEDULE_AHEAD, deadline) - time.monotonic()) > 0.0 and not self.gone:
            self._tape.wait(left)
        if not self.gone and time.monotonic() >= begin - SCHEDULE_AHEAD:
            self._tape.words[at.BEGIN] = self._client.frame_at(begin)
            store(self._tape.words, at.SCHEDULED, 2)
            self._begin = None

    def _refuse_other_rate(self, sample_rate: int) -> None:
        rate = self._client.sample_rate
        if rate != sample_rate:
            given = f"samples at {sample_rate} Hz"
            raise InputError(given, f"the JACK server's {rate} Hz", "resample them first")

    def _start(self) -> list[str]:
        from monochord.capture.jack import callbacks  # noqa: PLC0415  (compiled by now)

        return self._client.start(self._tape, callbacks.play.address, libjack.IS_OUTPUT, "out")

    def _connect(self, inputs: tuple[str, ...]) -> None:
        for output, into in zip(self.ports, inputs, strict=False):
            if not self._client.connect(output, into):
                raise DeviceError(f"JACK port {into}: no such input, or its client is not active")


def serve(path: Path) -> None:
    """Play the script at `path`, its array ``samples``, until the standard input ends."""
    arrays, settings = read_script(path, PlayerSettings)
    with Player(
        np.tile(arrays["samples"].astype(np.float32), settings.repeat),
        settings.sample_rate,
        client_name=settings.client_name,
        server=settings.server,
        begin=math.inf,
    ) as player:
        follow_input({"ports": player.ports}, player.begin_at)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
