"""The page's server as the targets feed it, and what must hold after each case."""

import http.client
import json
import logging
import socket
import time
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Self

import numpy as np
from h11 import LocalProtocolError
from tests.fuzz.base import REFUSALS
from tests.live.web.run_server import RunServer
from websockets.exceptions import InvalidState
from websockets.sync.client import connect

from monochord.capture.sources import SOURCES
from monochord.core.types import Estimate, Prediction, StreamHealth, Window
from monochord.live.guides.run_tasks import RunTasks
from monochord.live.update import Update

PATIENCE = 10.0
"""Seconds in which the server closes a connection that its client has ended, and answers another one."""
OF_UVICORN: tuple[tuple[type[BaseException], str], ...] = (
    # Text that is not UTF-8: logged with its exception where the connection is closed over it, rightly.
    (UnicodeDecodeError, "'utf-8' codec"),
    # The same text behind a frame that has closed the connection: it is closed again.
    (InvalidState, "connection is clos"),
    # A request whose body is malformed: refused with status 400 while the application still answers.
    (LocalProtocolError, "can't handle event type Response when role=SERVER and state="),
)
"""Exceptions, by type and how they read, that uvicorn logs of connections that it ends rightly."""
SOUND = np.zeros((2, 441), np.float32)


class Page:
    """A server with a simulated string, and another client of it, the witness, to whom updates go on."""

    def __init__(self, token: str = "") -> None:
        self._stack = ExitStack()
        self._errors = self._stack.enter_context(_Errors())
        server = self._stack.enter_context(RunServer(token=token))
        stream = self._stack.enter_context(SOURCES.build("twin").open())
        folder = Path(self._stack.enter_context(TemporaryDirectory()))
        tasks = RunTasks(stream.signal, 0.2, folder, "")
        self._view = self._stack.enter_context(server.show(stream.signal, 0.2, stream.controls, tasks=tasks))
        self._headers, self._count = {"Cookie": f"monochord={token}"}, 0
        self._address = ("127.0.0.1", server.port)
        self._witness = connect(
            f"ws://127.0.0.1:{server.port}/live", additional_headers=self._headers, max_queue=None
        )

    def answer(self, request: bytes, frames: Iterable[bytes] = ()) -> bytes:
        """Return what the server answers, up to the end of the connection, which is ended after what is sent.

        Frames are sent behind the answer to the request: uvicorn drops what comes before.
        """
        answer = b""
        with suppress(OSError), socket.create_connection(self._address, PATIENCE) as sock:
            try:
                sock.sendall(request)
                for frame in frames:
                    while b"\r\n\r\n" not in answer and (part := sock.recv(1 << 16)):
                        answer += part
                    sock.sendall(frame)
                sock.shutdown(socket.SHUT_WR)
                while part := sock.recv(1 << 16):
                    answer += part
            except TimeoutError:
                raise AssertionError("the connection is not closed") from None
        return answer

    def check(self) -> None:
        """Assert that the page is served, that the witness gets a new update, that no error was logged."""
        connection = http.client.HTTPConnection(*self._address, timeout=PATIENCE)
        connection.request("GET", "/", headers=self._headers)
        assert connection.getresponse().status == 200
        connection.close()
        self._count += 1
        self._view.write(_update(self._count))
        end, shown = time.monotonic() + PATIENCE, 0.0
        while shown < self._count:
            text = self._witness.recv(max(0.0, end - time.monotonic()))
            message = json.loads(text) if isinstance(text, str) else {}
            shown = message["time"] if message.get("type") == "moment" else shown
        self._errors.check()


class _Errors(logging.Handler):
    """What any library logs as an error."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self._records: list[logging.LogRecord] = []

    def __enter__(self) -> Self:
        logging.getLogger().addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger().removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        if not any(isinstance(error, kind) and str(error).startswith(text) for kind, text in OF_UVICORN):
            self._records.append(record)

    def check(self) -> None:
        """Raise the first exception that was logged, and forget all."""
        records, self._records = self._records, []
        for record in records:
            error = record.exc_info[1] if record.exc_info else None
            if error is None or isinstance(error, REFUSALS):
                raise AssertionError(f"{record.name} logged: {record.getMessage()}") from error
            raise error


def _update(number: int) -> Update:
    estimates = {"position": Estimate(value=0.1, std=1e-4, unit="m")}
    return Update(
        prediction=Prediction(start=441 * number, time=float(number), estimates=estimates),
        window=Window(samples=SOUND, start=441 * number, sample_rate=44100),
        health=StreamHealth(),
        truth={},
        skipped=0,
    )
