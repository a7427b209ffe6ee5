"""Real recordings: which are listed, which windows are evaluated, and the errors measured on them."""

from pathlib import Path

import numpy as np
import pytest
import soundfile
from studies._takes import (
    Interferer,
    Protocol,
    Reference,
    located,
    open_note,
    period,
    position_errors,
    recorded_strings,
)

from monochord.core.errors import InputError
from monochord.core.types import Window
from monochord.evaluation import folder, interference_recordings, takes

real = pytest.mark.skipif(folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")
MANIFEST = """file,string,kind,x_over_L,f0_measured_hz
lute/b.wav,G,plucked,0.25,146.7
lute/a.wav,,slide,,
lute/c.wav,G,plucked,,110.0
"""


def test_takes_are_listed_filtered_and_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    assert folder() is None
    assert takes() == []
    (tmp_path / "lute").mkdir()
    soundfile.write(tmp_path / "lute" / "b.wav", np.zeros((100, 2)), 22050)
    (tmp_path / "manifest.csv").write_text(MANIFEST, encoding="utf-8")
    assert [take.path.stem for take in takes()] == ["a", "b", "c"]
    assert [take.path.stem for take in takes(kind="plucked")] == ["b", "c"]
    (take,) = takes(kind="plucked", labelled=True)
    assert (take.frequency, take.string_name) == (146.7, "lute G")
    assert take.position == pytest.approx(0.1625)
    samples, rate = take.read()
    assert (samples.shape, samples.dtype, rate) == ((2, 100), np.float32, 22050)


def test_without_recordings_the_error_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    recorded_strings.cache_clear()
    for load in (recorded_strings, interference_recordings):
        with pytest.raises(InputError, match="MONOCHORD_REALSTRINGS"):
            load()
    recorded_strings.cache_clear()


def test_windows_are_counted_from_the_onset_and_lie_in_the_take() -> None:
    take = np.zeros((1, 44100), np.float32)
    take[0, 1000:] = 1.0
    windows = Protocol(length=0.1, first=0.15, last=0.6, hop=0.1).windows(take, take, 44100)
    assert [window.start for window in windows] == [1000 + round(s * 44100) for s in (0.15, 0.25, 0.35, 0.45)]
    assert all(window.samples.shape == (1, 4410) for window in windows)
    assert Protocol().windows(take[:, 900:1900], take[:, 900:1900], 44100) == []


@pytest.mark.parametrize("frequency", [82.4, 196.0, 440.0, 1000.0])
def test_autocorrelation_returns_the_period_of_a_harmonic_tone(frequency: float) -> None:
    time = np.arange(4410) / 44100
    tone = sum(np.sin(2 * np.pi * n * frequency * time) / n for n in range(1, 8))
    window = Window(samples=np.atleast_2d(tone).astype(np.float32), start=0, sample_rate=44100)
    assert 44100 / period(window, 44100 / 1600, 44100 / 80) == pytest.approx(frequency, rel=2e-3)


@real
def test_an_open_note_is_measured_from_its_audio() -> None:
    for take in recorded_strings().open_notes.values():
        ((frequency, position, stiffness),) = open_note(take, Protocol())
        assert position == 0.0
        assert frequency == pytest.approx(take.frequency, rel=2e-3)
        assert 0.0 <= stiffness < 5e-4


@real
def test_errors_are_estimate_minus_truth() -> None:
    strings = recorded_strings()
    take = strings.fretted["green_plucked B3"][-1]
    note = open_note(strings.open_notes["green_plucked B3"], Protocol())
    estimates = located(take, note, Protocol())
    errors = position_errors(take, estimates)
    assert errors[0] == pytest.approx(estimates[0]["position"].value - take.position)


@pytest.mark.parametrize("per", ["window", "take"])
def test_interference_has_the_stated_ratio(per: Reference) -> None:
    rng = np.random.default_rng(0)
    decay = np.exp(-3.0 * np.arange(66150) / 44100)
    take = (decay * rng.standard_normal(66150)).astype(np.float32)[np.newaxis]
    sound = rng.standard_normal(88200).astype(np.float32)
    noise = Interferer(sound=sound, ratio=10.0, per=per).mixer(0.3, Protocol())(take) - take
    for start in (6615, 30870, 55125) if per == "window" else (0,):
        stop = start + 4410 if per == "window" else 66150
        ratio = np.mean(take[:, start:stop] ** 2) / np.mean(noise[:, start:stop] ** 2)
        assert 10.0 * np.log10(ratio) == pytest.approx(10.0, abs=0.7)


def test_a_short_recording_is_repeated() -> None:
    take = np.ones((2, 1000), np.float32)
    mixed = Interferer(sound=np.ones(300, np.float32), ratio=0.0, per="take").mixer(0.5, Protocol())(take)
    np.testing.assert_array_equal(mixed, np.full((2, 1000), 2.0))
