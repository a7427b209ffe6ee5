"""The open browsers of a page: one loop over their sockets, whatever the page shows.

At a steady pace what is new is encoded once for all browsers; each gets the newest as soon as it has
received the message before, so that a slow one gets fewer, and one that never reads is closed. Nothing is
queued except in the system's buffers.
"""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import suppress

from starlette.websockets import WebSocket, WebSocketDisconnect

from monochord.core.units import Seconds
from monochord.page.commands import RefusedError
from monochord.page.connections import share_of_descriptors
from monochord.page.messages import packed

RATE = 30.0
"""Most messages per second to a client."""
TOTAL_RATE = 1500.0
"""Most messages per second to all clients together: with more than 50 clients, each gets fewer."""
MAX_CLIENTS = 256
"""Most open pages; fewer where this process may open fewer than four files for each."""
MIN_PAUSE: Seconds = 0.004
"""Shortest time between a client's messages, in s: a flood waits in that client's connection."""
PATIENCE: Seconds = 10.0
"""Time for a client to receive one message before it is closed, in s."""
LONGEST_PAUSE: Seconds = 0.5
"""Longest time until a client is looked at again, in s."""


class Viewer(ABC):
    """One open page as its feed sees it; called in the server's thread."""

    @abstractmethod
    def news(self) -> Iterator[str | bytes]:
        """Yield what is new to this page; the next message is asked for once the one before is sent."""

    @abstractmethod
    def ask(self, content: str | bytes) -> None:
        """Carry out a request of the page; raises `RefusedError` where it is not carried out."""

    @abstractmethod
    def leave(self) -> None:
        """Take note that the page is closed."""


class Feed(ABC):
    """What the open browsers of a page show, and what they may ask; called in the server's thread."""

    @abstractmethod
    def refresh(self, clients: "Clients") -> bool:
        """Encode what is new, once for all `clients`; return whether there is anything."""

    @abstractmethod
    def enter(self) -> Viewer:
        """Return a page that was opened now."""


class Clients:
    """The open browsers of a page, with the numbers of those served, of messages sent, and of those ignored.

    A message of a client is ignored where its request is not carried out.
    """

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._wakes: dict[Viewer, asyncio.Event] = {}
        self._max_clients = share_of_descriptors(4, MAX_CLIENTS)
        self.served = self.sent = self.ignored = 0

    def __len__(self) -> int:
        return len(self._wakes)

    async def keep_pace(self) -> None:
        """Encode what is new and wake the clients, at the permitted rate, until cancelled."""
        while True:
            await asyncio.sleep(max(1.0 / RATE, len(self) / TOTAL_RATE))
            if self._feed.refresh(self):
                for wake in self._wakes.values():
                    wake.set()

    async def serve(self, socket: WebSocket) -> None:
        """Serve one client until it leaves."""
        if len(self) >= self._max_clients:
            await socket.close(1013, "too many pages are open")
            return
        await socket.accept()
        viewer, wake = self._feed.enter(), asyncio.Event()
        self._wakes[viewer] = wake
        self.served += 1
        sending = asyncio.create_task(self._send(socket, viewer, wake))
        try:
            await self._receive(socket, viewer, wake)
        except TimeoutError:
            await _close(socket)
        except (WebSocketDisconnect, RuntimeError):
            pass  # it went away
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError):
                await sending
            del self._wakes[viewer]
            viewer.leave()

    async def _send(self, socket: WebSocket, viewer: Viewer, wake: asyncio.Event) -> None:
        """Send what is new, until the client reads nothing for too long."""
        try:
            while True:
                for message in viewer.news():
                    await _sent(socket, message)
                    self.sent += 1
                with suppress(TimeoutError):
                    await asyncio.wait_for(wake.wait(), LONGEST_PAUSE)
                wake.clear()
        except TimeoutError:
            await _close(socket)
        except (WebSocketDisconnect, RuntimeError, OSError):
            pass  # it went away

    async def _receive(self, socket: WebSocket, viewer: Viewer, wake: asyncio.Event) -> None:
        """Carry out the client's requests until it leaves; those that are refused are counted."""
        while (message := await socket.receive())["type"] != "websocket.disconnect":
            try:
                viewer.ask(message.get("text") or message.get("bytes") or b"")
            except RefusedError as refusal:
                self.ignored += 1
                if line := str(refusal):
                    await _sent(socket, packed({"type": "refused", "line": line}))
            else:
                wake.set()
            await asyncio.sleep(MIN_PAUSE)


async def _sent(socket: WebSocket, message: str | bytes) -> None:
    """Send a message; raises `TimeoutError` where the client does not take it."""
    async with asyncio.timeout(PATIENCE):
        if isinstance(message, str):
            await socket.send_text(message)
        else:
            await socket.send_bytes(message)


async def _close(socket: WebSocket) -> None:
    """Close the socket of a client that reads nothing."""
    with suppress(RuntimeError, TimeoutError):
        async with asyncio.timeout(1.0):
            await socket.close(1008, "nothing was read for too long")
