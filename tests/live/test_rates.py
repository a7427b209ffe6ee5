"""A model on sound at a higher rate than its training's: the same answers, live, replayed and resampled."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.twins import sound_of

import monochord as mc
from monochord.capture.recording import record
from monochord.capture.recording.settings import RecordingJob
from monochord.capture.sources.wav import Wav
from monochord.cli import run
from monochord.perception.estimators.model import ModelEstimator
from monochord.sessions import read_session
from monochord.sessions.resample import resample

PLACE, FORCE = 0.08, 1.0


def take(rate: int) -> tuple[Any, np.ndarray]:
    """Sound of one build at a rate, untouched and then touched; and the position at each frame."""
    twin = mc.VirtualSensor("prototype", seed=1, sample_rate=rate)
    sound, truth = sound_of(twin, 1.0, (PLACE, FORCE), 1.0, material="plastic")
    return sound, np.where(np.arange(sound.shape[1]) < rate, np.nan, truth["position"])


def answers(source: Any, **options: Any) -> list[tuple[float, dict[str, tuple[float, float, str]]]]:
    """Time and estimates of each window; NaN as text, so that equal ones compare as equal."""
    return [
        (
            update.time,
            {name: (str(e.value), str(e.std), e.reason) for name, e in update.prediction.estimates.items()},  # pyright: ignore[reportReturnType]
        )
        for update in mc.listen(source, sensor="prototype", **options)
    ]


@pytest.mark.parametrize("rate", [44100, 48000, 192000])
def test_it_answers_at_any_rate_as_at_its_own(rate: int) -> None:
    sound, where = take(rate)
    errors, windows = list[float](), 0
    for update in mc.listen(sound, sample_rate=rate, sensor="prototype"):
        assert update.window.samples.shape == (2, 4410)
        start = round(update.time * rate)
        if np.isfinite(where[start]) and update.time > 1.1:
            windows += 1
            errors.append(abs(update.position.value - PLACE))
    assert windows == 80
    assert np.isfinite(errors).all()
    assert np.median(errors) < 3e-4
    assert max(errors) < 2e-3


def test_a_loaded_model_answers_as_the_one_that_is_named() -> None:
    sound, _ = take(48000)
    named = answers(sound, sample_rate=48000, model="demo")
    assert len(named) == 191
    assert answers(sound, sample_rate=48000, model=mc.load("demo")) == named
    assert answers(sound, sample_rate=48000, model=ModelEstimator(path=Path("demo"))) == named


def test_a_recording_keeps_its_rate_and_its_replay_has_the_same_bits(tmp_path: Path) -> None:
    sound, _ = take(48000)
    soundfile.write(tmp_path / "take.wav", sound.T, 48000, subtype="FLOAT")
    record(RecordingJob(path=tmp_path / "take.mcap", source=Wav(path=tmp_path / "take.wav")))
    session = read_session(tmp_path / "take.mcap")
    assert session.description.sample_rate == 48000
    np.testing.assert_array_equal(session.audio.samples, sound)
    live = answers(sound, sample_rate=48000)
    assert len(live) == 191
    assert answers(tmp_path / "take.mcap", block=77) == live
    resample(session, tmp_path / "usual.mcap", 44100)
    assert answers(tmp_path / "usual.mcap") == live
    table = mc.load("demo").predict(sound, sample_rate=48000, sensor="prototype")
    assert [str(value) for value in table.position.value] == [each["position"][0] for _, each in live]


def test_a_low_rate_is_refused_in_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    soundfile.write(tmp_path / "take.wav", np.zeros((32000, 2)), 32000)
    assert run(["locate", "demo", str(tmp_path / "take.wav")]) == 2
    assert "sound at 32000 Hz for a model: expected 44100 Hz" in capsys.readouterr().err
