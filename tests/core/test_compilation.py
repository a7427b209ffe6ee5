"""A compilation is shown, on a terminal, and only where there is one."""

import io
import os
import pty
import subprocess
import sys
from contextlib import suppress

from monochord.core.compilation import Bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown_on(file: io.StringIO) -> str:
    bar = Bar(file)
    bar.start()
    bar.start()  # a function that another one calls
    bar.stop()
    bar.stop()
    return file.getvalue()


def test_a_terminal_shows_a_bar_and_then_erases_it() -> None:
    text = shown_on(Terminal())
    assert text.startswith("\rcompiling, once, about")
    assert text.endswith("\r\x1b[K")
    assert "\n" not in text


def test_a_log_gets_nothing() -> None:
    assert not shown_on(io.StringIO())


def test_any_program_on_a_terminal_shows_it_and_only_where_something_is_compiled() -> None:
    code = (
        "from monochord.core.kernels import kernel\n"
        "for _ in range(2):\n"
        "    print('next', flush=True)\n"
        "    assert one(2.0) == 3.0\n"
    )
    ours, theirs = pty.openpty()
    define = code.replace("for _", "one = kernel()(lambda x: x + 1.0)\nfor _", 1)
    printed = b""
    with subprocess.Popen([sys.executable, "-c", define], stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        with suppress(OSError):  # Linux tells this way that the other side was closed
            while more := os.read(ours, 65536):
                printed += more
    os.close(ours)
    assert process.returncode == 0, printed.decode()
    _, first, second = printed.decode().split("next")
    assert "compiling, once, about" in first
    assert first.endswith("\r\x1b[K")
    assert "compiling" not in second
