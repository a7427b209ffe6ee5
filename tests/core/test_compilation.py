"""A compilation is announced, once, and only where there is one."""

import io

import numba
import pytest

from monochord.core.compilation import compilation_shown


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def compiled_afresh() -> None:
    for number in range(2):
        numba.njit(lambda x: x + number)(1.0)  # noqa: B023


@pytest.mark.parametrize("kind", [io.StringIO, Terminal])
def test_it_is_announced_and_a_bar_is_erased(kind: type[io.StringIO]) -> None:
    file = kind()
    with compilation_shown(file):
        compiled_afresh()
    text = file.getvalue()
    assert text.startswith(("compiling, once, about", "\rcompiling, once, about"))
    if kind is Terminal:
        assert text.endswith("\r\x1b[K")
        assert "\n" not in text
    else:
        assert text.count("\n") == text.count("compiling") == 1


def test_nothing_is_written_where_nothing_is_compiled() -> None:
    ready = numba.njit(lambda x: x + 1.0)
    assert ready(1.0) == 2.0
    file = Terminal()
    with compilation_shown(file):
        assert ready(2.0) == 3.0
    compiled_afresh()
    assert not file.getvalue()
