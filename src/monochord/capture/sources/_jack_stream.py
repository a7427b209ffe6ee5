"""An open JACK capture that survives a server or ports going away and coming back."""

import re
import time

from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.client import JackClient
from monochord.capture.jack.ring import Period, Ring
from monochord.capture.sources._ring_stream import RingStream
from monochord.capture.sources.base import refuse_other_rates
from monochord.core.clock import clock_offsets
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Signal, StreamHealth
from monochord.core.units import Seconds

RETRY: Seconds = 0.05  # between looks for a server or port that is away
IDLE: Seconds = 0.5  # between looks at anything else while no audio comes
CLOCK_EVERY: Seconds = 1.0  # between measurements of the clock offset
RING_SECONDS: Seconds = 2.0
"""How long the reader may pause before frames are lost, in s."""


class JackStream(RingStream):
    """Blocks of a JACK server's ports; see `Jack` for the arguments."""

    def __init__(
        self,
        *,
        ports: str,
        client_name: str,
        server: str,
        channels: int,
        reconnect: bool,
    ) -> None:
        self._names = client_name, server
        self._port_pattern, self._reconnect = ports, reconnect
        self._parts: list[str] | None = None  # of the pattern, once the ports were there
        self._client: JackClient | None = None
        self._reconnects = 0
        self._unplugged: list[str] = []  # our ports that nothing is connected to, as last seen
        client = JackClient(*self._names)
        try:
            rate = client.sample_rate
            refuse_other_rates(rate, "JACK server", "start it with -r 44100")
            ring = Ring(channels, max(round(RING_SECONDS * rate), 4 * client.period))
            super().__init__(Signal(sample_rate=rate, channels=channels), ring)
            self._inputs = self._enter(client)
            self._connect(client)
        except BaseException:
            client.close()
            raise
        self._client = client

    @property
    def health(self) -> StreamHealth:
        """Counters so far, and the offsets of the machine's and JACK's clocks from the monotonic clock."""
        return self._timeline.health(
            xruns=self._ring.arena.count(at.XRUNS),
            reconnects=self._reconnects,
            clock_offsets={**clock_offsets(), "jack": self._clock_offset},
            away=self._away(),
        )

    def _idle(self) -> None:
        if self._client is None:
            if not self._reconnect:
                raise DeviceError("the JACK server went away, and reconnect=false does not wait for it")
            self._return()
        elif self._ring.arena.count(at.GONE):
            self._disconnect()  # what it published last is taken on the next turn
        else:
            self._tend_ports(self._client)
            self._unplugged = self._not_connected(self._client)
            self._ring.arena.wait(RETRY if self._waiting else IDLE)

    def _away(self) -> str:
        """Return why no sound arrives; empty while it does."""
        if self._client is None:
            return "the JACK server is not running"
        if self._waiting:
            return f"JACK ports '{libjack.shown(self._port_pattern)}' are not there"
        if self._unplugged:
            return f"{' and '.join(self._unplugged)} not connected in JACK"
        return "the JACK server has stalled"

    def _leave(self) -> None:
        self._disconnect()
        super()._leave()

    def _disconnect(self) -> None:
        if self._client:
            self._client.close()
            self._client = None

    def _enter(self, client: JackClient) -> list[str]:
        """Register the inputs on a server and start capturing; return the inputs' names."""
        from monochord.capture.jack import callbacks  # noqa: PLC0415  (compiled by now)

        self._waiting = False
        inputs = client.start(self._ring.arena, callbacks.capture.address, libjack.IS_INPUT, "in")
        self._ports_seen = self._ring.arena.count(at.PORTS_CHANGED)
        self._measure_clock(client)
        return inputs

    def _connect(self, client: JackClient) -> None:
        """Connect the inputs; raises `DeviceError` where the ports do not exist."""
        self._ports_seen = self._ring.arena.count(at.PORTS_CHANGED)
        if self._port_pattern == "none":
            return
        parts = _parts(self._port_pattern, client.outputs()) if self._parts is None else self._parts
        outputs = _choose_ports(client, parts, self._signal.channels)
        self._parts = parts
        for output, into in zip(outputs, self._inputs, strict=True):
            if not client.connect(output, into):
                port = libjack.shown(output)
                raise DeviceError(f"JACK port {port}: refused the connection; is its client active?")
        self._measure_clock(client)

    def _tend_ports(self, client: JackClient) -> None:
        """Reconnect after ports appeared or disappeared, if this stream uses them."""
        changed = self._ring.arena.count(at.PORTS_CHANGED)
        if self._port_pattern == "none" or not (self._waiting or changed != self._ports_seen):
            return
        self._ports_seen = changed
        if all(client.connected(port) for port in self._ring.arena.ports):
            self._waiting = False
        elif not self._reconnect:
            port = libjack.shown(self._port_pattern)
            raise DeviceError(f"JACK port {port}: it went away, and reconnect=false does not wait for it")
        else:
            self._waiting = not self._reconnected(client)

    def _not_connected(self, client: JackClient) -> list[str]:
        """Return the names of this stream's unconnected inputs.

        A user who disconnects an input in a patch bay does so on purpose: it is reported, not reconnected.
        """
        if self._port_pattern == "none":
            return []
        ports = zip(self._inputs, self._ring.arena.ports, strict=True)
        return [name for name, port in ports if not client.connected(port)]

    def _reconnected(self, client: JackClient) -> bool:
        try:
            self._connect(client)
        except DeviceError:
            return False
        self._reconnects += 1
        return True

    def _return(self) -> None:
        """Try once to reconnect to a server that went away."""
        try:
            client = JackClient(*self._names)
        except DeviceError:
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
        self._waiting = self._port_pattern != "none"
        self._reconnects += not self._waiting  # with ports to connect, it counts when they are

    def _refuse_other_rate(self, rate: int) -> None:
        before = self._signal.sample_rate
        if rate != before:
            line = (
                f"JACK server came back at {rate} Hz: expected {before} Hz as at the start; reopen the source"
            )
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


def _parts(ports: str, names: list[str]) -> list[str]:
    """Return the names and regular expressions in the comma-separated `ports`.

    A full name may contain commas; the longest existing name is used.

    >>> _parts("USB (hw:1,0):out_1, in.*", ["USB (hw:1,0):out_1", "USB (hw:1,0):out_10"])
    ['USB (hw:1,0):out_1', 'in.*']
    """
    spellings = {spelling for name in names for spelling in (name, libjack.shown(name))}
    parts: list[str] = []
    rest = ports.strip()
    while rest:
        whole = [name for name in spellings if rest.startswith(name)]
        ends = [len(name) for name in whole if rest[len(name) :].lstrip()[:1] in ("", ",")]
        end = max(ends, default=0) or len(rest.partition(",")[0])
        parts.append(rest[:end].strip())
        rest = rest[end:].lstrip().removeprefix(",").lstrip()
    return parts


def _choose_ports(client: JackClient, parts: list[str], channels: int) -> list[str]:
    """Return the full names of the first `channels` output ports that match `parts`.

    A part is a full name, or a regular expression that matches part of one; no parts means the physical
    ports. `DeviceError` says that fewer ports match than there are channels.
    """
    if parts:
        outputs = client.outputs()
        names = [name for part in parts for name in _matching(outputs, part)]
    else:
        names = client.outputs(physical=True)
    chosen = list(dict.fromkeys(names))[:channels]
    if len(chosen) < channels:
        expected = f"ports '{libjack.shown(','.join(parts))}'" if parts else "physical capture ports"
        there = ", ".join(map(libjack.shown, client.outputs())) or "none"
        remedy = _port_remedy(client, chosen, channels, named=bool(parts))
        raise DeviceError(f"JACK {expected}: {len(chosen)} of {channels} found; there are {there}; {remedy}")
    return chosen


def _port_remedy(client: JackClient, chosen: list[str], channels: int, *, named: bool) -> str:
    """Return what to do where too few ports were found: under PipeWire a device's ports have other names."""
    devices = client.outputs(physical=True)[:channels]
    if named and libjack.pipewire() and len(devices) == channels and not {*chosen} & {*devices}:
        return f"PipeWire names ports after their device: {','.join(map(libjack.shown, devices))}"
    if chosen:
        return f"set channels={len(chosen)}"
    return "start what plays, or set ports=none"


def _matching(names: list[str], part: str) -> list[str]:
    """Return the names that a part matches; a full name, which may contain brackets, is not an expression."""
    same = [name for name in names if part in (name, libjack.shown(name))]
    if same:
        return same
    try:
        pattern = re.compile(part)
    except re.error as error:
        given = f"ports '{libjack.shown(part)}' ({error})"
        allowed = "full names, or regular expressions, separated by commas"
        raise InputError(given, allowed, "monochord list devices shows the names") from error
    return [name for name in names if pattern.search(name)]
