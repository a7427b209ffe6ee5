"""Capture from a JACK (or PipeWire) server: every frame is accounted for, however busy Python is."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from monochord.capture.sources.base import Source, refuse_other_channels
from monochord.core.errors import InputError

if TYPE_CHECKING:
    from monochord.capture.sources._jack_stream import JackStream


@dataclass(frozen=True, slots=True, kw_only=True)
class Jack(Source):
    """Ports of a running JACK server, captured by a compiled callback into a ring.

    A period (the server's unit, one block here) is captured when all `channels` inputs are connected. Frames
    that are lost, or pass while a port or the server is absent, are measured by JACK's clocks and reported as
    the next block's `dropped`. This source never starts a server.

    Parameters
    ----------
    ports
        Ports to capture, separated by commas: full names of output ports, as shown by ``monochord list
        devices``, or regular expressions such as ``player:.*`` (the first matches, one per channel). Empty
        selects the physical capture ports; ``none`` waits until another program connects the inputs.
    client_name
        This client's name on the server.
    server
        Name of the server; empty for ``$JACK_DEFAULT_SERVER`` or else ``default``.
    channels
        Inputs to capture: 1 or 2, or up to 64 for several strings.
    reconnect
        Whether to wait for a lost server or port; otherwise the stream ends.
    """

    ports: str = ""
    client_name: str = "monochord"
    server: str = ""
    channels: int = 2
    reconnect: bool = True

    def open(self) -> "JackStream":
        """Connect to the server; raises `DeviceError` if the server or a port is missing."""
        refuse_other_channels(self.channels)
        if not self.client_name:
            raise InputError("client_name ''", "a name")
        # Imported here, because this loads numba and compiles the callbacks.
        from monochord.capture.sources._jack_stream import JackStream  # noqa: PLC0415

        return JackStream(**asdict(self))
