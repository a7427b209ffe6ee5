"""The view on a real pseudo-terminal, and the plain lines without one."""

import dataclasses
import fcntl
import itertools
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

from monochord.core.timing import Histogram
from monochord.core.types import Estimate, Prediction, Signal, StreamHealth, Window
from monochord.live import health
from monochord.live.events import Event
from monochord.live.health import Finding, Note
from monochord.live.sinks import _notes, _view
from monochord.live.sinks.base import Moment, Run
from monochord.live.sinks.terminal import Terminal

SIGNAL = Signal(sample_rate=44100, channels=2)
PROGRAM = """
    import sys
    import numpy as np
    from monochord.live.events import Event
    from monochord.live.health import Note
    from monochord.live.sinks.base import Moment, Run
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
            writer.write(Moment(
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


def on_a_terminal(
    columns: int, rows: int, program: Path, *arguments: str, term: str = "xterm-256color"
) -> str:
    """Run a program on a pseudo-terminal of a size and return all that it drew."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    environment = {**os.environ, "TERM": term, "PYTHONIOENCODING": "utf-8"}
    for name in ("NO_COLOR", "COLUMNS", "LINES"):
        environment.pop(name, None)
    process = subprocess.Popen(
        [sys.executable, program, *arguments], stdout=theirs, stderr=subprocess.STDOUT, env=environment
    )
    os.close(theirs)
    drawn = b""
    end = time.monotonic() + 30.0
    while time.monotonic() < end and select.select([ours], [], [], 30.0)[0]:
        try:
            drawn += os.read(ours, 65536)
        except OSError:  # Linux tells this way that the other side was closed
            break
    os.close(ours)
    assert process.wait(10.0) == 0, drawn.decode()
    return drawn.decode()


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


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (120, 40), (60, 20)])
def test_the_picture_fits_its_terminal(program: Path, columns: int, rows: int) -> None:
    lines = last_picture(on_a_terminal(columns, rows, program))
    assert len(lines) <= rows
    assert max(map(len, lines)) <= columns
    text = "\n".join(lines)
    for part in (
        "▼",
        "▲ truth",
        "nut",
        "bridge",
        "227.5 mm",
        "± 4.00 mm",
        "mic 1",
        "mic 2",
        "latency",
        "gaps 1",
    ):
        assert part in text


def test_the_touch_is_drawn_where_it_is(program: Path) -> None:
    lines = last_picture(on_a_terminal(80, 24, program))
    ruler = next(line for line in lines if "└" in line)
    nut, bridge = ruler.index("└"), ruler.index("┘")
    (touch,) = {line.index("▼") for line in lines if "▼" in line}
    (truth,) = {line.index("▲") for line in lines if "▲" in line}
    assert (touch - nut) / (bridge - nut) == pytest.approx(0.2275 / 0.65, abs=0.02)
    assert (truth - nut) / (bridge - nut) == pytest.approx(0.228 / 0.65, abs=0.02)
    assert "two candidates" in on_a_terminal(80, 24, program)


def test_only_what_changed_is_drawn_again(program: Path) -> None:
    drawn = on_a_terminal(80, 24, program)
    assert drawn.count("two candidates") > 1
    assert drawn.count("└") == 1
    assert drawn.count("\x1b[?25l") == drawn.count("\x1b[?25h") == 1
    assert "\n".join(last_picture(drawn)).count("monochord") == 1


def test_notes_and_the_last_event_stand_below_the_rest(program: Path) -> None:
    drawn = on_a_terminal(80, 24, program, "hum")
    lines = last_picture(drawn)
    assert len(lines) == 23
    assert lines[-2:] == [
        "  event    touched at 0.30 s, decided 20 ms later, 98 %",
        "  error    It hums. Mend it.",
    ]
    assert re.search(r"\x1b\[[0-9;]*31[0-9;]*mIt hums\.", drawn), "an error is red"


def test_a_terminal_that_cannot_draw_gets_lines(program: Path) -> None:
    drawn = on_a_terminal(80, 24, program, term="dumb")
    assert "▼" not in drawn
    assert "\x1b" not in drawn
    assert "position 227.5 mm +- 4.00 mm" in drawn


def moment(k: int, *, valid: bool = True) -> Moment:
    position = Estimate(value=0.2275, std=2e-4, unit="m") if valid else Estimate.abstain("m", "silence")
    return Moment(
        prediction=Prediction(start=441 * k, time=k / 100, estimates={"position": position}, latency=1e-3),
        window=Window(samples=np.full((2, 4410), 0.1, np.float32), start=0, sample_rate=44100),
        health=StreamHealth(gaps=1),
        truth={},
        skipped=2,
    )


def test_without_a_terminal_one_line_a_second_and_the_last(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal().open(Run(signal=SIGNAL)) as writer:
        for k in range(100):
            writer.write(moment(k, valid=k < 50))
    first, last = capsys.readouterr().out.splitlines()
    for part in (
        "0.00 s  position 227.5 mm +- 0.20 mm",
        "level -20 / -20 dB",
        "p99 1.00 ms",
        "gaps 1",
        "skipped 2",
    ):
        assert part in first
    assert "0.99 s  no position (silence)" in last
    assert first.isascii()


def seen(**truth: float) -> Moment:
    return dataclasses.replace(moment(0), truth=truth)


@pytest.mark.parametrize(
    ("truth", "words"),
    [
        ({"contact": 0.0, "settled": 1.0}, "truth: untouched"),
        ({"contact": 0.0, "settled": 0.0}, "truth: untouched, settling"),
        ({"contact": 1.0, "position": 0.3}, "truth"),
        (
            {"contact": 1.0, "position": 0.3, "slip": 0.0, "slip_velocity": 1e-4, "settled": 0.0},
            "truth, settling",
        ),
        ({"contact": 1.0, "position": 0.3, "slip": 1.0, "slip_velocity": 0.0123}, "truth, slides 12.3 mm/s"),
        (
            {"contact": 1.0, "position": 0.64, "slip": 1.0, "slip_velocity": 0.0123},
            "truth, slides 12.3 mm/s ▲",
        ),
        ({}, ""),
    ],
)
@pytest.mark.parametrize("columns", [60, 110])
def test_what_the_touch_does_in_truth_stands_below_it(
    truth: dict[str, float], words: str, columns: int
) -> None:
    lines = _view.frame(seen(**truth), SIGNAL, 0.65, Histogram().percentiles(), columns, 40)
    picture = [line.plain for line in lines]
    (below,) = [above for above, line in itertools.pairwise(picture) if "└" in line]
    assert below.strip().removeprefix("▲ ") == words
    assert len(below) <= columns


def test_a_plain_line_tells_the_truth_too(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        writer.write(seen(contact=1.0, position=0.3, force=0.5, slip=1.0, slip_velocity=0.01, settled=0.0))
    line = capsys.readouterr().out
    assert "; truth position 300.0 mm, force 0.50 N, slides 10.0 mm/s, settling; level" in line


def test_standard_error_on_request(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal(stderr=True).open(Run(signal=SIGNAL)) as writer:
        writer.write(moment(0))
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "227.5 mm" in captured.err


def learned(**given: tuple[float, float] | str) -> Moment:
    """Return a moment of what a model tells; a text is a reason for telling nothing."""
    units = {"position": "m", "force": "N"}
    estimates = {
        name: Estimate.abstain(units.get(name, ""), pair)
        if isinstance(pair, str)
        else Estimate(value=pair[0], std=pair[1], unit=units.get(name, ""))
        for name, pair in given.items()
    }
    shown = moment(0)
    return dataclasses.replace(shown, prediction=dataclasses.replace(shown.prediction, estimates=estimates))


def rows_of(shown: Moment, columns: int) -> dict[str, str]:
    """Return the rows of the estimates by their first word."""
    lines = _view.frame(shown, SIGNAL, 0.2, Histogram().percentiles(), columns, 24)
    assert len(lines) < 24
    plain = [line.plain for line in lines]
    names = ("contact", "position", "force", "slip")
    lines = {name: line for line in plain for name in names if line.split()[:1] == [name]}
    assert all(len(line) <= columns for line in lines.values())
    return lines


TOUCH = {"contact": 1.0, "position": 0.15, "force": 0.5, "slip": 0.0}


@pytest.mark.parametrize("columns", [60, 80, 110])
def test_each_estimate_lies_on_its_track_beside_the_truth(columns: int) -> None:
    given = {"contact": (0.998, 0.04), "slip": (0.03, 0.17), "position": (0.1, 0.02), "force": (0.5, 0.001)}
    shown = dataclasses.replace(learned(**given), truth=TOUCH)
    rows = rows_of(shown, columns)
    assert [*rows] == ["contact", "position", "force", "slip"]
    for name, words in {
        "contact": "touched  99.8 %",
        "position": "100.0 mm  ± 20.0 mm",
        "force": "0.50 N",
        "slip": "rests  97 %",
    }.items():
        assert words in rows[name]
    assert "truth  150.0 mm" in rows["position"]
    assert "truth     rests" in rows["slip"]
    if columns < 72:
        return  # figures go before pictures
    track = re.search(r"[─━●◆◉]{8,}", rows["position"])
    assert track
    cells = track[0]
    assert cells.index("●") == pytest.approx(0.5 * (len(cells) - 1), abs=0.6)
    assert cells.index("◆") == pytest.approx(0.75 * (len(cells) - 1), abs=0.6)
    assert cells.count("━") + 1 == pytest.approx(0.2 * len(cells), abs=1.6)
    assert "◉" in rows["force"]
    assert "●" not in rows["force"]


def test_an_abstention_has_a_reason_and_the_truth_on_its_track() -> None:
    given = {"contact": (0.02, 0.1), "slip": "no contact", "position": "too unsure", "force": "no contact"}
    rows = rows_of(dataclasses.replace(learned(**given), truth=TOUCH), 80)
    assert "untouched  98 %" in rows["contact"]
    assert "--  too unsure" in rows["position"]
    assert "◆" in rows["position"]
    assert "●" not in rows["position"]
    free = rows_of(dataclasses.replace(learned(**given), truth={"contact": 0.0}), 80)
    assert "truth untouched" in free["contact"]
    assert "truth" not in free["force"]
    assert "◆" not in free["force"]
    nothing_known = rows_of(learned(**given), 80)
    assert not any("truth" in row or "◆" in row for row in nothing_known.values())


@pytest.mark.parametrize("truth", [{}, TOUCH])
def test_a_long_reason_takes_the_place_of_its_track(truth: dict[str, float]) -> None:
    shown = learned(contact=(0.998, 0.04), position="one driver seems silent", force=(0.5, 0.1))
    rows = rows_of(dataclasses.replace(shown, truth=truth), 80)
    assert "─" in rows["force"]
    assert rows["position"].rstrip().endswith("truth  150.0 mm" if truth else "--  one driver seems silent")
    if truth:
        assert rows["position"].index("truth") == rows["force"].index("truth")


def test_no_certainty_is_made_of_a_probability(capsys: pytest.CaptureFixture[str]) -> None:
    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        writer.write(learned(contact=(0.99996, 0.006), slip=(0.4, 0.5), force="too unsure"))
    line = capsys.readouterr().out
    assert "touched (99.9 %), no force (too unsure), rests (60 %)" in line


def test_a_low_terminal_has_no_blanks_and_all_four() -> None:
    given = {"contact": (0.998, 0.04), "slip": (0.03, 0.17), "position": (0.1, 0.02), "force": (0.5, 0.001)}
    for height, legend in ((20, True), (19, False), (24, True)):
        lines = _view.frame(learned(**given), SIGNAL, 0.2, Histogram().percentiles(), 80, height)
        plain = [line.plain.split()[:1] for line in lines]
        assert len(lines) < height
        assert all([name] in plain for name in ("contact", "position", "force", "slip", "mic", "stream"))
        assert (["●"] in plain) == legend
        assert any(not line.plain for line in lines) == (height == 24)


def note(finding: Finding, since: float = 0.0, key: str = "") -> Note:
    return Note(
        key=key or finding.sentence,
        level=finding.level,
        sentence=finding.sentence,
        remedy=finding.remedy,
        since=since,
    )


SILENT, DEAD, CLIPPING, PITCH = map(note, (health.SILENT, health.DEAD[1], health.CLIPPING, health.PITCH))


def noted(*notes: Note, time: float = 1.0, string: str = "", events: tuple[Event, ...] = ()) -> Moment:
    """Return a moment of a model with notes."""
    shown = learned(contact=(0.998, 0.04), slip=(0.03, 0.17), position=(0.1, 0.02), force=(0.5, 0.001))
    prediction = dataclasses.replace(shown.prediction, time=time)
    return dataclasses.replace(shown, prediction=prediction, notes=notes, string=string, events=events)


def text_of(shown: Moment, columns: int, rows: int, last: Event | None = None) -> str:
    """Return all words of the frame, after its height was looked at."""
    lines = _view.frame(shown, SIGNAL, 0.2, Histogram().percentiles(), columns, rows, last=last)
    assert len(lines) < rows
    return " ".join(" ".join(line.plain for line in lines).split())


@pytest.mark.parametrize(
    ("columns", "rows"), [(110, 60), (80, 24), (80, 20), (72, 19), (60, 15), (60, 10), (40, 7), (24, 24)]
)
def test_an_error_is_read_whole_with_what_to_do(columns: int, rows: int) -> None:
    text = text_of(noted(CLIPPING, PITCH, DEAD), columns, rows)
    assert f"error {DEAD.sentence} {DEAD.remedy}" in text
    if rows >= 24 and columns >= 60:
        assert f"warning {CLIPPING.sentence} {CLIPPING.remedy}" in text
        assert text.index("error") < text.index("warning")


@pytest.mark.parametrize("rows", range(2, 40))
def test_no_frame_is_higher_than_its_terminal(rows: int) -> None:
    touch = Event(name="contact", on=True, time=0.9, delay=0.03, confidence=0.9)
    assert "error" in text_of(noted(SILENT, DEAD, CLIPPING, PITCH), 80, rows, touch)


@pytest.mark.parametrize("columns", range(24, 111, 7))
def test_a_note_is_wrapped_within_the_width(columns: int) -> None:
    for each in (SILENT, DEAD, CLIPPING, PITCH):
        lines = [line.plain for line in _notes.wrapped(each, columns)]
        assert max(map(len, lines)) < columns
        assert " ".join(" ".join(lines).split()).endswith(f" {each.sentence} {each.remedy}")


def test_what_is_left_out_first_is_what_matters_least() -> None:
    quiet, ill = noted(), noted(SILENT, DEAD, CLIPPING)
    assert "● estimate" in text_of(quiet, 80, 24)
    text = text_of(ill, 80, 24)
    assert "● estimate" not in text
    assert f"warning {CLIPPING.sentence} Turn the gain of the preamplifier down until…" in text
    assert all(part in text for part in (SILENT.remedy, DEAD.remedy, "position", "mic 2", "latency", "gaps"))
    text = text_of(ill, 80, 19)
    assert all(part in text for part in (SILENT.remedy, DEAD.remedy, "position", "bridge"))
    assert "clipped" not in text
    assert "latency" not in text


def test_a_brief_info_is_not_shown_and_one_that_lasts_is() -> None:
    settling = note(health.SETTLING, since=1.0)
    assert "settling" not in text_of(noted(settling, time=1.05), 80, 40)
    assert f"note {PITCH.sentence} {PITCH.remedy}" in text_of(noted(PITCH, time=0.5), 80, 40)


def test_a_quiet_sensor_has_no_line_for_notes_or_events() -> None:
    lines = _view.frame(noted(), SIGNAL, 0.2, Histogram().percentiles(), 80, 60)
    begins = {line.plain.split()[0] for line in lines if line.plain.strip()}
    assert {"position", "mic", "stream"} <= begins
    assert not begins & {"error", "warning", "note", "event", "tracked"}


def test_what_is_tracked_stands_with_the_last_event_where_there_is_room() -> None:
    touch = Event(name="contact", on=True, time=12.34, delay=0.03, confidence=0.978)
    shown = dataclasses.replace(
        noted(),
        decided={"contact": True, "slip": True},
        tracked={
            "contact": Estimate(value=0.97, std=0.2, unit=""),
            "position": Estimate(value=0.1002, std=3e-4, unit="m"),
            "force": Estimate.abstain("N", "gap"),
        },
    )
    said = "event touched at 12.34 s, decided 30 ms later, 98 %"
    text = text_of(shown, 80, 40, touch)
    assert f"tracked touched, 100.2 mm ± 0.30 mm, slides {said}" in text
    assert said in text_of(shown, 80, 24, touch)
    free = dataclasses.replace(shown, decided={"contact": False}, tracked={})
    assert "tracked untouched event" in text_of(free, 80, 40, touch)


def test_a_note_cannot_control_the_terminal() -> None:
    evil = note(Finding(level="error", sentence="Off:\x1b[2J\nit went.", remedy="\x1b[31mRun."))
    text = text_of(noted(evil), 80, 24)
    assert "Off:\\u001b[2J it went. \\u001b[31mRun." in text
    assert "\x1b" not in text


@pytest.mark.parametrize("rows", [24, 7, 5, 4])
def test_of_several_strings_each_has_a_line_and_its_worst_note(rows: int) -> None:
    strings = {"left": (PITCH, DEAD), "middle": (), "right": (PITCH, CLIPPING)}
    moments = [noted(*notes, string=name) for name, notes in strings.items()]
    lines = [line.plain for line in _view.several(moments, Histogram().percentiles(), 300, rows)]
    errors = [line for line in lines if line == f"left  error  {DEAD.sentence} {DEAD.remedy}"]
    warnings = [line for line in lines if line == f"right  warning  {CLIPPING.sentence} {CLIPPING.remedy}"]
    shown = [line.split()[0] for line in lines if "position 100.0 mm" in line]
    assert len(lines) < rows
    assert len(errors) == 1
    assert len(warnings) == (rows > 5)
    assert shown == (["left"] if rows >= 5 else []) + ["middle", "right"]
    assert not any(PITCH.sentence in line for line in lines)


def test_of_several_strings_a_note_is_clipped_to_the_width() -> None:
    lines = _view.several([noted(DEAD, string="left")], Histogram().percentiles(), 60, 24)
    assert lines[1].plain.startswith(f"left  error  {DEAD.sentence}")
    assert len(lines[1]) == 60


def test_a_log_has_a_line_where_a_note_begins_and_one_where_it_ends(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lost = Finding(level="warning", sentence="Sound was lost: 1 gap.", remedy="Close others.")
    more = dataclasses.replace(lost, sentence="Sound was lost: 2 gaps.")
    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        for k, notes in enumerate(
            (
                (),
                (DEAD,),
                (DEAD,),
                (DEAD, note(lost, 0.03, "lost")),
                (DEAD, note(more, 0.03, "lost")),
                (note(more, 0.03, "lost"),),
                (),
                (note(health.SETTLING, 0.07),),
            )
        ):
            writer.write(noted(*notes, time=k / 100))
    first, *rest, last = capsys.readouterr().out.splitlines()
    assert "0.00 s  touched" in first
    assert rest == [
        f"    0.01 s  error: {DEAD.sentence} {DEAD.remedy}",
        "    0.03 s  warning: Sound was lost: 1 gap. Close others.",
        f"    0.05 s  ended: {DEAD.sentence}",
        "    0.06 s  ended: Sound was lost: 2 gaps.",
    ]
    assert "0.07 s  touched" in last


def test_a_note_that_becomes_worse_is_news_and_strings_are_told_apart(
    capsys: pytest.CaptureFixture[str],
) -> None:
    mild = note(Finding(level="info", sentence="It sounds higher.", remedy="Tune."), key="detuned")
    bad = note(Finding(level="error", sentence="It sounds far off.", remedy="Tune."), key="detuned")
    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        for worse in (mild, bad):
            for string, notes in (("left", (worse,)), ("right", ())):
                writer.write(noted(*notes, string=string))
    lines = [line for line in capsys.readouterr().out.splitlines() if "It sounds" in line]
    assert lines == [
        "left      1.00 s  note: It sounds higher. Tune.",
        "left      1.00 s  error: It sounds far off. Tune.",
    ]


def test_a_log_has_events_in_its_line_however_many_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    def event(k: int, name: str = "contact") -> Event:
        return Event(name=name, on=k % 2 == 0, time=k / 10, delay=0.03, confidence=0.978)

    with Terminal(plain=True).open(Run(signal=SIGNAL)) as writer:
        writer.write(noted(events=(event(0), event(2, "slip"))))
        for k in range(1, 20):
            writer.write(noted(events=(event(k),)))
    first, last = capsys.readouterr().out.splitlines()
    assert first.endswith("skipped 2; touched at 0.00 s (98 %), slides at 0.20 s (98 %)")
    expected = (
        "19 events, the last: untouched at 1.70 s (98 %), touched at 1.80 s (98 %), untouched at 1.90 s"
    )
    assert last.endswith(f"; {expected} (98 %)")
