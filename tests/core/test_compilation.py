"""A compilation is shown, on a terminal, and only where there is one."""

import gc
import io
import sys
from typing import Any

import pytest
from numba.core.errors import TypingError
from tests.cli.terminal import on_a_terminal

from monochord.core.compilation import CompilationBar
from monochord.core.kernels import kernel


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def shown_on(file: io.StringIO) -> str:
    bar = CompilationBar(file)
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
        "one = kernel()(lambda x: x + 1.0)\n"
        "for _ in range(2):\n"
        "    print('next', flush=True)\n"
        "    assert one(2.0) == 3.0\n"
    )
    _, first, second = on_a_terminal([sys.executable, "-c", code]).split("next")
    assert "compiling, once, about" in first
    assert first.endswith("\r\x1b[K")
    assert "compiling" not in second


def collections_while_compiling() -> int:
    """How often Python looks for garbage while a function is compiled that calls another."""
    one = kernel()(lambda x: x + 1.0)
    two: Any = kernel()(lambda x: one(x) + one(2.0 * x))
    counts: list[str] = []

    def count(phase: str, info: dict[str, int]) -> None:
        counts.append(phase)

    gc.callbacks.append(count)
    try:
        two.compile("float64(float64)")
    finally:
        gc.callbacks.remove(count)
    return counts.count("start")


@pytest.mark.parametrize("on", [True, False])
def test_no_garbage_is_looked_for_while_something_is_compiled(*, on: bool) -> None:
    before = gc.isenabled()
    try:
        (gc.enable if on else gc.disable)()
        assert collections_while_compiling() < 5  # those due at the end; else they are a hundred
        assert gc.isenabled() == on
    finally:
        (gc.enable if before else gc.disable)()


def test_a_compilation_that_fails_leaves_the_collector_on() -> None:
    bad = kernel()(lambda x: x.nothing)
    with pytest.raises(TypingError):
        bad(1.0)
    assert gc.isenabled()
