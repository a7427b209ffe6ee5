"""The view on a real pseudo-terminal, and the plain lines without one."""

import dataclasses
import os
import re
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from tests.cli.terminal import on_a_terminal
from tests.live.sinks.made import SIGNAL, window_update

from monochord.core import reasons
from monochord.core.reasons import Finding, Reason
from monochord.core.timing import Histogram
from monochord.core.types import Estimate, StreamHealth
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.live.sinks import _notes, _view
from monochord.live.sinks.base import Run, Update
from monochord.live.sinks.terminal import Terminal

PROGRAM = """
    import sys
    import numpy as np
    from monochord.live.events import Event
    from monochord.live.health import Note
    from monochord.live.sinks.base import Update, Run
    from monochord.live.sinks.terminal import Terminal
    from monochord.core.types import Estimate, Prediction, Signal, StreamHealth, Window

    tone = (0.3 * np.sin(np.arange(4410) * 0.1)).astype(np.float32)
    with Terminal(length=0.65).open(Run(signal=Signal(sample_rate=44100, channels=2))) as writer:
        for k in range(40):
            estimates = {
                "frequency": Estimate(value=695.0, std=0.1, unit="Hz"),
                "position": Estimate(value=0.2275, std=0.004, unit="m"),
                "force": Estimate(value=0.8, std=0.05, unit="N"),
                "tension": Estimate(value=66.1, std=0.1, unit="N"),
                "frequency_1": Estimate(value=695.0, std=0.1, unit="Hz"),
                "frequency_2": Estimate(value=374.0, std=0.1, unit="Hz"),
            }
            if k < 20:
                estimates = {n: Estimate.abstain(e.unit, "two candidates") for n, e in estimates.items()}
            writer.write(Update(
                prediction=Prediction(start=441 * k, time=k / 100, estimates=estimates, latency=1e-3),
                window=Window(samples=np.stack([tone, 0.1 * tone]), start=441 * k, sample_rate=44100),
                health=StreamHealth(dropped=64, gaps=1),
                truth={"contact": 1.0, "position": 0.228, "force": 0.81},
                skipped=2,
                events=(Event(name="contact", on=True, time=0.3, delay=0.02, confidence=0.978),) * (k == 20),
                notes=(Note(key="hum", level="error", sentence="It hums.", remedy="Mend it.", since=0.2),)
                * ("hum" in sys.argv),
            ))
"""


def drawn_by(columns: int, rows: int, program: Path, *arguments: str, term: str = "xterm-256color") -> str:
    """Run a program on a pseudo-terminal of a size and return all that it drew."""
    environment = {**os.environ, "TERM": term, "PYTHONIOENCODING": "utf-8"}
    for name in ("NO_COLOR", "COLUMNS", "LINES"):
        environment.pop(name, None)
    command = [sys.executable, program, *arguments]
    return on_a_terminal(command, environment=environment, size=(columns, rows))


def last_picture(drawn: str) -> list[str]:
    """Return what stands on the terminal in the end, as a terminal without styles keeps it."""
    screen, row, column = [""], 0, 0
    for part in re.findall(r"\x1b\[[0-9;?]*[a-zA-Z]|\r|\n|[^\x1b\r\n]+", drawn):
        if part == "\r":
            column = 0
        elif part == "\n":
            row += 1
            screen += [""] * (row + 1 - len(screen))
        elif part.startswith("\x1b["):
            row -= int(part[2:-1]) if part.endswith("A") else 0
            screen[row] = screen[row][:column] if part[-1] in "KJ" else screen[row]
            screen = screen[: row + 1] if part.endswith("J") else screen
        else:
            screen[row] = screen[row][:column].ljust(column) + part + screen[row][column + len(part) :]
            column += len(part)
    return "\n".join(screen).rstrip("\n").split("\n")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("terminal") / "show.py"
    path.write_text(textwrap.dedent(PROGRAM), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def drawn(program: Path) -> str:
    return drawn_by(80, 24, program)


def test_the_picture_fits_and_the_touch_is_drawn_where_it_is(drawn: str) -> None:
    lines = last_picture(drawn)
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    text = "\n".join(lines)
    for part in ("227.5 mm", "± 4.00 mm", "mic 1", "mic 2", "latency", "gaps 1"):
        assert part in text
    ruler = next(line for line in lines if "└" in line)
    nut, bridge = ruler.index("└"), ruler.index("┘")
    (touch,) = {line.index("▼") for line in lines if "▼" in line}
    (truth,) = {line.index("▲") for line in lines if "▲" in line}
    assert (touch - nut) / (bridge - nut) == pytest.approx(0.2275 / 0.65, abs=0.02)
    assert (truth - nut) / (bridge - nut) == pytest.approx(0.228 / 0.65, abs=0.02)


def test_only_what_changed_is_drawn_again(drawn: str) -> None:
    assert drawn.count("two candidates") > 1
    assert drawn.count("└") == 1
    assert drawn.count("\x1b[?25l") == drawn.count("\x1b[?25h") == 1
    assert "\n".join(last_picture(drawn)).count("monochord") == 1


def test_a_terminal_that_cannot_draw_gets_lines(program: Path) -> None:
    drawn = drawn_by(80, 24, program, term="dumb")
    assert "▼" not in drawn
    assert "\x1b" not in drawn
    assert "position 227.5 mm +- 4.00 mm" in drawn


def update(k: int, *, valid: bool = True) -> Update:
    position = Estimate(value=0.2275, std=2e-4, unit="m") if valid else Estimate.abstain("m", "silence")
    samples = np.full((2, 4410), 0.1, np.float32)
    return window_update(k, {"position": position}, samples, health=StreamHealth(gaps=1), skipped=2)


def test_without_a_terminal_one_line_a_second_and_the_last(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal().open(Run(signal=SIGNAL)) as writer:
        for k in range(100):
            writer.write(update(k, valid=k < 50))
    first, last = capsys.readouterr().out.splitlines()
    for part in ("0.00 s", "227.5 mm +- 0.20 mm", "-20 / -20 dB", "2.00 ms", "gaps 1", "skipped 2"):
        assert part in first
    assert "0.99 s" in last
    assert "silence" in last
    assert first.isascii()


def test_standard_error_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal(stderr=True).open(Run(signal=SIGNAL)) as writer:
        writer.write(update(0))
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "227.5 mm" in captured.err


def learned(**given: tuple[float, float] | str) -> Update:
    """Return an update of what a model tells; a text is a reason for telling nothing."""
    units = {"position": "m", "force": "N"}
    estimates = {
        name: Estimate.abstain(units.get(name, ""), pair)
        if isinstance(pair, str)
        else Estimate(value=pair[0], std=pair[1], unit=units.get(name, ""))
        for name, pair in given.items()
    }
    shown = update(0)
    return dataclasses.replace(shown, prediction=dataclasses.replace(shown.prediction, estimates=estimates))


def rows_of(shown: Update, columns: int) -> dict[str, str]:
    """Return the rows of the estimates by their first word."""
    lines = _view.frame(shown, SIGNAL, 0.2, Histogram().percentiles(), columns, 24)
    assert len(lines) < 24
    plain = [line.plain for line in lines]
    names = ("contact", "position", "force", "slip")
    lines = {name: line for line in plain for name in names if line.split()[:1] == [name]}
    assert all(len(line) <= columns for line in lines.values())
    return lines


TOUCH = {"contact": 1.0, "position": 0.15, "force": 0.5, "slip": 0.0}


def test_each_estimate_lies_on_its_track_beside_the_truth() -> None:
    given = {"contact": (0.998, 0.04), "slip": (0.03, 0.17), "position": (0.1, 0.02), "force": (0.5, 0.001)}
    rows = rows_of(dataclasses.replace(learned(**given), truth=TOUCH), 80)
    assert [*rows] == ["contact", "position", "force", "slip"]
    values = {"contact": "99.8 %", "position": "100.0 mm  ± 20.0 mm", "force": "0.50 N", "slip": "97 %"}
    assert all(value in rows[name] for name, value in values.items())
    track = re.search(r"[─━●◆◉]{8,}", rows["position"])
    assert track
    cells = track[0]
    assert cells.index("●") == pytest.approx(0.5 * (len(cells) - 1), abs=0.6)
    assert cells.index("◆") == pytest.approx(0.75 * (len(cells) - 1), abs=0.6)
    assert cells.count("━") + 1 == pytest.approx(0.2 * len(cells), abs=1.6)


def test_an_abstention_has_its_reason_and_no_mark_of_its_own() -> None:
    given = {"contact": (0.02, 0.1), "slip": "no contact", "position": "too unsure", "force": "no contact"}
    rows = rows_of(dataclasses.replace(learned(**given), truth=TOUCH), 80)
    assert "too unsure" in rows["position"]
    assert "◆" in rows["position"]
    assert "●" not in rows["position"]
    assert not any("◆" in row for row in rows_of(learned(**given), 80).values())


def test_no_certainty_is_made_of_a_probability(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        writer.write(learned(contact=(0.99996, 0.006), slip=(0.4, 0.5), force="too unsure"))
    line = capsys.readouterr().out
    assert "99.9 %" in line
    assert "100" not in line
    assert "60 %" in line


def note(finding: Finding, since: float = 0.0) -> Note:
    return Note(
        key=finding.key,
        level=finding.level,
        sentence=finding.sentence,
        remedy=finding.remedy,
        since=since,
    )


assert Reason.MICROPHONE_2_SILENT.finding is not None
SILENT, DEAD, CLIPPING, SETTLING = map(
    note,
    (reasons.NO_MICROPHONE, Reason.MICROPHONE_2_SILENT.finding, reasons.CLIPPING, reasons.SETTLING),
)


def noted(*notes: Note, time: float = 1.0, string: str = "", events: tuple[Event, ...] = ()) -> Update:
    """Return an update of a model with notes."""
    shown = learned(contact=(0.998, 0.04), slip=(0.03, 0.17), position=(0.1, 0.02), force=(0.5, 0.001))
    prediction = dataclasses.replace(shown.prediction, time=time)
    return dataclasses.replace(shown, prediction=prediction, notes=notes, string=string, events=events)


def text_of(shown: Update, columns: int, rows: int, last: Event | None = None) -> str:
    """Return all words of the frame, after its height was looked at."""
    lines = _view.frame(shown, SIGNAL, 0.2, Histogram().percentiles(), columns, rows, last=last)
    assert len(lines) < rows
    return " ".join(" ".join(line.plain for line in lines).split())


@pytest.mark.parametrize(
    ("columns", "rows"), [(110, 60), (80, 24), (60, 15), (60, 10), (40, 7), (24, 24), (80, 2)]
)
def test_an_error_is_read_whole_on_a_terminal_of_any_size(columns: int, rows: int) -> None:
    touch = Event(name="contact", on=True, time=0.9, delay=0.03, confidence=0.9)
    text = text_of(noted(CLIPPING, SETTLING, DEAD), columns, rows, touch if rows > 15 else None)
    assert "error" in text
    if rows > 2:
        assert f"{DEAD.sentence} {DEAD.remedy}" in text
    if rows >= 24 and columns >= 60:
        assert f"{CLIPPING.sentence} {CLIPPING.remedy}" in text
        assert text.index(DEAD.sentence) < text.index(CLIPPING.sentence)


@pytest.mark.parametrize("columns", [24, 60, 110])
def test_a_note_is_wrapped_within_the_width(columns: int) -> None:
    lines = [line.plain for line in _notes.wrapped(CLIPPING, columns)]
    assert max(map(len, lines)) < columns
    assert " ".join(" ".join(lines).split()).endswith(f" {CLIPPING.sentence} {CLIPPING.remedy}")


def test_a_brief_info_is_not_shown_and_one_that_lasts_is() -> None:
    settling = note(reasons.SETTLING, since=1.0)
    assert settling.sentence not in text_of(noted(settling, time=1.05), 80, 40)
    assert SETTLING.sentence in text_of(noted(SETTLING, time=0.5), 80, 40)


def test_a_note_cannot_control_the_terminal() -> None:
    evil = note(Finding(key="off", level="error", sentence="Off:\x1b[2J\nit went.", remedy="\x1b[31mRun."))
    text = text_of(noted(evil), 80, 24)
    assert "Off:\\u001b[2J it went. \\u001b[31mRun." in text
    assert "\x1b" not in text


@pytest.mark.parametrize("rows", [24, 5, 4])
def test_of_several_strings_each_has_a_line_and_its_worst_note(rows: int) -> None:
    strings = {"left": (SETTLING, DEAD), "middle": (), "right": (SETTLING, CLIPPING)}
    updates = [noted(*notes, string=name) for name, notes in strings.items()]
    lines = [line.plain for line in _view.several(updates, Histogram().percentiles(), 300, rows)]
    assert len(lines) < rows
    assert sum(DEAD.sentence in line and line.startswith("left") for line in lines) == 1
    assert sum(CLIPPING.sentence in line and line.startswith("right") for line in lines) == (rows > 5)
    shown = [line.split()[0] for line in lines if "100.0 mm" in line]
    assert shown == (["left"] if rows >= 5 else []) + ["middle", "right"]
    assert not any(SETTLING.sentence in line for line in lines)
    assert len(_view.several(updates[:1], Histogram().percentiles(), 60, 24)[1]) == 60


def test_a_log_has_a_line_where_a_note_begins_or_becomes_worse_and_one_where_it_ends(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lost = Finding(key="lost", level="warning", sentence="Sound was lost: 1 gap.", remedy="Close others.")
    more = dataclasses.replace(lost, sentence="Sound was lost: 2 gaps.")
    worse = dataclasses.replace(more, level="error")
    shown = (
        (), (DEAD,), (DEAD,), (DEAD, note(lost, 0.03)), (DEAD, note(more, 0.03)),
        (note(more, 0.03),), (note(worse, 0.03),), (), (note(reasons.SETTLING, 0.07),),
    )  # fmt: skip
    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        for k, notes in enumerate(shown):
            writer.write(noted(*notes, time=k / 100, string="left"))
            writer.write(noted(time=k / 100, string="right"))
    lines = capsys.readouterr().out.splitlines()
    told = [line for line in lines if DEAD.sentence in line or "Sound was lost" in line]
    assert all(line.startswith("left") for line in told)
    times = [re.search(r"([\d.]+) s", line) for line in told]
    assert [match and match[1] for match in times] == ["0.01", "0.03", "0.05", "0.06", "0.07"]
    assert not any(SETTLING.sentence in line for line in lines)


def test_many_events_make_no_long_line(capsys: pytest.CaptureFixture[str]) -> None:
    def event(k: int) -> Event:
        return Event(name="contact", on=k % 2 == 0, time=k / 10, delay=0.03, confidence=0.978)

    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        for k in range(200):
            writer.write(noted(events=(event(k),)))
    first, last = capsys.readouterr().out.splitlines()
    assert "0.00 s (98 %)" in first
    assert "199 events" in last
    assert "19.90 s (98 %)" in last
    assert len(last) < 2 * len(first)
