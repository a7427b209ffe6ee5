"""Starts a JACK server with the dummy driver: real JACK without a sound card."""

import os
import shutil
import subprocess
import time
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

from monochord.capture.jack.client import JackClient
from monochord.capture.jack.libjack import START_JACK
from monochord.core.errors import DeviceError
from monochord.core.units import Samples, Seconds

__all__ = ["JackServer"]

START_TIMEOUT: Seconds = 20.0
END_TIMEOUT: Seconds = 20.0


@dataclass
class JackServer:
    """A jackd with the dummy driver in synchronous mode, so that it loses no frames by itself.

    As a context manager it starts the server and stops it at the end. The server runs in real time where
    permitted, and then keeps time on a busy machine too.

    Parameters
    ----------
    name
        Name of the server; by default one unique to this process.
    period
        Frames per period.
    rate
        Sample rate in Hz.
    real_time
        Whether to request real-time priority.

    Examples
    --------
    ``with JackServer() as server:``, then the source ``jack`` with ``server=server.name``.
    """

    name: str = field(default_factory=lambda: f"monochord-{os.getpid()}")
    period: Samples = 512
    rate: int = 44100
    real_time: bool = True
    process: "subprocess.Popen[bytes] | None" = None

    def start(self) -> None:
        """Start the server and wait until clients can connect; raises `DeviceError` on failure."""
        jackd = shutil.which("jackd")
        if not jackd:
            raise DeviceError(f"jackd: not found; {START_JACK}")
        pace = ["-S", "-R" if self.real_time else "-r"]
        options = ["-n", self.name, *pace, "-d", "dummy", "-r", str(self.rate), "-p", str(self.period)]
        quiet = subprocess.DEVNULL
        self.process = subprocess.Popen([jackd, *options], stdin=quiet, stdout=quiet, stderr=quiet)  # noqa: S603  (found in PATH, no shell)  # nosec B603
        deadline = time.monotonic() + START_TIMEOUT
        while True:
            try:
                return JackClient("probe", self.name).close()
            except DeviceError as error:
                if self.process.poll() is not None or time.monotonic() > deadline:
                    self.kill()
                    raise DeviceError(f"JACK server '{self.name}': jackd did not start") from error
                time.sleep(0.02)

    def kill(self) -> None:
        """Kill the server with SIGKILL, as in a crash."""
        if self.process:
            self.process.kill()
            self.process.wait()
            self.process = None

    def stop(self) -> None:
        """Stop the server with SIGTERM, so that it cleans up."""
        if self.process:
            self.process.terminate()
            self.process.wait(END_TIMEOUT)
            self.process = None

    def restart(self, rate: int = 0) -> None:
        """Kill the server and start it again, optionally at another rate."""
        self.kill()
        self.rate = rate or self.rate
        self.start()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
