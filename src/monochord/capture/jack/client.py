"""A JACK client: open, set compiled callbacks, register ports, activate, close."""

import os
import threading
import time
from ctypes import byref, c_uint32

from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.arena import Arena
from monochord.core.errors import DeviceError
from monochord.core.units import Samples, Seconds

ALREADY_CONNECTED = 17  # EEXIST
# libjack shares memory between the clients of a process, and crashes if one is opened, even in vain, before
# all those of a dead server are closed. So when one client finds its server gone, the others are informed,
# and none is opened until they have left.
_opening = threading.Lock()
_clients: set["JackClient"] = set()


class JackClient:
    """An open client of a running JACK server; the server makes its `name` unique if it is taken.

    Without a `server`, it is that of ``$JACK_DEFAULT_SERVER``, or else ``default``. Raises `DeviceError` if
    libjack is not installed or the server is not running: none is started.
    """

    def __init__(self, name: str, server: str = "") -> None:
        self._jack = libjack.library()
        # Imported here, because this compiles against libjack.
        from monochord.capture.jack import callbacks  # noqa: PLC0415

        self._callbacks = callbacks
        self._arena: Arena | None = None
        self._server = server or os.environ.get("JACK_DEFAULT_SERVER", "default")
        with _opening:
            if any(client.gone for client in _clients):
                raise DeviceError(
                    "JACK server: shut down, and this program's other clients have not closed yet"
                )
            self.handle = self._open(name, server)
            if not self.handle:
                raise DeviceError(f"JACK server '{self._server}': not running; {libjack.no_server()}")
            _clients.add(self)

    def _open(self, name: str, server: str) -> int:
        for set_function in (self._jack.jack_set_error_function, self._jack.jack_set_info_function):
            set_function(self._callbacks.silent.address)
        options = libjack.NO_START_SERVER | (libjack.SERVER_NAME if server else 0)
        more = (libjack.encoded(server),) if server else ()
        return self._jack.jack_client_open(libjack.encoded(name), options, byref(c_uint32()), *more) or 0

    @property
    def gone(self) -> bool:
        """Whether the server has gone away since the client started."""
        return self._arena is not None and bool(self._arena.count(at.GONE))

    @property
    def name(self) -> str:
        """The client's name, as assigned by the server."""
        return libjack.decoded(self._jack.jack_get_client_name(self.handle))

    @property
    def sample_rate(self) -> int:
        """The server's sample rate in Hz."""
        return int(self._jack.jack_get_sample_rate(self.handle))

    @property
    def period(self) -> Samples:
        """The server's period in frames."""
        return int(self._jack.jack_get_buffer_size(self.handle))

    @property
    def realtime(self) -> bool:
        """Whether the server runs with real-time priority."""
        return bool(self._jack.jack_is_realtime(self.handle))

    def start(self, arena: Arena, process: int, direction: int, prefix: str) -> list[str]:
        """Register a port for each channel, set the compiled callbacks and activate; return the port names.

        `process` is the address of the process callback and `direction` is JACK's flag for the ports. The
        arena must outlive the client.
        """
        jack, calls, address = self._jack, self._callbacks, arena.address
        ports = [
            jack.jack_port_register(self.handle, f"{prefix}_{k + 1}".encode(), libjack.AUDIO, direction, 0)
            for k in range(arena.samples.shape[0])
        ]
        if not all(ports):
            raise DeviceError(f"JACK refused {len(ports)} more ports; raise its limit (jackd -p)")
        arena.words[at.CLIENT] = self.handle
        arena.words[at.PORTS : at.PORTS + len(ports)] = ports
        arena.words[at.GONE] = 0
        self._arena = arena
        jack.jack_set_process_callback(self.handle, process, address)
        jack.jack_set_xrun_callback(self.handle, calls.xrun.address, address)
        jack.jack_set_port_registration_callback(self.handle, calls.port_registration.address, address)
        jack.jack_on_shutdown(self.handle, calls.shutdown.address, address)
        if jack.jack_activate(self.handle):
            raise DeviceError("JACK server: refused to activate the client; it may be shutting down")
        return [libjack.decoded(jack.jack_port_name(port)) for port in ports]

    def outputs(self, pattern: str = "", *, physical: bool = False) -> list[str]:
        """Return the full names of audio output ports that match a regular expression, in order."""
        flags = libjack.IS_OUTPUT | (libjack.IS_PHYSICAL if physical else 0)
        ports = self._jack.jack_get_ports(self.handle, libjack.encoded(pattern) or None, libjack.AUDIO, flags)
        names: list[str] = []
        while ports and ports[len(names)]:
            names.append(libjack.decoded(ports[len(names)]))
        self._jack.jack_free(ports)
        return names

    def connect(self, output: str, into: str) -> bool:
        """Connect two ports by name; return whether they are connected now."""
        names = libjack.encoded(output), libjack.encoded(into)
        status = self._jack.jack_connect(self.handle, *names)
        return status in (0, ALREADY_CONNECTED)

    def connected(self, port: int) -> bool:
        """Return whether anything is connected to a port of this client."""
        return bool(self._jack.jack_port_connected(port))

    def capture_latency(self, port: int) -> Samples:
        """Return the age in frames of a sample that arrives at an input port now."""
        latency = libjack.LatencyRange()
        self._jack.jack_port_get_latency_range(port, libjack.CAPTURE_LATENCY, byref(latency))
        return int(latency.max)

    def clock_offset(self) -> Seconds:
        """Return JACK's clock minus the monotonic clock."""
        readings: list[tuple[int, Seconds]] = []
        for _ in range(3):  # the quickest reading is the one that nothing interrupted
            before = time.monotonic_ns()
            there = int(self._jack.jack_get_time())
            after = time.monotonic_ns()
            readings.append((after - before, there * 1e-6 - (before + after) * 0.5e-9))
        return min(readings)[1]

    def frame_at(self, monotonic: Seconds) -> Samples:
        """Return JACK's frame count, modulo 2^32, at a time near now of the monotonic clock."""
        microseconds = round((monotonic + self.clock_offset()) * 1e6)
        return int(self._jack.jack_time_to_frames(self.handle, microseconds))

    def close(self) -> None:
        """Close the client; no callback runs after this. Safe after the server has gone away."""
        with _opening:
            if self.gone:
                for client in _clients:
                    client.doom(self._server)
            if self.handle:
                self._jack.jack_client_close(self.handle)
                self.handle = 0
            _clients.discard(self)

    def doom(self, server: str) -> None:
        """Record that another client found the server gone, whether or not libjack has reported it."""
        if self._arena and self._server == server:
            self._arena.words[at.GONE] = 1
            self._arena.wake()
