"""Limits on the size of a session, checked before memory is allocated, and JSON parsing within them.

A 12 h recording with two microphones at 96 kHz is far within all limits.
"""

import json
import os
from typing import Any

from monochord.core.errors import InputError
from monochord.core.units import Seconds

MAX_DURATION: Seconds = 7 * 24 * 3600.0
"""Largest distance of any time from the session's beginning, either way, audio gaps included, in s."""
MAX_SAMPLE_RATE = 10_000_000
"""Largest audio sample rate, in Hz."""
MAX_STREAMS = 64
"""Largest number of streams of readings in a session."""
MAX_COLUMNS = 256
"""Largest number of columns of a stream or of the labels, and of clocks."""
MAX_TEXT = 1 << 22
"""Largest length of a JSON text, such as the description, in characters."""
MAX_NESTING = 32
"""Deepest nesting of tables and lists in a JSON text."""
MAX_EXPANSION = 100
"""Largest ratio of unpacked to packed size of a compressed file; uncompressed files have no such limit."""
ALWAYS_UNPACKED = 1 << 24
"""Unpacked size allowed however small the file is, in bytes: digital silence compresses well."""


def json_object(text: str) -> dict[str, Any]:
    """Return the object in a JSON text.

    Raises `InputError` for a text that is not a JSON object, too long, nested too deeply, or holds half a
    surrogate pair, which cannot be written to a file.

    >>> json_object('{"n": 1}')
    {'n': 1}
    """
    allowed = f"a JSON object of at most {MAX_TEXT} characters, nested {MAX_NESTING} times at most"
    if len(text) > MAX_TEXT:
        raise InputError(f"text of {len(text)} characters", allowed)
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        nested = isinstance(error, RecursionError)
        raise InputError(
            "text that is nested too deeply" if nested else f"no JSON ({error})", allowed
        ) from None
    if not isinstance(tree, dict):
        raise InputError(f"JSON that is a {type(tree).__name__}", allowed)
    level: list[Any] = [tree]
    for _ in range(MAX_NESTING):
        keys = [key for value in level if isinstance(value, dict) for key in value]
        texts = [*keys, *(value for value in level if isinstance(value, str))]
        if any(not _encodable(each) for each in texts):
            raise InputError("text with half a surrogate pair", allowed)
        level = [
            child
            for value in level
            if isinstance(value, (dict, list))
            for child in (value.values() if isinstance(value, dict) else value)
        ]
        if not level:
            return tree
    raise InputError("text that is nested too deeply", allowed)


def refuse_unpacking(what: str, packed: int, unpacked: int, remedy: str) -> None:
    """Raise `InputError` if `packed` bytes claim to unpack to more than the limit."""
    limit = max(MAX_EXPANSION * packed, ALWAYS_UNPACKED)
    if unpacked > limit:
        given = f"{what} (its {packed} bytes unpack to {unpacked})"
        raise InputError(given, f"{limit} bytes, {MAX_EXPANSION} times as much", remedy)


def refuse_beyond_memory(what: str, size: int, remedy: str) -> None:
    """Raise `InputError` if `size` bytes exceed this machine's memory."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if size > memory:
        raise InputError(
            f"{what} ({size / 1e9:.1f} GB)", f"{memory / 1e9:.1f} GB, this machine's memory", remedy
        )


def _encodable(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True
