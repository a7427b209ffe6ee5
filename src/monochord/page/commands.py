"""What a page may ask: a type for each request, and the function that carries it out."""

from collections.abc import Callable, Mapping
from functools import reduce
from operator import or_
from typing import Any, TypeAlias

import msgspec

from monochord.core.errors import InputError

Request: TypeAlias = msgspec.Struct
"""A request; of several types that one page may send, each has its own tag, by convention in ``do``."""
Handlers: TypeAlias = Mapping[type[Request], Callable[[Any], bool]]
"""What carries out each type of request, and returns whether that had an effect."""


class RefusedError(Exception):
    """A request is not carried out; its text, empty for none, is a line for the page that asked."""


class Commands:
    """The requests that a page may send, by type, each with its handler; other messages are refused.

    A handler returns whether it had an effect, or raises `RefusedError` with a line that says why it had
    none. A refusal says what is `expected`; empty to refuse without a word.

    >>> class Lift(msgspec.Struct, tag_field="do", tag="lift"):
    ...     height: float
    >>> lifted = []
    >>> commands = Commands({Lift: lambda request: not lifted.append(request.height)})
    >>> commands.carry_out(commands.read('{"do": "lift", "height": 0.1}'))
    >>> lifted
    [0.1]
    """

    def __init__(self, handlers: Handlers, expected: str = "") -> None:
        self._handlers, self._expected = handlers, expected
        self._decoder = msgspec.json.Decoder(reduce(or_, handlers))

    def read(self, content: str | bytes) -> Request:
        """Return the request of a message; raises `RefusedError` for any other message."""
        try:
            return self._decoder.decode(content)
        except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
            line = f"request: expected {self._expected} ({error})" if self._expected else ""
            raise RefusedError(line) from error

    def carry_out(self, request: Request) -> None:
        """Carry out a request; raises `RefusedError` where that had no effect, or was no valid input."""
        try:
            done = self._handlers[type(request)](request)
        except (InputError, ValueError) as error:
            raise RefusedError from error
        if not done:
            raise RefusedError
