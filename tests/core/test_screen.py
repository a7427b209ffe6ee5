"""Pictures over pictures: what is written to a terminal."""

from io import StringIO

import pytest
from rich.console import Console
from rich.text import Text

from monochord.core.screen import HIDE_CURSOR, SHOW_CURSOR, Screen, can_draw, console_of


@pytest.fixture
def console() -> Console:
    return Console(force_terminal=True, width=20, height=10, no_color=True, color_system="truecolor")


def test_a_picture_taller_than_before_starts_anew(
    console: Console, capsys: pytest.CaptureFixture[str]
) -> None:
    with Screen(console) as screen:
        screen.show([Text("one"), Text("two")])
        screen.show([Text("one"), Text("deux", "bold red"), Text("x" * 30), *[Text("more")] * 20])
        screen.show([Text("one"), Text("ten")])
    drawn = capsys.readouterr().out
    assert "\x1b[1mdeux\x1b[0m" in drawn  # bold, but NO_COLOR holds
    assert "x" * 20 in drawn
    assert "x" * 21 not in drawn
    assert drawn.count("more") == 6  # of ten rows, one stays free
    # Cleared before each of the three, for none is as tall as the one before.
    assert drawn.count("\x1b[J") == 3


def test_a_line_that_stays_is_not_drawn_again(console: Console, capsys: pytest.CaptureFixture[str]) -> None:
    with Screen(console) as screen:
        for second in range(3):
            screen.show([Text("stays"), Text(f"second {second}")])
    drawn = capsys.readouterr().out
    assert drawn.count("stays") == 1
    assert [f"second {second}" in drawn for second in range(3)] == [True] * 3


def test_the_cursor_comes_back_if_anything_was_drawn(
    console: Console, capsys: pytest.CaptureFixture[str]
) -> None:
    with Screen(console) as screen:
        screen.show([Text("one")])
    drawn = capsys.readouterr().out
    assert drawn.count(HIDE_CURSOR) == drawn.count(SHOW_CURSOR) == 1
    with Screen(console):
        pass
    assert capsys.readouterr().out == ""


def test_only_a_terminal_that_moves_its_cursor_is_drawn_on(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert can_draw(console)
    assert not can_draw(Console(force_terminal=False))
    monkeypatch.setenv("TERM", "dumb")
    assert not can_draw(Console(force_terminal=True))


def test_what_forces_colours_makes_no_terminal_of_a_pipe() -> None:
    pipe = StringIO()
    console = console_of(pipe, {"FORCE_COLOR": "1", "TTY_COMPATIBLE": "1", "TERM": "xterm-256color"})
    console.print("[bold red]red")
    assert pipe.getvalue() == "red\n"
    assert not can_draw(console)
