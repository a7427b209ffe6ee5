"""Verbs run as processes, several at a time, which end when they are told to."""

import os
import subprocess
import sys
import threading
from dataclasses import dataclass, field

from monochord.core.errors import MonochordError

PROGRAM = (sys.executable, "-c", "from monochord.cli import main; main()")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""What tells numerical libraries how many threads to start; one, where nobody has said."""


class AblationError(MonochordError):
    """A training or an evaluation of a grid failed; its own line says why."""


@dataclass(frozen=True, slots=True)
class Children:
    """The processes that run now. `stop` ends them and lets no other begin."""

    _running: set["subprocess.Popen[str]"] = field(default_factory=set["subprocess.Popen[str]"])
    _stopped: threading.Event = field(default_factory=threading.Event)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self, name: str, *arguments: str) -> str:
        """Return what a verb prints.

        Raises
        ------
        AblationError
            With the name and the verb's own line, where it fails or is stopped.
        """
        environment = {**dict.fromkeys(THREADS, "1"), **os.environ}
        with self._lock:
            if self._stopped.is_set():
                raise AblationError(f"variation {name}, {arguments[0]}: interrupted")
            child = subprocess.Popen(  # noqa: S603  (our own)
                [*PROGRAM, *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env=environment,
            )
            self._running.add(child)
        with child:
            out, err = child.communicate()
        with self._lock:
            self._running.discard(child)
        if child.returncode:
            line = (err.strip().splitlines() or ["no reason given"])[-1].removeprefix("monochord: ")
            raise AblationError(f"variation {name}, {arguments[0]}: {line}")
        return out

    def stop(self) -> None:
        """End all that run, and let no other begin."""
        with self._lock:
            self._stopped.set()
            for child in list(self._running):
                child.terminate()
