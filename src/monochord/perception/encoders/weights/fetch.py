"""Weights from where they are published, on request: whole and checked, or not there at all."""

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
from monochord.perception.encoders.weights import SUM_SUFFIX, KnownWeights, checked_sum

_LOG = logging.getLogger(__name__)
PATIENCE: Seconds = 30.0
"""For a server that does not answer."""
PIECE = 1 << 20
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
"""Told the bytes so far and in all; 0 in all where the server does not say."""


def describe(known: KnownWeights, path: Path) -> str:
    """Return what weights hold, in a few words; raises `InputError` for a file that does not hold it."""
    if not known.reader:
        return known.title
    return str(import_module(known.reader).describe(path))


def fetch(known: KnownWeights, path: Path, progress: Progress) -> str:
    """Fetch weights to `path`, check them, keep their sum beside them and return it.

    Where no sum is known in advance, a warning on stderr says so. Only https and local files are read, also
    where a server redirects to, and no more than the weights may have. Nothing stands under the final name
    before all of it is there and checked.

    Raises
    ------
    DeviceError
        If the server does not answer, answers that it has not got them, or breaks off.
    InputError
        If what came is something else, or cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        own = _load(known, part, progress)
        if known.sha256 and own != known.sha256:
            raise InputError(f"{known.url} with SHA-256 {own[:12]}...", f"{known.sha256[:12]}...")
        describe(known, part)
        if not known.sha256:
            line = f"weights {known.name} are not pinned: any file would have been taken; what came has {own}"
            pin = f"monochord weights get {known.name} --sha256 {own}"
            _LOG.warning(
                "monochord: %s; that is required of %s from now on, elsewhere with: %s", line, path, pin
            )
        path.with_name(path.name + SUM_SUFFIX).write_text(f"{own}\n", encoding="ascii")
        part.replace(path)
    except OSError as error:
        given = f"{error.filename or path} ({error.strerror})"
        raise InputError(
            given, "a folder that can be written to", "name another one with --folder"
        ) from error
    finally:
        with suppress(OSError):
            part.unlink()
    return checked_sum(known, path)


def _load(known: KnownWeights, part: Path, progress: Progress) -> str:
    """Copy what the server gives into a file and return its sum."""
    digest, done = sha256(), 0
    with part.open("wb") as file:
        for piece, due in _pieces(known):
            done += len(piece)
            if max(done, due) > known.max_bytes:
                given = f"{known.url} with {max(done, due)} bytes or more"
                raise InputError(given, f"{known.max_bytes} bytes for the weights {known.name}")
            digest.update(piece)
            file.write(piece)
            progress(done, due)
    return digest.hexdigest()


def _pieces(known: KnownWeights) -> Iterator[tuple[bytes, int]]:
    """Yield what the server gives, piece by piece, with the bytes there are in all."""
    if not known.url.startswith(("https://", "file:///")):
        raise InputError(f"address {known.url}", "one of https, or of a local file (file:///)")
    opener = OpenerDirector()  # which knows no http, so that no server can lead there either
    for handler in HANDLERS:
        opener.add_handler(handler())
    try:
        with opener.open(known.url, timeout=PATIENCE) as answer:
            due = int(answer.headers.get("Content-Length") or 0)
            left = due
            while piece := answer.read(PIECE):
                left -= len(piece)
                yield piece, due
    except HTTPError as error:
        with error:
            raise _absent(known, f"answers {error.code} {error.reason}") from error
    except (OSError, ValueError, http.client.HTTPException) as error:
        raise _absent(known, f"no answer ({getattr(error, 'reason', None) or error})") from error
    if due and left:
        raise _absent(known, f"broke off {left} bytes before its end")


def _absent(known: KnownWeights, why: str) -> DeviceError:
    remedy = f"fetch {known.file} elsewhere and name it in {known.variable}"
    return DeviceError(f"{known.url}: {why}; {remedy}")
