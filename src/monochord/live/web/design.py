"""The page's design of a sensor: it is computed in a process of its own, so that no window of a run waits."""

import asyncio
import sys
from contextlib import suppress

from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response

from monochord.core.units import Seconds
from monochord.live.web.messages import packed

COMMAND = sys.executable, "-m", "monochord.front.design_page"
"""Answers one line with one line; it lies above this package, and starts at the first request."""
MAX_REQUEST = 4096
"""Largest request, in bytes."""
MAX_ANSWER = 1 << 20
MAX_WAITING = 8
"""Most requests that wait for those before; a page has one or two at a time."""
MAX_KEPT = 32
"""Most answers that are kept."""
POLL: Seconds = 10.0
"""Time after which a page is told to ask again, in s: a sweep takes a second, on a busy machine more."""
PATIENCE: Seconds = 120.0
"""Time for an answer, in s."""


class Designer:
    """Passes requests to the process, one at a time, and starts it again if it ended."""

    def __init__(self) -> None:
        self._process: asyncio.subprocess.Process | None = None
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
        line = b" ".join(body.split()) + b"\n"
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
        await self._end()

    async def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            with suppress(ProcessLookupError):
                process.kill()
            await process.wait()

    async def _ask(self, line: bytes) -> bytes:
        """Return the answer to a line."""
        answer = b""
        async with self._turn:
            try:
                async with asyncio.timeout(PATIENCE):
                    answer = await self._answer(line)
            finally:
                if not answer.endswith(b"\n"):  # what it still says would be taken for the next answer
                    await self._end()
        if not answer.endswith(b"\n"):
            raise OSError("the process ended")
        return answer

    async def _answer(self, line: bytes) -> bytes:
        process = self._process
        if process is None or process.returncode is not None:
            pipe, none = asyncio.subprocess.PIPE, asyncio.subprocess.DEVNULL
            # Control-C in the terminal is for this process alone, which then ends the other.
            self._process = process = await asyncio.create_subprocess_exec(
                *COMMAND, stdin=pipe, stdout=pipe, stderr=none, limit=MAX_ANSWER, start_new_session=True
            )
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(line)
        await process.stdin.drain()
        return await process.stdout.readline()


def _refused(status: int, line: str) -> Response:
    return Response(packed({"error": line}), status, media_type="application/json")
