"""Download of published weights on request; a downloaded file is complete and checked."""

import http.client
import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from importlib import import_module
from pathlib import Path
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
from monochord.perception.encoders.weights import CHECKSUM_SUFFIX, KnownWeights, checked_sum

_LOG = logging.getLogger(__name__)
TIMEOUT: Seconds = 30.0
"""Longest wait for a server's answer."""
CHUNK_BYTES = 1 << 20
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
        If the server does not answer, returns an error, or breaks off.
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
    opener = OpenerDirector()  # without a handler of http, so that no redirection can lead there
    for handler in HANDLERS:
        opener.add_handler(handler())
    try:
        with opener.open(known.url, timeout=TIMEOUT) as answer:
            total = int(answer.headers.get("Content-Length") or 0)
            left = total
            while chunk := answer.read(CHUNK_BYTES):
                left -= len(chunk)
                yield chunk, total
    except HTTPError as error:
        with error:
            raise _unavailable(known, f"answers {error.code} {error.reason}") from error
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise _unavailable(known, f"no answer ({getattr(error, 'reason', None) or error})") from error
    if total and left:
        raise _unavailable(known, f"broke off {left} bytes before its end")


def _unavailable(known: KnownWeights, why: str) -> DeviceError:
    remedy = f"fetch {known.file} elsewhere and name it in {known.variable}"
    return DeviceError(f"{known.url}: {why}; {remedy}")
