"""Text from anywhere, on a terminal: nothing in it works, and everything can still be read."""

import json
import sys
import unicodedata
from pathlib import Path

import pytest
from rich.console import Console
from rich.text import Text
from tests.sessions.forged import SOUND, Forgery, described, event, forge, labels

from monochord.cli import run
from monochord.core.printable import printable
from monochord.core.screen import Screen

NASTY = "a\x1b]0;owned\x07b\x9b31mc\u202ed\u2066e\rf\x08g\x7fh\u2028i\x00j"
ASCII_NASTY = NASTY.replace("\x00", "")
"""What a path can hold."""


def works(text: str) -> list[str]:
    """Return the characters of a text that make a terminal do something else than print."""
    return [
        char
        for char in text
        if (unicodedata.category(char) in ("Cc", "Cf", "Cs", "Zl", "Zp") and char not in "\n\t")
    ]


def test_every_control_character_is_written_out() -> None:
    everything = "".join(map(chr, range(sys.maxunicode + 1)))
    shown = printable(everything)
    controls = {char for char in everything if unicodedata.category(char) == "Cc"} - {"\t"}
    turns = {
        char
        for char in everything
        if unicodedata.bidirectional(char) in ("LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI")
    }
    lone = {char for char in everything if unicodedata.category(char) in ("Cs", "Zl", "Zp")}
    assert not (controls | turns | lone) & set(shown)
    shown.encode()  # as every terminal can be given


def test_what_is_no_control_character_stays() -> None:
    plain = "Ümläute, 弦, שלום, ± 0.3 mm, \U0001f3b8\ttab"
    assert printable(plain) == plain


def test_json_stays_the_same_value() -> None:
    text = json.dumps({NASTY: NASTY})
    assert json.loads(printable(text)) == {NASTY: NASTY}
    assert not works(printable(text))


def nasty(folder: Path) -> Path:
    """Write a session in which all that is text is nasty."""
    description = described(
        name=NASTY,
        object=NASTY,
        material=NASTY,
        notes=NASTY,
        plan=NASTY,
        more={NASTY: NASTY},
        versions={NASTY: NASTY},
        feeds=[
            {
                "stream": "oven",
                "columns": [NASTY, "b\n" + NASTY],
                "units": [NASTY, ""],
                "details": {"a": NASTY},
            }
        ],
    )
    messages = [
        *(each for each in SOUND if each.topic in ("/audio", "/clocks")),
        Forgery("/labels", labels(columns=[NASTY])),
        Forgery("/events", event(kind=NASTY, text=NASTY)),
        Forgery("/events", event(data='{"' + NASTY)),
    ]
    path = folder / f"{ASCII_NASTY}.mcap"
    return forge(
        path,
        messages,
        description_text=description,
        end={"checksum": NASTY, "sha256": json.dumps({NASTY: NASTY})},
    )


@pytest.mark.parametrize("arguments", [["show"], ["show", "--json"], ["check"], ["check", "--json"]])
def test_nothing_in_a_session_works_on_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str]
) -> None:
    status = run(["sessions", arguments[0], str(nasty(tmp_path)), *arguments[1:]])
    out, err = capsys.readouterr()
    assert status == (2 if arguments[0] == "check" else 0), err
    assert not works(out + err)
    assert "owned" in out
    # A line end in a text is none on the screen: every line is one that we began.
    assert all(line.startswith(("a\\u001b", "  ", "bad", "{")) for line in out.splitlines())


def test_nothing_in_an_error_works_on_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / f"{ASCII_NASTY}.mcap").write_bytes(b"")
    broken = forge(
        tmp_path / "a.mcap", description_text=json.dumps({"name": NASTY, NASTY: 1, "sample_rate": NASTY})
    )
    for path in (tmp_path / f"{ASCII_NASTY}.mcap", tmp_path / f"{NASTY[:5]}.wav", broken):
        for verb in (
            ["sessions", "show"],
            ["sessions", "check"],
            ["locate"],
            ["build", "--out", str(tmp_path / "d")],
        ):
            assert run([*verb, str(path)]) == 2
            out, err = capsys.readouterr()
            assert not works(out + err), verb
            assert err.count("\n") == 1, verb
    assert run(["sessions", NASTY]) == 2
    assert not works(capsys.readouterr().err)
    assert run([NASTY]) == 2
    assert not works(capsys.readouterr().err)


def test_a_picture_holds_no_controls_but_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console(force_terminal=True, width=200, height=10, no_color=True, color_system="truecolor")
    with Screen(console) as screen:
        screen.show([Text(f"styled {NASTY}", "bold"), Text(NASTY)])
    drawn = capsys.readouterr().out
    for own in ("\x1b[?25l", "\x1b[?25h", "\x1b[J", "\x1b[K", "\x1b[1m", "\x1b[0m"):
        drawn = drawn.replace(own, "")
    assert not works(drawn.removeprefix("\r"))
    assert "owned" in drawn


def test_an_error_line_ends_somewhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = forge(
        tmp_path / "a.mcap", description_text=json.dumps({"name": ["x" * 1_000_000], "sample_rate": 1})
    )
    assert run(["sessions", "show", str(path)]) == 2
    err = capsys.readouterr().err
    assert len(err) < 3000
    assert str(path) in err


def test_a_name_is_no_formula(tmp_path: Path) -> None:
    path = forge(tmp_path / "a.mcap", description_text=described(name="$\\frac{$ \x1b"))
    assert run(["sessions", "show", str(path), "--figure", str(tmp_path / "a.svg")]) == 0
    assert (tmp_path / "a.svg").stat().st_size
