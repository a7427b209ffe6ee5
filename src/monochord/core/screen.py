"""Consoles, and a picture at the bottom of a terminal; an update rewrites only changed lines."""

import os
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from types import TracebackType
from typing import IO

from rich.color import ColorSystem
from rich.console import COLOR_SYSTEMS, Console
from rich.text import Text

from monochord.core.printable import printable

HIDE_CURSOR, SHOW_CURSOR = "\x1b[?25l", "\x1b[?25h"
CLEAR_LINE, CLEAR_BELOW = "\x1b[K", "\x1b[J"


def console_of(file: IO[str], environment: Mapping[str, str] = os.environ) -> Console:
    """Return the console of a stream: a terminal where the stream is one, whatever ``FORCE_COLOR`` says.

    A pipe, a file or a log gets no control sequences. Of the environment, ``NO_COLOR``, ``TERM`` and the size
    count.

    >>> from io import StringIO
    >>> can_draw(console_of(StringIO()))
    False
    """
    return _Console(
        file=file,
        highlight=False,
        force_terminal=file.isatty(),
        force_jupyter=False,
        _environ=environment,
    )


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to whoever writes what follows; rich would end the thread and hide the pipe."""
        raise  # noqa: PLE0704  (rich calls it while it handles the error)


def can_draw(console: Console) -> bool:
    """Return whether a console is a terminal that supports a `Screen`."""
    return (
        console.is_terminal
        and not console.is_dumb_terminal
        and not console.legacy_windows
        and console.encoding.startswith("utf")
    )


class Screen(AbstractContextManager["Screen"]):
    """Pictures that replace one another below earlier output; the last one stays.

    `console` must be a terminal that supports ANSI control sequences.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._colours: ColorSystem | None = COLOR_SYSTEMS.get(console.color_system or "")
        self._shown: list[Text] = []
        self._columns = console.width

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the cursor below the picture."""
        if self._shown:
            self._write("\n" + SHOW_CURSOR)

    def show(self, picture: Sequence[Text]) -> None:
        """Draw a picture, cropped to the terminal; the caller must not change its lines afterwards."""
        size = self._console.size
        lines = list(picture[: max(size.height - 1, 1)])
        for line in lines:
            line.truncate(size.width, overflow="crop")
        # A terminal of another width may have folded lines, so none is where it was.
        unchanged = self._shown if (size.width, len(lines)) == (self._columns, len(self._shown)) else []
        above = len(self._shown) - 1
        drawn = ["\r", f"\x1b[{above}A" if above > 0 else "", "" if unchanged else HIDE_CURSOR + CLEAR_BELOW]
        for k, line in enumerate(lines):
            drawn.append("\n" if k else "")
            if not unchanged or line != unchanged[k]:
                drawn.append(self._ansi(line) + CLEAR_LINE)
        self._shown, self._columns = lines, size.width
        self._write("".join(drawn))

    def _ansi(self, line: Text) -> str:
        """Return a line with its styles as control sequences."""
        parts: list[str] = []
        for text, style, _ in Text.assemble(line).render(self._console):  # its own style becomes a span
            plain = style.without_color if style and self._console.no_color else style
            shown = printable(text)
            parts.append(plain.render(shown, color_system=self._colours) if plain else shown)
        return "".join(parts)

    def _write(self, text: str) -> None:
        self._console.file.write(text)
        self._console.file.flush()
