"""What a simulated Net F/T has to send at any moment: its counters, faults and network, without sockets."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.capture.instruments import _rdt as rdt
from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds

FOR_EVER = -1
MOST_AT_ONCE = 70_000  # after a pause of the process; what is older is left out and counted lost


@dataclass(frozen=True, slots=True, kw_only=True)
class NetFtSettings:
    """How a simulated Net F/T behaves.

    Parameters
    ----------
    rate
        Records a second, as many as there are wrenches; at most 7000.
    counts_per_force, counts_per_torque
        Counts a newton and a newton metre.
    delay
        How much later than its time a wrench leaves the device, in s.
    jitter
        Mean of what the network adds to that, in s, exponentially distributed; records keep their order.
    loss
        Probability that a record is lost on the way.
    fault_after
        When a status is latched, in s after the begin, until the latch is reset; None for never.
    fault_status
        The status word then.
    silence
        From when to when, in s after the begin, the cable is out: nothing is sent or heard.
    restarts
        Whether the power went with the cable: it then counts anew, and waits to be asked.
    first_record, first_sample
        Where its two counters begin.
    wake
        How often those due are sent, in s: their times of arrival are bunched by as much.
    seed
        Of jitter and loss.
    host
        Address to listen at.
    rdt_port, http_port
        Ports; 0 lets the system choose.
    """

    rate: Hertz = rdt.INTERNAL_RATE
    counts_per_force: float = 1e6
    counts_per_torque: float = 1e6
    delay: Seconds = 0.0
    jitter: Seconds = 0.0
    loss: float = 0.0
    fault_after: Seconds | None = None
    fault_status: int = 0x80010000
    silence: tuple[Seconds, Seconds] | None = None
    restarts: bool = False
    first_record: int = 1
    first_sample: int = 0
    wake: Seconds = 1e-3
    seed: int = 0
    host: str = "127.0.0.1"
    rdt_port: int = 0
    http_port: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.rate <= rdt.INTERNAL_RATE:
            raise InputError(f"rate of {self.rate} Hz", "above 0 and at most 7000 Hz")
        if not 0.0 <= self.loss < 1.0:
            raise InputError(f"loss of {self.loss}", "a probability from 0 to below 1")
        if not (0.0 <= self.delay < np.inf and 0.0 <= self.jitter < np.inf):
            raise InputError(f"delay {self.delay} s and jitter {self.jitter} s", "0 s or more")
        for scale in (self.counts_per_force, self.counts_per_torque):
            if not 0.0 < scale < np.inf:
                raise InputError(f"{scale} counts a unit", "a number above 0")
        if not 1e-5 <= self.wake <= 0.1:
            raise InputError(f"wake of {self.wake} s", "0.00001 to 0.1 s")


class RecordStream:
    """The records of one device from `boot` on, in s of any clock: its counters, and what is on its way."""

    def __init__(self, wrenches: Floats, settings: NetFtSettings, boot: Seconds) -> None:
        per_unit = [settings.counts_per_force] * 3 + [settings.counts_per_torque] * 3
        self._counts = np.clip(np.rint(wrenches * per_unit), -(2**31), 2**31 - 1).astype(np.int64)
        self._settings = settings
        self._rng = np.random.default_rng(settings.seed)
        self._origin = boot  # sample m is taken at origin + m / rate
        self._begin = np.inf
        self._first = 1 << 62  # the sample that is taken at the begin
        self._sample_base = 0
        self._bias = np.zeros(6, np.int64)
        self._reset = self._rebooted = False
        self._left = 0
        self._record = settings.first_record
        self._next = 0
        self._leaves = -np.inf
        self._on_the_way: deque[tuple[Seconds, bytes]] = deque()
        self.lost = 0

    @property
    def streaming(self) -> bool:
        """Whether there are records still to come."""
        return self._left != 0 or bool(self._on_the_way)

    def begin_at(self, begin: Seconds) -> None:
        """Give the first wrench its time: the sampling is shifted by less than one sample to meet it."""
        rate = self._settings.rate
        self._first = int(np.ceil((begin - self._origin) * rate - 1e-6))
        self._begin, self._origin = begin, begin - self._first / rate

    def command(self, command: int, count: int, now: Seconds) -> None:
        """Obey a request, if the cable is in."""
        if self._silent(now):
            return
        self._reboot_if_due(now)
        if command == rdt.STREAM:
            self._left = count or FOR_EVER
            self._record, self._next = self._settings.first_record, self._sample_at(now) + 1
        elif command == rdt.STOP:
            self._left = 0
        elif command == rdt.RESET_LATCH:
            self._reset = self._reset or self._faulty(now)
        elif command == rdt.BIAS:
            self._bias = self._load(np.array([self._sample_at(now)]))[0]

    def due(self, now: Seconds) -> list[bytes]:
        """Return what arrives by now, oldest first."""
        self._reboot_if_due(now)
        stop = self._sample_at(now) + 1
        if self._left != 0 and stop > self._next:
            if self._left > 0:
                stop = min(stop, self._next + self._left)
                self._left -= stop - self._next
            self._emit(np.arange(self._next, stop))
            self._next = stop
        out: list[bytes] = []
        while self._on_the_way and self._on_the_way[0][0] <= now:
            out.append(self._on_the_way.popleft()[1])
        return out

    def _emit(self, sample: NDArray[np.int64]) -> None:
        settings, n = self._settings, sample.size
        taken = self._origin + sample / settings.rate
        records = np.zeros(n, rdt.RECORD)
        records["rdt"] = (self._record + np.arange(n)) % (1 << 32)
        inside = np.floor((sample - self._sample_base) * (rdt.INTERNAL_RATE / settings.rate)).astype(np.int64)
        records["ft"] = (settings.first_sample + inside) % (1 << 32)
        records["status"] = np.where(self._faulty(taken), settings.fault_status, 0)
        records["counts"] = self._load(sample) - self._bias
        self._record += n
        leaves = taken + settings.delay
        lost = self._rng.random(n) < settings.loss if settings.loss else np.zeros(n, np.bool_)
        lost |= self._silent(leaves)
        lost[: max(0, n - MOST_AT_ONCE)] = True
        if settings.jitter:
            leaves = np.maximum.accumulate(
                np.maximum(leaves + self._rng.exponential(settings.jitter, n), self._leaves)
            )
            self._leaves = float(leaves[-1])
        self.lost += int(lost.sum())
        data, size = records.tobytes(), rdt.RECORD.itemsize
        self._on_the_way.extend(
            (float(leaves[k]), data[k * size : (k + 1) * size]) for k in np.flatnonzero(~lost)
        )

    def _sample_at(self, now: Seconds) -> int:
        """Return the last sample that has left by now."""
        return int(np.floor((now - self._settings.delay - self._origin) * self._settings.rate))

    def _load(self, sample: NDArray[np.int64]) -> NDArray[np.int64]:
        return self._counts[np.clip(sample - self._first, 0, len(self._counts) - 1)]

    def _faulty(self, time: Floats | Seconds) -> NDArray[np.bool_] | np.bool_ | bool:
        after = self._settings.fault_after
        return after is not None and not self._reset and np.greater_equal(time, self._begin + after)

    def _silent(self, time: Floats | Seconds) -> NDArray[np.bool_] | np.bool_ | bool:
        if self._settings.silence is None:
            return False
        start, stop = self._settings.silence
        return np.greater_equal(time, self._begin + start) & np.less(time, self._begin + stop)

    def _reboot_if_due(self, now: Seconds) -> None:
        settings = self._settings
        if not settings.restarts or settings.silence is None or self._rebooted:
            return
        if now >= self._begin + settings.silence[1]:
            self._rebooted, self._left = True, 0
            self._sample_base = self._sample_at(now)
            self._bias = np.zeros(6, np.int64)
            self._on_the_way.clear()
