"""The page's design of a sensor: it is computed in a process of its own, so that no window of a run waits."""

import asyncio
from contextlib import suppress

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.routing import Route

from monochord.core.units import Seconds
from monochord.core.workers import Worker
from monochord.page.messages import packed
from monochord.page.server import Page, static

MAX_REQUEST = 4096
"""Largest request, in bytes."""
MAX_WAITING = 8
"""Most requests that wait for those before; a page has one or two at a time."""
MAX_KEPT = 32
"""Most answers that are kept."""
POLL: Seconds = 10.0
"""Time after which a page is told to ask again, in s: a sweep takes a second, on a busy machine more."""
PATIENCE: Seconds = 120.0
"""Time for an answer, in s."""


def design_page(answer: Worker[bytes, bytes]) -> Page:
    """Return the page of a design for a `Server`, from the process that answers its requests."""
    designer = Designer(answer)
    return Page(
        path="design",
        title="Design",
        html=static("monochord.page", "design.html")["design.html"],
        files=static("monochord.page", "design.js"),
        routes=(Route("/design", designer.respond, methods=["POST"]),),
        close=designer.close,
    )


class Designer:
    """Passes requests to the process, one at a time."""

    def __init__(self, answer: Worker[bytes, bytes]) -> None:
        self._worker = answer
        self._turn = asyncio.Lock()
        self._answers: dict[bytes, asyncio.Task[bytes]] = {}  # the oldest first

    async def respond(self, request: Request) -> Response:
        """Answer a request of the page.

        Wishes that are refused are answered by one line, as ``error``; status 202 tells the page to ask for
        the same again.
        """
        body = b""
        with suppress(ClientDisconnect):
            async for chunk in request.stream():
                body += chunk
                if len(body) > MAX_REQUEST:
                    return _refused(
                        413, f"a request above {MAX_REQUEST} bytes: expected the wishes of a design"
                    )
        line = b" ".join(body.split())
        if line not in self._answers:
            if sum(not each.done() for each in self._answers.values()) >= MAX_WAITING:
                return _refused(429, "too many designs are asked for: try again in some seconds")
            for old in [each for each, task in self._answers.items() if task.done()][: 1 - MAX_KEPT]:
                del self._answers[old]
            self._answers[line] = asyncio.create_task(self._ask(line))
        task = self._answers[line]
        if not (await asyncio.wait({task}, timeout=POLL))[0]:
            return Response(packed({"again": True}), 202, media_type="application/json")
        if task.cancelled() or task.exception():
            self._answers.pop(line, None)
            return _refused(503, "no design was computed: try again")
        return Response(task.result(), media_type="application/json")

    async def close(self) -> None:
        """End the process, and what is asked of it."""
        for task in self._answers.values():
            task.cancel()
        await asyncio.gather(*self._answers.values(), return_exceptions=True)
        self._worker.end()

    async def _ask(self, line: bytes) -> bytes:
        """Return the answer to a request; a process that takes too long for it is ended."""
        async with self._turn:
            try:
                async with asyncio.timeout(PATIENCE):
                    return await asyncio.wrap_future(self._worker.submit(line))
            except BaseException:
                self._worker.end()
                raise


def _refused(status: int, line: str) -> Response:
    return Response(packed({"error": line}), status, media_type="application/json")
