"""An open JACK capture, with the patience to outlive server and ports."""

import time
from typing import TYPE_CHECKING

from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.client import JackClient
from monochord.capture.jack.ring import Period, Ring
from monochord.capture.sources._jack_ports import choose_ports
from monochord.capture.sources._rates import refuse_other_rates
from monochord.capture.sources._ring_stream import RingStream
from monochord.core.clock import clock_offsets
from monochord.core.errors import DeviceError
from monochord.core.types import Signal, StreamHealth
from monochord.core.units import Seconds

if TYPE_CHECKING:
    from monochord.capture.sources.jack import Jack

RETRY: Seconds = 0.05  # between looks for a server or port that is away
IDLE: Seconds = 0.5  # between looks at anything else while no audio comes
CLOCK_EVERY: Seconds = 1.0  # between measurements of the clock offset


class JackStream(RingStream):
    """See `Jack`, whose options it is made of."""

    def __init__(self, options: "Jack") -> None:
        self._options = options
        self._client: JackClient | None = None
        self._away_since: Seconds = 0.0  # where there is no client
        self._reconnects = 0
        client = JackClient(options.client_name, options.server)
        try:
            rate = client.sample_rate
            refuse_other_rates(rate, "JACK server", "start it with -r 44100")
            ring = Ring(options.channels, max(round(options.ring_seconds * rate), 4 * client.period))
            super().__init__(Signal(sample_rate=rate, channels=options.channels), ring)
            self._inputs = self._enter(client)
            self._connect(client)
        except BaseException:
            client.close()
            raise
        self._client = client

    @property
    def health(self) -> StreamHealth:
        """Counters so far, and the offsets of the machine's clocks and JACK's to the monotonic clock."""
        return self._timeline.health(
            xruns=self._ring.arena.count(at.XRUNS),
            reconnects=self._reconnects,
            clock_offsets={**clock_offsets(), "jack": self._clock_offset},
        )

    def _idle(self) -> None:
        if self._client is None:
            if self._options.reconnect:
                self._return()
            else:
                self._closed.set()
        elif self._ring.arena.count(at.GONE):
            self._leave()  # what it published last is taken on the next turn
        else:
            self._tend_ports(self._client)
            self._ring.arena.wait(RETRY if self._waiting else IDLE)

    def _leave(self) -> None:
        if self._client:
            self._client.close()
            self._client, self._away_since = None, time.monotonic()

    def _enter(self, client: JackClient) -> list[str]:
        """Register the inputs on a server and begin to capture; return their names."""
        from monochord.capture.jack import callbacks  # noqa: PLC0415  (compiled by now)

        self._waiting = False
        inputs = client.start(self._ring.arena, callbacks.capture.address, libjack.IS_INPUT, "in")
        self._ports_seen = self._ring.arena.count(at.PORTS_CHANGED)
        self._measure_clock(client)
        return inputs

    def _connect(self, client: JackClient) -> None:
        """Connect the inputs; raises `DeviceError` where the ports are not there."""
        self._ports_seen = self._ring.arena.count(at.PORTS_CHANGED)
        if self._options.ports == "none":
            return
        outputs = choose_ports(client, self._options.ports, self._signal.channels)
        for output, into in zip(outputs, self._inputs, strict=True):
            if not client.connect(output, into):
                raise DeviceError(f"JACK port {output}: refused the connection; is its client active?")
        self._measure_clock(client)

    def _tend_ports(self, client: JackClient) -> None:
        """Connect again after ports came or went, if ours were among them."""
        changed = self._ring.arena.count(at.PORTS_CHANGED)
        if self._options.ports == "none" or not (self._waiting or changed != self._ports_seen):
            return
        self._ports_seen = changed
        if all(client.connected(port) for port in self._ring.arena.ports):
            self._waiting = False
        elif not self._options.reconnect:
            self._closed.set()
        else:
            self._waiting = not self._reconnected(client)

    def _reconnected(self, client: JackClient) -> bool:
        try:
            self._connect(client)
        except DeviceError:
            return False
        self._reconnects += 1
        return True

    def _return(self) -> None:
        """Try once to come back to a server that went away."""
        try:
            client = JackClient(self._options.client_name, self._options.server)
        except DeviceError:
            if time.monotonic() - self._away_since > self._options.patience_seconds:
                raise
            self._closed.wait(RETRY)
            return
        try:
            self._refuse_other_rate(client.sample_rate)
            self._timeline.interrupt()
            self._inputs = self._enter(client)
        except BaseException:
            client.close()
            raise
        self._client = client
        self._waiting = self._options.ports != "none"
        self._reconnects += not self._waiting  # with ports to connect, it counts when they are

    def _refuse_other_rate(self, rate: int) -> None:
        before = self._signal.sample_rate
        if rate != before:
            line = f"JACK server came back at {rate} Hz: allowed is {before} Hz, as before; open it anew"
            raise DeviceError(line)

    def _adc_time(self, period: Period) -> Seconds | None:
        if self._client and time.monotonic() - self._clock_read > CLOCK_EVERY:
            self._measure_clock(self._client)
        if not period.microseconds:
            return None
        return period.microseconds * 1e-6 - self._clock_offset - self._latency / self._signal.sample_rate

    def _measure_clock(self, client: JackClient) -> None:
        self._clock_offset, self._clock_read = client.clock_offset(), time.monotonic()
        self._latency = max(client.capture_latency(port) for port in self._ring.arena.ports)
