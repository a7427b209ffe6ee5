"""Two channels that are not two microphones: said in one line, and read as what they are, or not at all."""

import json
from collections import Counter
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import soundfile
import soxr
from tests.twins import sound_of

import monochord as mc
from monochord.capture.recording import record
from monochord.capture.recording.settings import RecordingJob
from monochord.capture.sources.wav import Wav
from monochord.cli import run
from monochord.core.inputs import Inputs
from monochord.core.types import Audio, Floats

RATE = 44100
STRING = ["--length", "0.65", "--open-frequency", "110"]
ONE = Inputs.SAME.value


@pytest.fixture(scope="module")
def sensor() -> tuple[Audio, Floats]:
    """Sound of a sensor, untouched and touched in turn, with the truth of contact."""
    twin = mc.VirtualSensor("prototype", seed=1, build=77, world="plausible")
    steps = (3.0, (0.08, 1.0), 1.0, None, 0.8, (0.12, 0.6), 1.0, None, 0.8)
    sound, truth = sound_of(twin, *steps, material="plastic")
    return sound, truth["contact"]


def note(seconds: float = 1.0) -> Floats:
    """A stopped guitar string of 147 Hz."""
    time = np.arange(round(seconds * RATE)) / RATE
    partials = [
        np.sin(2.0 * np.pi * k * 146.832 * np.sqrt(1.0 + 5e-5 * k * k) * time + k) * np.exp(-time) / k
        for k in range(1, 14)
    ]
    return 0.1 * np.sum(partials, axis=0)


def located(path: Path, sound: Floats | Audio) -> list[tuple[object, object]]:
    soundfile.write(path, sound.T, RATE, subtype="PCM_24")
    with redirect_stdout(StringIO()) as out:
        assert run(["locate", str(path), *STRING, "--json"]) == 0
    lines = [json.loads(line) for line in out.getvalue().splitlines()]
    return [(line["position"], line["why_not"]) for line in lines]


@pytest.fixture(scope="module")
def mono(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[object, object]]:
    """What is located in the mono file of `note`."""
    return located(tmp_path_factory.mktemp("mono") / "mono.wav", note()[None])


@pytest.mark.parametrize(
    ("kind", "channel"),
    [("noise", 0), ("louder noise", 1), ("hum", 0), ("zero", 1), ("copy", 0), ("inverted copy", 1)],
)
def test_a_guitar_beside_an_unused_input_is_read_as_the_mono_file(
    mono: list[tuple[object, object]], tmp_path: Path, kind: str, channel: int
) -> None:
    alone, one, noise = mono, note(), np.random.default_rng(4).standard_normal(RATE)
    time = np.arange(RATE) / RATE
    other = {
        "noise": 3e-5 * noise,
        "louder noise": 1e-3 * noise,
        "hum": sum(0.01 / k * np.sin(2.0 * np.pi * 50.0 * k * time) for k in range(1, 6)) + 3e-5 * noise,
        "zero": 0.0 * noise,
        "copy": 0.25 * one,
        "inverted copy": -one,
    }[kind]
    assert sum(position is not None for position, _ in alone) > 0.9 * len(alone)
    both = located(tmp_path / "both.wav", np.stack((one, other) if channel == 0 else (other, one)))
    if "copy" in kind:  # believed after three looks
        both, alone = both[21:], alone[21:]
    assert [reason for _, reason in both] == [reason for _, reason in alone]
    if "copy" not in kind:
        assert both == alone
    elif channel == 0:  # the note began with both; which of two copies is read does not matter
        places = [[position for position, _ in each if position is not None] for each in (both, alone)]
        assert places[0] == pytest.approx(places[1], abs=1e-6)


@pytest.mark.parametrize("estimator", ["demo", "closed_form"])
def test_a_copy_of_one_microphone_is_never_answered(sensor: tuple[Audio, Floats], estimator: str) -> None:
    one = sensor[0].mean(axis=0)
    updates = list(mc.listen(np.stack((one, 0.7 * one)), estimator, sample_rate=RATE, sensor="prototype"))
    assert not any(update.position.valid for update in updates)
    late = [each.reason for update in updates[21:] for each in update.prediction.estimates.values()]
    assert {*late} == {ONE}
    said = {each.key for update in updates[60:] for each in update.notes}
    assert "one_microphone" in said


@pytest.mark.parametrize("estimator", ["demo", "closed_form"])
def test_an_unused_input_is_named_where_two_microphones_are_needed(
    sensor: tuple[Audio, Floats], estimator: str
) -> None:
    noise = np.random.default_rng(5).standard_normal(sensor[0].shape[1]).astype(np.float32)
    sound = np.stack((1e-3 * noise, sensor[0][1]))
    updates = list(mc.listen(sound, estimator, sample_rate=RATE, sensor="prototype"))
    assert not any(update.position.valid for update in updates)
    assert {update.position.reason for update in updates[5:]} == {Inputs.SECOND.value}
    assert "microphone_1_dead" in {each.key for each in updates[-1].notes}


def test_real_microphones_are_answered_without_a_note(sensor: tuple[Audio, Floats]) -> None:
    updates = list(mc.listen(sensor[0], sample_rate=RATE, sensor="prototype"))
    seen = {each.key for update in updates for each in update.notes}
    assert not seen & {"one_microphone", "unlike_inputs", "microphone_1_dead", "microphone_2_dead"}
    assert sum(update.position.valid for update in updates) > 150


@pytest.mark.parametrize("rates", [(44100, 48000), (48000, 44100)])
def test_channels_of_unlike_rates_are_named(sensor: tuple[Audio, Floats], rates: tuple[int, int]) -> None:
    other = soxr.resample(sensor[0][1], *rates)
    count = min(other.size, sensor[0].shape[1])
    sound = np.stack((sensor[0][0, :count], other[:count]))
    updates = list(mc.listen(sound, sample_rate=RATE, sensor="prototype"))
    assert "unlike_inputs" in {each.key for update in updates for each in update.notes}
    assert not any(update.position.valid for update in updates[25:])


@pytest.mark.parametrize("rates", [(44100, 48000), (48000, 44100)])
def test_after_a_change_of_rate_nothing_is_stated_until_the_untouched_string_was_heard(
    sensor: tuple[Audio, Floats], rates: tuple[int, int]
) -> None:
    sound, contact = sensor
    cut = 2 * RATE
    later = soxr.resample(sound[:, cut:].T, *rates).T
    whole = np.concatenate((sound[:, :cut], later), axis=1)
    index = (np.arange(later.shape[1]) * rates[0] / rates[1]).astype(int)
    truth = np.concatenate((contact[:cut], contact[cut:][np.minimum(index, contact.size - cut - 1)]))
    seen, notes = Counter[str](), set[str]()
    for update in mc.listen(whole, sample_rate=RATE, sensor="prototype"):
        start = update.prediction.start
        if start < cut:
            continue
        notes |= {each.key for each in update.notes}
        if not truth[start : start + 4410].any():
            seen["untouched"] += 1
            seen["told touched"] += update.contact.valid and update.contact.value > 0.5
        if truth[start : start + 4410].all():
            seen["touched"] += 1
            seen["placed"] += update.position.valid
            off = min(abs(update.position.value - place) for place in (0.08, 0.12))
            seen["wrong"] += update.position.valid and off > 5e-3
    assert seen["untouched"] > 100
    assert seen["told touched"] == 0
    assert seen["wrong"] == 0
    assert seen["placed"] > 0.4 * seen["touched"]
    assert "detuned" in notes


@pytest.mark.parametrize("rates", [(44100, 48000), (48000, 44100)])
def test_a_touch_that_is_held_over_a_change_of_rate_is_stated_no_more(rates: tuple[int, int]) -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    rest = twin.advance(1.2)[0]
    twin.press(0.08, 1.0)
    before, after = twin.advance(1.0)[0], soxr.resample(twin.advance(1.0)[0].T, *rates).T
    sound, cut = np.concatenate((rest, before, after), axis=1), rest.shape[1] + before.shape[1]
    updates = [*mc.listen(sound, sample_rate=RATE, sensor="prototype", model="demo", hop=0.05)]
    assert any(each.position.valid for each in updates if each.prediction.start < cut - 4410)
    late = [each for each in updates if each.prediction.start >= cut + 4410]
    assert late
    assert not any(each.position.valid or each.force.valid for each in late)


def test_one_line_says_it_wherever_sound_is_taken(
    sensor: tuple[Audio, Floats], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = sensor[0].mean(axis=0)
    soundfile.write(tmp_path / "mono.wav", np.stack((one, one), axis=1), RATE, subtype="PCM_16")
    assert run(["locate", "demo", str(tmp_path / "mono.wav"), "--sensor", "prototype"]) == 0
    assert "there is one microphone" in capsys.readouterr().out
    assert run(["sessions", "import", str(tmp_path / "mono.wav"), "--out", str(tmp_path / "in.mcap")]) == 0
    assert f"inputs       {ONE}" in capsys.readouterr().out
    job = RecordingJob(path=tmp_path / "out.mcap", source=Wav(path=tmp_path / "mono.wav", speed=2.0))
    summary = record(job)
    assert summary.inputs == ONE
    assert f"inputs  {ONE}" in summary.lines()
    assert dict(summary.flags) == {"one_microphone": 1}
    events = mc.read_session(tmp_path / "out.mcap").events
    assert f"audio: {ONE}" in [event.text for event in events]
    whole = RecordingJob(path=tmp_path / "two.mcap", source=Wav(path=_two(tmp_path, sensor[0]), speed=2.0))
    assert record(whole).inputs == ""


def _two(folder: Path, sound: Audio) -> Path:
    soundfile.write(folder / "two.wav", sound.T, RATE, subtype="PCM_24")
    return folder / "two.wav"
