"""Reads a large JSON object with the entries of its largest members one at a time."""

import errno
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from monochord.core.config import flat_enough, json_named
from monochord.core.files import refuse_endless

MAX_BYTES = 1 << 30
"""Size of the largest file that is read, in bytes."""
CHUNK = 1 << 16
"""Smallest number of characters read at once."""
SPACE = " \t\n\r"


def json_members(path: Path, large: tuple[str, ...], remedy: str = "") -> Iterator[tuple[str, Any]]:
    r"""Yield the members of a JSON object by name; of those in `large`, an iterator over the entries.

    An entry is a value of a list, or a pair of name and value of an object. All entries must be read before
    the next member. A file that holds something else than an object yields it with an empty name.

    `InputError` refuses a file that is missing, too large or not JSON, and ends with `remedy`.

    >>> from tempfile import mkdtemp
    >>> file = Path(mkdtemp()) / "a.json"
    >>> _ = file.write_text('{"size": 2, "parts": [{"at": 1}, 5]}')
    >>> [(name, list(each) if name == "parts" else each) for name, each in json_members(file, ("parts",))]
    [('size', 2), ('parts', [{'at': 1}, 5])]
    """
    refuse_endless(path)
    with json_named(path, remedy):
        if path.stat().st_size > MAX_BYTES:
            raise OSError(errno.EFBIG, f"more than {MAX_BYTES} bytes", str(path))
        with path.open(encoding="utf-8-sig") as stream:
            yield from _Reader(path, stream, remedy).members(large)


class _Reader:
    """JSON text, of which what has been read is forgotten."""

    def __init__(self, path: Path, stream: TextIO, remedy: str) -> None:
        self._path, self._stream, self._remedy = path, stream, remedy
        self._text, self._at, self._decoder = "", 0, json.JSONDecoder()

    def members(self, large: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
        if self._next() != "{":
            yield "", self._value()
        else:
            for _ in self._entries("{"):
                name, opening = self._name(), self._next()
                is_large = name in large and opening in ("{", "[")
                yield name, self._large(opening) if is_large else self._value()
        if self._next():
            raise ValueError(f"more text after the end: {self._next()!r}")

    def _large(self, opening: str) -> Iterator[Any]:
        with json_named(self._path, self._remedy):
            for _ in self._entries(opening):
                yield self._value() if opening == "[" else (self._name(), self._value())

    def _entries(self, opening: str) -> Iterator[None]:
        """Yield once before each entry of a list or an object."""
        closing = "]" if opening == "[" else "}"
        self._take(opening)
        if self._next() != closing:
            yield
            while self._next() == ",":
                self._take(",")
                yield
        self._take(closing)

    def _name(self) -> str:
        name = self._value()
        if not isinstance(name, str):
            raise ValueError(f"{name!r} for a name")  # noqa: TRY004  (as of any other text that is no JSON)
        self._take(":")
        return name

    def _value(self) -> Any:
        """Return the next value; text that ends within it is continued, each time by as much again."""
        self._next()
        while True:
            try:
                value, end = self._decoder.raw_decode(self._text, self._at)
            except json.JSONDecodeError:
                if not self._more():
                    raise
                continue
            if end == len(self._text) and self._more():  # a number may go on
                continue
            self._at = end
            return flat_enough(value)

    def _take(self, character: str) -> None:
        if self._next() != character:
            raise ValueError(f"{self._next()!r} where {character!r} is expected")
        self._at += 1

    def _next(self) -> str:
        """Return the next character that is no space; empty at the end."""
        while True:
            while self._at < len(self._text) and self._text[self._at] in SPACE:
                self._at += 1
            if self._at < len(self._text):
                return self._text[self._at]
            if not self._more():
                return ""

    def _more(self) -> bool:
        left = self._text[self._at :]
        text = self._stream.read(max(CHUNK, len(left)))
        self._text, self._at = left + text, 0
        return bool(text)
