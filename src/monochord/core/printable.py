"""Makes text from a file or a device safe to print in a terminal."""

import re

_CONTROLS = re.compile(
    "[\x00-\x08\x0a-\x1f\x7f-\x9f"  # C0 but the tab, DEL, and C1, with which control sequences begin
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # what turns the direction of writing
    "\u2028\u2029\ud800-\udfff]"  # ends of lines, and what no encoding takes
)


def printable(line: str) -> str:
    r"""Return a line without control effects in a terminal.

    Control characters, line ends included, and characters that change the writing direction are escaped as in
    JSON. Escaped JSON keeps its meaning.

    >>> printable("plain \x1b[31mred\u202e")
    'plain \\u001b[31mred\\u202e'
    """
    return _CONTROLS.sub(lambda match: f"\\u{ord(match[0]):04x}", line)
