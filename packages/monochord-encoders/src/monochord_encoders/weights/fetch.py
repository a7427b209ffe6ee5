"""Download of published weights on request; a downloaded file is complete and checked."""

import http.client
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from queue import Empty, Full, Queue
from threading import Event, Thread
from typing import TypeAlias
from urllib.error import HTTPError
from urllib.request import (
    FileHandler,
    HTTPDefaultErrorHandler,
    HTTPErrorProcessor,
    HTTPRedirectHandler,
    HTTPSHandler,
    OpenerDirector,
    ProxyHandler,
    UnknownHandler,
)

from monochord.core.errors import DeviceError, InputError
from monochord.core.units import Seconds
from monochord_encoders.weights import CHECKSUM_SUFFIX, KnownWeights, checked_sum

_LOG = logging.getLogger(__name__)
TIMEOUT: Seconds = 30.0
"""Longest time in which a server must bring `MIN_BYTES`, its answer's beginning included."""
MIN_BYTES = 1 << 15
CHUNK_BYTES = 1 << 20
CHUNKS_AHEAD = 4
HANDLERS = (
    ProxyHandler,
    HTTPSHandler,
    FileHandler,
    UnknownHandler,
    HTTPRedirectHandler,
    HTTPDefaultErrorHandler,
    HTTPErrorProcessor,
)
Progress = Callable[[int, int], None]
"""Called with the bytes so far and the total; the total is 0 if the server does not state it."""
_Item: TypeAlias = tuple[bytes, int] | BaseException


def describe(known: KnownWeights, path: Path) -> str:
    """Return a short description of a weights file; raises `InputError` for another kind of file."""
    if not known.reader:
        return known.title
    return str(import_module(known.reader).describe(path))


def fetch(known: KnownWeights, path: Path, progress: Progress) -> str:
    """Download weights to `path`, check them, store their SHA-256 next to them, and return it.

    If no checksum is known in advance, a warning on stderr says so. Only https addresses and local files are
    read, also after a redirection, and at most `max_bytes` bytes. The file gets its final name once it is
    complete and checked.

    Raises
    ------
    DeviceError
        If the server does not answer, returns an error, breaks off, or brings fewer than `MIN_BYTES` within
        `TIMEOUT` s.
    InputError
        If the file has another checksum or content, or cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        actual = _download(known, part, progress)
        if known.sha256 and actual != known.sha256:
            raise InputError(f"{known.url} with SHA-256 {actual[:12]}...", f"{known.sha256[:12]}...")
        describe(known, part)
        if not known.sha256:
            line = f"weights {known.name} are not pinned: this file has {actual}"
            pin = f"monochord weights get {known.name} --sha256 {actual}"
            _LOG.warning(
                "monochord: %s; %s must match it from now on; pin it elsewhere with: %s", line, path, pin
            )
        path.with_name(path.name + CHECKSUM_SUFFIX).write_text(f"{actual}\n", encoding="ascii")
        part.replace(path)
    except OSError as error:
        given = f"{error.filename or path} ({error.strerror})"
        raise InputError(given, "a writable folder", "name another folder with --folder") from error
    finally:
        with suppress(OSError):
            part.unlink()
    return checked_sum(known, path)


def _download(known: KnownWeights, part: Path, progress: Progress) -> str:
    """Download into a file and return its SHA-256."""
    digest, done = sha256(), 0
    with part.open("wb") as file:
        for chunk, total in _chunks(known):
            done += len(chunk)
            if max(done, total) > known.max_bytes:
                given = f"{known.url} with {max(done, total)} bytes or more"
                raise InputError(given, f"{known.max_bytes} bytes for the weights {known.name}")
            digest.update(chunk)
            file.write(chunk)
            progress(done, total)
    return digest.hexdigest()


def _chunks(known: KnownWeights) -> Iterator[tuple[bytes, int]]:
    """Yield the chunks of the download, with the bytes in all."""
    if not known.url.startswith(("https://", "file:///")):
        raise InputError(f"address {known.url}", "an https address, or a local file (file:///)")
    ahead: Queue[_Item] = Queue(CHUNKS_AHEAD)
    stopped = Event()
    Thread(target=_read_ahead, args=(known, ahead, stopped), name="weights", daemon=True).start()
    brought, deadline, left = 0, time.monotonic() + TIMEOUT, 0
    try:
        while True:
            try:
                chunk, total = _taken(ahead.get(timeout=max(0.0, deadline - time.monotonic())))
            except Empty:
                stalled = f"brought {brought} bytes in {TIMEOUT:g} s, and nothing more"
                raise _unavailable(known, stalled if brought else f"no answer in {TIMEOUT:g} s") from None
            if not chunk:
                break
            left = (left or total) - len(chunk)
            brought += len(chunk)
            if brought >= MIN_BYTES:
                brought, deadline = 0, time.monotonic() + TIMEOUT
            yield chunk, total
    except HTTPError as error:
        with error:
            raise _unavailable(known, f"answers {error.code} {error.reason}") from error
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise _unavailable(known, f"no answer ({getattr(error, 'reason', None) or error})") from error
    finally:
        stopped.set()
    if total and left:
        raise _unavailable(known, f"broke off {left} bytes before its end")


def _taken(item: _Item) -> tuple[bytes, int]:
    if isinstance(item, BaseException):
        raise item
    return item


def _read_ahead(known: KnownWeights, ahead: "Queue[_Item]", stopped: Event) -> None:
    """Put the chunks of the download, with the bytes in all, into a queue; an empty one or an error is last.

    A separate thread does so, because a server that sends a byte now and then ends no wait of a socket.
    """
    opener = OpenerDirector()  # without a handler of http, so that no redirection can lead there
    for handler in HANDLERS:
        opener.add_handler(handler())
    item: _Item
    try:
        with opener.open(known.url, timeout=TIMEOUT) as answer:
            total = int(answer.headers.get("Content-Length") or 0)
            read = getattr(answer, "read1", answer.read)  # of a local file, which does not trickle
            item = b"", total
            while (chunk := read(CHUNK_BYTES)) and _put(ahead, (chunk, total), stopped):
                pass
    except Exception as error:  # noqa: BLE001  (raised again where the chunks are taken)
        item = error
    _put(ahead, item, stopped)


def _put(ahead: "Queue[_Item]", item: "_Item", stopped: Event) -> bool:
    """Put an item into the queue as soon as there is room; return false where nobody takes it any more."""
    while not stopped.is_set():
        with suppress(Full):
            ahead.put(item, timeout=0.1)
            return True
    return False


def _unavailable(known: KnownWeights, why: str) -> DeviceError:
    remedy = f"fetch {known.file} elsewhere and name it in {known.variable}"
    return DeviceError(f"{known.url}: {why}; {remedy}")
