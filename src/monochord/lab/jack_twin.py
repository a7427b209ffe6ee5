"""Plays the twin into a JACK server from a separate process, and captures it there as a live source."""

import multiprocessing
import re
import signal
import threading
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from monochord.capture.jack import arena as at
from monochord.capture.jack import libjack
from monochord.capture.jack.arena import Arena
from monochord.capture.jack.atomics import store
from monochord.capture.jack.client import JackClient
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Controls, ControlSetting, Source, Stream
from monochord.core.closing import Closing
from monochord.core.errors import DeviceError, MonochordError
from monochord.core.types import Audio, Block, Contact, Signal, StreamHealth, Truth
from monochord.core.units import Metres, Newtons, Samples, Seconds

AHEAD: Samples = 2048
"""How far ahead frames are simulated, in s: touches by hand are delayed by it."""
RING: Samples = 8192
WINDOW: Seconds = 0.1
HOP: Seconds = 0.01
"""Length and distance of the windows whose truth is sent, in s; each ends with a block."""
MICROPHONES = 1, 2
REMEMBERED = 1024
"""Number of windows whose truth is kept until it is read."""
PATIENCE: Seconds = 60.0
ENDING: Seconds = 10.0


class Relay(Closing):
    """A JACK client with `channels` outputs that plays frames on the server's clock.

    Frame 0 plays once all ports are connected. A frame that is written too late becomes silence, and the
    following frames keep their times, as on a converter.
    """

    def __init__(self, channels: int, client_name: str, server: str) -> None:
        self._ring = Arena(channels, RING, periods=0)
        self._client = JackClient(client_name, server)
        from monochord.capture.jack import callbacks  # noqa: PLC0415  (compiled by now)

        try:
            address = callbacks.relay.address
            self.ports = self._client.start(self._ring, address, libjack.IS_OUTPUT, "out")
        except BaseException:
            self.close()
            raise
        self._written: Samples = 0

    @property
    def sample_rate(self) -> int:
        """The server's sample rate in Hz."""
        return self._client.sample_rate

    def write(self, samples: Audio) -> bool:
        """Write frames (channels, n) once they are due soon; return False where the server has gone away."""
        end = self._written + samples.shape[1]
        while self._ring.count(at.READ) + AHEAD < end:
            if self._client.gone:
                return False
            self._ring.wait(0.1)
        self._ring.samples[:, np.arange(self._written, end) % RING] = samples
        self._written = end
        store(self._ring.words, at.WRITTEN, end)
        return True

    def close(self) -> None:
        """Leave the server."""
        self._client.close()
        self._ring.close()


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinReady:
    """The player's message once its ports exist."""

    ports: tuple[str, ...]
    positions: tuple[Metres, Metres]
    forces: tuple[Newtons, Newtons]
    settings: tuple[ControlSetting, ...]


def play(options: dict[str, Any], server: str, pipe: Connection) -> None:
    """Play the twin with these options, until the other end closes the pipe or the server goes away.

    The twin is sampled at the server's rate, in blocks of a usual hop. After a `TwinReady`, it sends for each
    block the start of the window that ends there, its truth, and the settings; it receives commands of a
    hand, as the name of a `Controls` method and its arguments.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal; whoever started this ends it
    try:
        with Relay(len(MICROPHONES), "monochord-twin", server) as relay:
            rate = relay.sample_rate
            paced = {
                "sample_rate": rate,
                "block": round(HOP * rate),
                "speed": 1e6,
            }  # the server sets the pace
            with SOURCES.build("twin", {**options, **paced}).open() as stream:
                _play(stream, relay, pipe)
    except MonochordError as error:
        with suppress(OSError):
            pipe.send(error)
    except (EOFError, OSError):
        pass  # nobody listens any more


def _play(stream: Stream, relay: Relay, pipe: Connection) -> None:
    rate, controls = stream.signal.sample_rate, stream.controls
    assert controls is not None
    blocks, size = iter(stream), round(WINDOW * rate)
    next(blocks)  # what loads at first use does so before anything is connected
    ready = TwinReady(
        ports=tuple(relay.ports),
        positions=controls.positions,
        forces=controls.forces,
        settings=controls.settings,
    )
    pipe.send(ready)
    first = None
    for block in blocks:
        first = block.start if first is None else first
        if not relay.write(block.samples):
            return
        while pipe.poll():
            request = pipe.recv()
            if request is None:
                return
            name, arguments = request
            getattr(controls, name)(*arguments)
        end = block.start + block.samples.shape[1]
        if end - size >= first:
            pipe.send((end - size - first, dict(stream.truth(end - size, end)), controls.settings))


class _RemoteControls(Controls):
    """The controls of a twin in another process."""

    def __init__(self, ready: TwinReady, pipe: Connection) -> None:
        self._ready, self._pipe, self._lock = ready, pipe, threading.Lock()
        self.newest = ready.settings

    @property
    def positions(self) -> tuple[Metres, Metres]:
        return self._ready.positions

    @property
    def forces(self) -> tuple[Newtons, Newtons]:
        return self._ready.forces

    @property
    def settings(self) -> tuple[ControlSetting, ...]:
        return self.newest

    def touch(self, contact: Contact) -> None:
        if not np.isfinite([contact.position, contact.force, contact.slip_velocity]).all():
            return
        self._send("touch", contact)

    def release(self) -> None:
        self._send("release")

    def change(self, name: str, value: str) -> None:
        if value in {setting.name: setting.choices for setting in self.newest}.get(name, ()):
            self._send("change", name, value)

    def end(self) -> None:
        """End the player."""
        with self._lock, suppress(OSError):
            self._pipe.send(None)

    def _send(self, name: str, *arguments: Any) -> None:
        with self._lock, suppress(OSError):  # the player has ended, and so will the stream
            self._pipe.send((name, arguments))


class _TwinCapture(Stream):
    """The stream of a JACK source, with the truth and the controls of the twin playing there."""

    def __init__(self, capture: Stream, ready: TwinReady, pipe: Connection) -> None:
        self._capture, self._pipe = capture, pipe
        self._controls = _RemoteControls(ready, pipe)
        self._truth: dict[Samples, Truth] = {}
        self._following = threading.Thread(target=self._follow, name="twin-truth", daemon=True)
        self._following.start()

    def end(self) -> None:
        """End the player, and wait for its last message."""
        self._controls.end()
        self._following.join(ENDING)

    def _follow(self) -> None:
        with suppress(EOFError, OSError):
            while True:
                start, truth, self._controls.newest = self._pipe.recv()
                self._truth[start] = truth
                self._truth.pop(next(iter(self._truth)) if len(self._truth) > REMEMBERED else -1, None)

    @property
    def signal(self) -> Signal:
        return self._capture.signal

    def __iter__(self) -> Iterator[Block]:
        return iter(self._capture)

    def close(self) -> None:
        self._capture.close()

    @property
    def pending(self) -> Samples:
        return self._capture.pending

    @property
    def paced(self) -> bool:
        return True

    @property
    def health(self) -> StreamHealth:
        return self._capture.health

    @property
    def controls(self) -> Controls:
        return self._controls

    def truth(self, start: Samples, stop: Samples) -> Truth:  # noqa: ARG002  (all windows are of one length)
        return self._truth.get(start, {})


@dataclass(frozen=True, slots=True, kw_only=True)
class JackTwin(Source):
    """The twin as a JACK client in a separate process, captured like a sensor's microphones.

    `server` is a running server's name, empty for the default one; `twin` holds options of the source
    ``twin``.
    """

    server: str = ""
    twin: Mapping[str, Any] = field(default_factory=dict[str, Any])

    @contextmanager
    def open(self) -> Generator[Stream]:
        """Start the player and connect to it; raises `DeviceError` where no server runs."""
        context = multiprocessing.get_context("spawn")
        pipe, theirs = context.Pipe()
        player = context.Process(target=play, args=(dict(self.twin), self.server, theirs), daemon=True)
        player.start()
        theirs.close()
        try:
            ready = _answer(pipe)
            ports = ",".join(re.escape(port) for port in ready.ports)
            jack = SOURCES.build("jack", {"ports": ports, "server": self.server, "reconnect": False})
            with jack.open() as capture:
                played = _TwinCapture(capture, ready, pipe)
                try:
                    yield played
                finally:
                    played.end()
        finally:
            pipe.close()
            player.join(ENDING)
            if player.is_alive():
                player.kill()
                player.join()


def _answer(pipe: Connection) -> TwinReady:
    """Return the player's first message; raises the error that stopped it from starting."""
    try:
        reply = pipe.recv() if pipe.poll(PATIENCE) else DeviceError("the twin's player did not start")
    except EOFError:
        reply = DeviceError("the twin's player ended at once")
    if isinstance(reply, Exception):
        raise reply
    return reply
