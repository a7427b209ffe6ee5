"""A compilation is shown, on a terminal, and only where there is one."""

import io

import numba

from monochord.core.compilation import compilation_shown


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def compiled_afresh() -> None:
    for number in range(2):
        numba.njit(lambda x: x + number)(1.0)  # noqa: B023


def test_a_terminal_shows_a_bar_and_then_erases_it() -> None:
    file = Terminal()
    with compilation_shown(file):
        compiled_afresh()
    text = file.getvalue()
    assert text.startswith("\rcompiling, once, about")
    assert text.endswith("\r\x1b[K")
    assert "\n" not in text


def test_a_log_gets_nothing() -> None:
    file = io.StringIO()
    with compilation_shown(file):
        compiled_afresh()
    assert not file.getvalue()


def test_nothing_is_written_where_nothing_is_compiled() -> None:
    ready = numba.njit(lambda x: x + 1.0)
    assert ready(1.0) == 2.0
    file = Terminal()
    with compilation_shown(file):
        assert ready(2.0) == 3.0
    compiled_afresh()
    assert not file.getvalue()
