"""A session recorded during a run."""

from dataclasses import replace
from pathlib import Path

from monochord.core.types import Signal
from monochord.core.units import Samples, Seconds
from monochord.live.delivery import Delivery, reason
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Run, Update


class Recording:
    """A session of a run from its next window on, written by the sink ``mcap`` in a separate thread.

    Its length so far is `seconds`. `failure` says why it ended by itself, such as a full disk; empty
    otherwise. Raises `InputError` where the file exists or cannot be created.
    """

    def __init__(self, path: Path, signal: Signal) -> None:
        self.path = path
        self.seconds: Seconds = 0.0
        self.failure = ""
        self._first: Samples | None = None
        self._delivery = Delivery([SINKS.build("mcap", {"path": str(path)})], Run(signal=signal), paced=True)
        self._delivery.__enter__()

    def take(self, update: Update) -> None:
        """Record an update; the first one starts the session."""
        window = update.window
        if self._first is None:
            self._first = window.start
        start = window.start - self._first
        if self.failure:
            return
        try:
            self._delivery.hand_over(replace(update, window=replace(window, start=start), string=""))
        except Exception as error:  # noqa: BLE001  (whatever writing raised; the run and the page go on)
            self.failure = reason(error)
        self.seconds = start / window.sample_rate + window.duration

    def close(self) -> None:
        """Complete the file."""
        try:
            self._delivery.__exit__(None, None, None)
        except Exception as error:  # noqa: BLE001
            self.failure = self.failure or reason(error)
