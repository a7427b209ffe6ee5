"""`monochord locate` and `mc.locate`, as who has a guitar uses them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, records, refusal

import monochord as mc
from monochord.cli import run
from monochord.core.types import Audio
from monochord.figures import base
from monochord.front.locate_figure import draw

RATE, LENGTH = 44100, 0.65
HOLD = "groups=[{name='hold', sessions=1, grid=[1, 1], forces=[0.4, 1.4], hold=0.3}]"
Write = Callable[..., Path]


def plucked(*notes: float, seconds: float = 0.5, silence: float = 0.0) -> Audio:
    """Return notes of a steel string, one after the other, each for some seconds, and silence after it."""
    t = np.arange(round(seconds * RATE)) / RATE
    parts: list[np.ndarray] = []
    for frequency in notes:
        sound = 1e-5 * np.random.default_rng(round(frequency)).standard_normal(t.size)
        for n in range(1, 15):
            partial = n * frequency * np.sqrt(1.0 + 8e-5 * n * n)
            sound += 0.2 / n * np.exp(-(0.5 + 0.3 * n) * t) * np.sin(2.0 * np.pi * partial * t + n)
        parts += [sound, np.zeros(round(silence * RATE))]
    return np.concatenate(parts).astype(np.float32)


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return what writes a sound under a name, in the format of the suffix."""

    def written(name: str, sound: Audio) -> Path:
        soundfile.write(tmp_path / name, sound.T, RATE)
        return tmp_path / name

    return written


def text(capsys: Capture, *words: object) -> str:
    capsys.readouterr()
    assert run(["locate", *map(str, words)]) == 0
    return capsys.readouterr().out


E = 2.0 ** (5 / 12) * 110.0
"""D3, the fifth fret of an A string, in Hz."""


@pytest.mark.parametrize("name", ["a.wav", "a.flac", "a.mp3", "a.ogg", "a.aiff", "a.au", "a.caf"])
def test_every_format_of_the_library_is_located(name: str, write: Write, capsys: Capture) -> None:
    path = write(name, plucked(E))
    unnamed = path.rename(path.with_name("take"))  # the content tells
    rows = records(capsys, "locate", unnamed, "--length", LENGTH, "--open", "A2")
    places = [row["position"] for row in rows if row["valid"]]
    assert len(places) >= 10  # what mp3 does to partials is not all a string would
    assert np.median(places) == pytest.approx(LENGTH * (1.0 - 110.0 / E), abs=2e-3)


@pytest.mark.parametrize(
    ("begin", "kind"),
    [(b"\0\0\0\x20ftypM4A ", "m4a"), (b"\xff\xf1\x50\x80", "AAC"), (b"\x1a\x45\xdf\xa3", "webm")],
)
def test_what_phones_record_comes_with_the_line_that_converts_it(
    begin: bytes, kind: str, tmp_path: Path, capsys: Capture
) -> None:
    path = tmp_path / "my take.m4a"
    path.write_bytes(begin + bytes(4000))
    line = refusal(capsys, "locate", path, "--length", LENGTH, "--open", "A2")
    assert kind in line
    assert "wav, flac, mp3, ogg, aiff" in line
    assert line.endswith(f"ffmpeg -i '{path}' '{path.with_suffix('.wav')}'")


@pytest.mark.parametrize(
    ("option", "note"), [("--open", "B♭2-100"), ("--open", "110"), ("--open-frequency", "G##2")]
)
def test_the_open_note_has_a_name_or_a_frequency(
    option: str, note: str, write: Write, capsys: Capture
) -> None:
    rows = records(
        capsys, "locate", write("a.wav", plucked(E, seconds=0.2)), "--length", LENGTH, option, note
    )
    assert rows[5]["position"] == pytest.approx(LENGTH * (1.0 - 110.0 / E), abs=1e-3)


def test_frets_and_notes_stand_beside_millimetres(write: Write, capsys: Capture) -> None:
    frets = (0, 3, 12)
    path = write("riff.ogg", plucked(*(110.0 * 2.0 ** (fret / 12.0) for fret in frets), silence=0.3))
    printed = text(capsys, path, "--length", LENGTH, "--open", "A2", "--frets")
    rows = printed.partition("position\n")[2].splitlines()[-3:]
    for row, fret, note in zip(rows, frets, ("A2", "C3", "A3"), strict=True):
        cells = row.split()
        assert (float(cells[4]), cells[5][:2]) == (fret, note)
        assert float(cells[6]) == pytest.approx(1e3 * LENGTH * (1.0 - 2.0 ** (-fret / 12.0)), abs=2.0)
    lines = records(capsys, "locate", path, "--length", LENGTH, "--open", "A2", "--frets")
    for line in (line for line in lines if line["valid"]):
        off = [line["position"] - LENGTH * (1.0 - 2.0 ** (-fret / 12.0)) for fret in frets]
        assert min(map(abs, off)) < 3.0 * line["position_std"]
        if line["time"] % 0.8 < 0.39:  # a window that holds the end of a note may be beside it
            assert min(abs(line["fret"] - fret) for fret in frets) < 0.15
    assert sum(line["valid"] for line in lines) > 120
    assert all((line["note"] is not None) == line["valid"] for line in lines)


@pytest.mark.xfail(raises=AssertionError, reason="five, two of them at the end of a note: docs/ROADMAP.md")
def test_at_most_three_windows_of_a_riff_are_between_its_frets(write: Write, capsys: Capture) -> None:
    frets = (0, 3, 12)
    path = write("riff.ogg", plucked(*(110.0 * 2.0 ** (fret / 12.0) for fret in frets), silence=0.3))
    lines = records(capsys, "locate", path, "--length", LENGTH, "--open", "A2", "--frets")
    told = [line["fret"] for line in lines if line["valid"]]
    near = [min(abs(fret - each) for each in frets) < 0.15 for fret in told]
    assert sum(near) >= len(near) - 3


def test_reasons_are_grouped_by_kind_with_their_share(write: Write, capsys: Capture) -> None:
    # A note outside the range, whose frequency differs from window to window; then silence.
    t = np.arange(RATE) / RATE
    sweep = sum(np.sin(2 * np.pi * n * (700.0 * t + 2.0 * t * t)) / n for n in range(1, 9))
    sound = np.concatenate([0.1 * np.asarray(sweep), np.zeros(RATE // 2)]).astype(np.float32)
    path = write("sweep.wav", sound)
    reasons = [
        line
        for line in text(capsys, path, "--length", LENGTH, "--open", "E2").splitlines()
        if "no pos" in line
    ]
    assert len({row.reason for row in mc.locate(path, length=LENGTH, open="E2")}) > 20
    assert len(reasons) <= 5
    shares = [float(line.split("%")[0].split()[-1]) for line in reasons]
    assert shares == sorted(shares, reverse=True)
    assert sum(shares) == pytest.approx(100.0, abs=0.5)
    assert any(line.endswith("silence") for line in reasons)
    assert not any("700" in line or "701" in line for line in reasons)


def test_another_strings_sound_is_asked_about_first(write: Write, capsys: Capture) -> None:
    path = write("high.wav", plucked(440.0))
    line = text(capsys, path, "--length", LENGTH, "--open", "E1").splitlines()[1]
    assert "not this string?" in line
    assert "A4" in line
    assert "E1" in line
    assert "not this string?" not in text(capsys, path, "--length", LENGTH, "--open", "E4")
    rest = write("pause.wav", plucked(440.0, seconds=0.2, silence=3.0))
    assert "not this string?" not in text(capsys, rest, "--length", LENGTH, "--open", "E4")


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_the_figure_shows_places_and_frets(
    suffix: str, write: Write, tmp_path: Path, capsys: Capture
) -> None:
    path, figure = write("a.wav", plucked(E)), tmp_path / f"places.{suffix}"
    printed = text(capsys, path, "--length", LENGTH, "--open", "A2", "--frets", "--figure", figure)
    assert printed.endswith(f"written to {figure}\n")
    assert figure.stat().st_size > 5000
    (axes,) = draw(mc.locate(path, length=LENGTH, open="A2"), frets=True).axes
    names = [text.get_text().split() for text in axes.texts]
    assert ["5", "D3"] in names
    heights = {height for line in axes.lines for height in np.unique(np.asarray(line.get_ydata(), float))}
    assert min(abs(height - 1e3 * LENGTH * (1.0 - 110.0 / E)) for height in heights) < 0.1


def test_the_figure_of_simulated_sound_says_so(tmp_path: Path, capsys: Capture) -> None:
    sound = mc.simulate("appendix", position=0.2275, seconds=0.3).microphones
    (real,) = draw(mc.locate(sound, sample_rate=RATE, string="appendix")).axes
    assert "simulated" not in real.get_title()  # nothing says where an array comes from
    (session,) = mc.collect("quick", tmp_path, only="hold_000", settings=[HOLD], workers=1)
    (simulated,) = draw(mc.locate(session.path)).axes
    assert simulated.get_title().startswith("simulated")


def test_without_matplotlib_a_figure_is_refused_before_the_sound_is_read(
    write: Write, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setattr(base, "find_spec", lambda _: None)
    path = write("a.wav", plucked(E))
    line = refusal(capsys, "locate", path, "--length", LENGTH, "--open", "A2", "--figure", "a.png")
    assert line.endswith("pip install 'matplotlib>=3.9'")


def test_the_function_and_the_command_give_the_same(write: Write, capsys: Capture) -> None:
    path = write("a.flac", plucked(E, silence=0.2))
    printed = records(capsys, "locate", path, "--length", LENGTH, "--open", "A2", "--frets")
    places = mc.locate(path, length=LENGTH, open=110.0)
    assert [place.tree(frets=True) for place in places] == printed
    samples, _ = soundfile.read(path, dtype="float32")
    of_array = mc.locate(samples, sample_rate=RATE, length=LENGTH, open="A2")
    assert [place.tree(frets=True) for place in of_array] == printed
    seen: list[str] = []
    mc.locate(path, length=LENGTH, open=110.0, each=lambda place: seen.append(place.reason))
    assert seen == places.reason.tolist()


def test_a_table_has_a_row_for_each_window() -> None:
    places = mc.locate(plucked(E, silence=0.3), sample_rate=RATE, length=LENGTH, open="A2")
    rows = list(places)
    assert len(rows) == len(places) == len(places.position) == 71
    answered = [row for row in rows if not row.reason]
    assert {row.reason for row in rows[-10:]} == {"silence"}
    assert np.isnan(rows[-1].position)
    assert rows[-1].note == ""
    for row in answered[:20]:
        assert row.fret == pytest.approx(5.0, abs=0.05)
        assert row.note.startswith("D3")
        assert 0.0 < row.std < 0.01
    assert repr(places).count("\n") < 3
    assert "mm from the nut" in repr(places)
    pytest.importorskip("pandas")
    frame = places.to_pandas()
    assert list(frame) == ["position", "std", "frequency", "fret", "note", "reason"]
    assert frame["note"].tolist() == [row.note for row in rows]


def test_a_note_begins_where_the_one_before_it_ends() -> None:
    """Windows of 0.1 s hold both."""
    places = mc.locate(plucked(E, 2.0 ** (2 / 12) * E), sample_rate=RATE, length=LENGTH, open="A2")
    first, second = places.held_notes()
    assert (round(first.fret), round(second.fret)) == (5, 7)
    assert first.end == second.begin == pytest.approx(0.5, abs=0.06)


def test_a_harmonic_or_a_bend_is_spoken_of(write: Write, capsys: Capture) -> None:
    printed = text(capsys, write("a.wav", plucked(330.0)), "--length", LENGTH, "--open", "A2")
    assert "harmonic" in printed
    assert "bend" in printed


def test_frets_are_of_a_stopped_string(write: Write, capsys: Capture) -> None:
    path = write("a.wav", plucked(E))
    assert "--frets" in refusal(capsys, "locate", "demo", path, "--sensor", "prototype", "--frets")
