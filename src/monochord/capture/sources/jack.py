"""Capture from a JACK (or PipeWire) server: every frame accounted for, whatever Python is doing."""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta

from monochord.capture.sources.base import Source, refuse_other_channels
from monochord.core.errors import InputError
from monochord.core.units import Seconds

if TYPE_CHECKING:
    from monochord.capture.sources._jack_stream import JackStream


@dataclass(frozen=True, slots=True, kw_only=True)
class Jack(Source):
    """Ports of a running JACK server, captured by a compiled callback into a ring.

    A period (the server's unit, one block here) is captured when all `channels` inputs are connected. Frames
    that were lost, or passed while a port or the server was away, are measured by JACK's clocks and reported
    as the next block's `dropped`. No server is ever started.

    Parameters
    ----------
    ports
        Ports to capture: full names of output ports, as ``monochord list devices`` shows them, or regular
        expressions for them, as in ``player:.*`` (as many as there are channels, in the order found),
        separated by commas; empty for the physical capture ports; ``none`` to wait until something else
        connects this client's inputs.
    client_name
        This client's name on the server.
    server
        Name of the server; empty for ``$JACK_DEFAULT_SERVER`` or else ``default``.
    channels
        Inputs to capture: 1 or 2, or up to 64 of several strings.
    ring_seconds
        How long the reader may be busy before frames are lost, in seconds.
    reconnect
        Whether to wait for a server or port that went away; otherwise the stream ends there.
    patience_seconds
        How long to wait for the server to come back, in seconds.
    """

    ports: str = ""
    client_name: str = "monochord"
    server: str = ""
    channels: int = 2
    ring_seconds: Annotated[Seconds, Meta(ge=0.01, le=60.0)] = 2.0
    reconnect: bool = True
    patience_seconds: Seconds = float("inf")

    @contextmanager
    def open(self) -> Generator["JackStream"]:
        """Connect to the server; raises `DeviceError` if there is none, or not such ports."""
        refuse_other_channels(self.channels)
        if not self.client_name:
            raise InputError("client_name ''", "a name")
        # Imported here, because this loads numba and compiles the callbacks.
        from monochord.capture.sources._jack_stream import JackStream  # noqa: PLC0415

        stream = JackStream(**asdict(self))
        try:
            yield stream
        finally:
            stream.release()
