"""Whatever is handed in: one line on stderr with status 2, or windows that abstain; never a traceback."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.cli import run
from monochord.core.types import Floats

STRING = ["--length", "0.65", "--open-frequency", "110"]
RATE = 44100
TONE = 0.3 * np.sin(2 * np.pi * 165.0 * np.arange(RATE) / RATE) + 0.1 * np.sin(
    2 * np.pi * 330.0 * np.arange(RATE) / RATE
)


def sound(samples: Floats, rate: int = RATE, name: str = "take.wav") -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        soundfile.write(folder / name, samples, rate, subtype="PCM_24" if name.endswith("flac") else "FLOAT")
        return folder / name

    return write


def content(data: bytes, name: str = "take.wav") -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return write


def cut(name: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        path = sound(np.random.default_rng(0).uniform(-0.5, 0.5, RATE), name=name)(folder)
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        return path

    return write


def missing(folder: Path) -> Path:
    return folder / "missing.wav"


def directory(folder: Path) -> Path:
    return folder


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "missing": (missing, "missing.wav"),
    "a folder": (directory, "folder"),
    "empty": (content(b""), "empty"),
    "no frames": (sound(np.zeros(0)), "take.wav"),
    "text": (content(b"this is not sound\n" * 100), "take.wav"),
    "text called flac": (content(b"this is not sound\n" * 100, "take.flac"), "take.flac"),
    "a header alone": (content(b"RIFF\x24\x00\x00\x00WAVEfmt "), "take.wav"),
    "8 kHz": (sound(TONE, 8000), "8000 Hz|8 kHz"),
    "192 kHz": (sound(TONE, 192000), "192000 Hz|192 kHz"),
    "three channels": (sound(np.stack([TONE] * 3, axis=1)), "3 channels"),
    "truncated wav": (cut("take.wav"), "take.wav"),
    "truncated flac": (cut("take.flac"), "take.flac"),
    "shorter than a window": (sound(TONE[:1000]), "shorter than a window"),
}
ABSTAINED: dict[str, Callable[[Path], Path]] = {
    "NaN": sound(np.full(RATE, np.nan)),
    "infinite": sound(np.full(RATE, np.inf)),
    "one NaN a window": sound(np.where(np.arange(RATE) % 400 == 0, np.nan, TONE)),
    "all zero": sound(np.zeros(RATE)),
    "constant": sound(np.full(RATE, 0.5)),
    "white noise": sound(np.random.default_rng(1).standard_normal(RATE) * 0.1),
}


@pytest.mark.parametrize("command", ["locate", "live"])
@pytest.mark.parametrize("case", REFUSED)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(
    case: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, words = REFUSED[case]
    path = str(make(tmp_path))
    assert run([command, path, *STRING, "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("monochord: ")
    assert any(part in captured.err for part in words.split("|"))
    assert "allowed is" in captured.err


@pytest.mark.parametrize("case", ABSTAINED)
def test_sound_without_a_string_in_it_is_abstained_from(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["locate", str(ABSTAINED[case](tmp_path)), *STRING, "--json"]) == 0
    captured = capsys.readouterr()
    lines = [json.loads(line) for line in captured.out.splitlines()]
    assert captured.err == ""
    assert len(lines) == 91
    abstained = [line for line in lines if not line["valid"]]
    # Noise may look like a string once in a while; nothing else may.
    assert len(abstained) >= (80 if case == "white noise" else 91)
    for line in abstained:
        assert line["position"] is None
        assert line["why_not"]


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("case", ["clipped", "far too loud", "far too quiet"])
def test_one_microphone_is_enough_and_any_level_is_borne(
    case: str, channels: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = {
        "clipped": np.clip(5.0 * TONE, -1.0, 1.0),
        "far too loud": 1e30 * TONE,
        "far too quiet": 1e-9 * TONE,
    }
    samples = one[case] if channels == 1 else np.stack([one[case], one[case]], axis=1)
    assert run(["locate", str(sound(samples)(tmp_path)), *STRING, "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(lines) == 91
    for line in lines:
        assert not line["valid"] or abs(line["position"] - 0.65 * (1 - 110 / 165)) < 2e-3


def test_no_jack_server_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("JACK_DEFAULT_SERVER", "monochord-test-no-such-server")
    assert run(["live", "--source", "jack", *STRING, "--seconds", "1"]) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "jackd" in captured.err
