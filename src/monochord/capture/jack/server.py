"""A JACK server of our own with the dummy driver: real JACK where there is no sound card."""

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

START_TIMEOUT: Seconds = 20.0
END_TIMEOUT: Seconds = 20.0


@dataclass
class JackServer:
    """A jackd with the dummy driver, synchronous, so that it loses no frame of its own.

    As a context it is started, and stopped at the end. It runs in real time where that is allowed, and keeps
    its time then on a busy machine too.

    Parameters
    ----------
    name
        Name of the server; by default one that belongs to this process.
    period
        Frames a period.
    rate
        Sample rate in Hz.
    real_time
        Whether it asks for a real-time priority.

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
        """Start it, and return once clients can connect; raises `DeviceError` where it does not start."""
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
        """Kill -9, as a crash would."""
        if self.process:
            self.process.kill()
            self.process.wait()
            self.process = None

    def stop(self) -> None:
        """End it as a person would, so that it tidies up."""
        if self.process:
            self.process.terminate()
            self.process.wait(END_TIMEOUT)
            self.process = None

    def restart(self, rate: int = 0) -> None:
        """Kill it and start it again, with another rate if one is given."""
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
