"""Health: each trouble is said once it lasts, says what to do, and goes away with its cause."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import soundfile
import soxr

import monochord as mc
from monochord.capture.sources import SOURCES
from monochord.core import reasons
from monochord.core.inputs import Inputs
from monochord.core.reasons import ABSTAINING, Finding, Reason
from monochord.core.types import Audio, Estimate, Estimates, StreamHealth, Window
from monochord.live import LiveRun, health
from monochord.live.filter import FilterState
from monochord.live.health import HealthSettings, HealthState, Note
from monochord.live.loop import opened
from monochord.live.update import Update
from monochord.perception.estimators.model import ModelEstimator
from monochord.perception.model.faults import FAULTS
from monochord.perception.watching import Condition

RATE, SIZE, HOP = 44100, 4410, 441
TIME = np.arange(4 * RATE) / RATE
GOOD = Estimate(value=0.9, std=0.1, unit="")
OWN = {each: each.finding for each in Reason if each.finding and each.finding is not ABSTAINING}
"""The reasons with a finding of their own."""


def wave(frequency: float, level: float) -> Audio:
    return (level * np.sin(2.0 * np.pi * frequency * TIME)).astype(np.float32)


STRING = np.stack((wave(960.0, 0.2) + wave(1920.0, 0.02), wave(960.0, 0.15) - wave(1920.0, 0.02)))


def watched(
    sound: Audio,
    why_not: str = "",
    condition: Condition | None = None,
    streams: Sequence[StreamHealth] = (),
    skipped: Sequence[int] = (),
    state: HealthState | None = None,
    contact: Estimate | None = None,
    gap: slice = slice(0, 0),
) -> list[tuple[Note, ...]]:
    """Return the notes after each window of a sound; the windows of a slice have a gap."""
    state, notes = state or HealthState(), list[tuple[Note, ...]]()
    each = Estimate.abstain("", why_not) if why_not else GOOD
    estimates: Estimates = {"contact": contact or each, "position": each}
    for k, start in enumerate(range(0, sound.shape[1] - SIZE, HOP)):
        has_gap = k in range(*gap.indices(sound.shape[1]))
        samples = np.zeros_like(sound[:, :SIZE]) if has_gap else sound[:, start : start + SIZE]
        window = Window(samples=samples, start=start, sample_rate=RATE, has_gap=has_gap)
        stream = streams[min(k, len(streams) - 1)] if streams else StreamHealth()
        count = skipped[min(k, len(skipped) - 1)] if skipped else 0
        state, told = health.step(
            state, window, estimates, stream, count, FilterState(), condition, HealthSettings()
        )
        notes.append(told)
    return notes


def keys(notes: tuple[Note, ...]) -> list[str]:
    return [note.key for note in notes]


def clipped(sound: Audio) -> Audio:
    return np.clip(8.0 * sound, -1.0, 1.0).astype(np.float32)


@pytest.mark.parametrize(
    ("sound", "key"),
    [
        (0.0 * STRING, "silence"),
        (STRING * np.array([[0.0], [1.0]], np.float32), "microphone_1_dead"),
        (STRING * np.array([[1.0], [1e-4]], np.float32), "microphone_2_dead"),
        (clipped(STRING), "clipping"),
        (np.stack((clipped(STRING)[0], STRING[1])), "clipping"),
        (np.stack((STRING[0], clipped(STRING)[1])), "clipping"),
        (STRING + np.stack((wave(50.0, 0.5), wave(50.0, 0.5))), "hum"),
        (STRING + np.stack((wave(120.0, 0.5), wave(120.0, 0.0))), "hum"),
        (STRING * np.float32("nan"), "not_numbers"),
    ],
)
def test_what_levels_show_is_said_and_ends_with_its_cause(sound: Audio, key: str) -> None:
    notes = watched(np.concatenate([STRING[:, :RATE], sound[:, :RATE], STRING], axis=1))
    assert not notes[60]
    said = next(k for k, each in enumerate(notes) if each)
    assert 0.9 <= notes[said][0].since <= 1.21  # a microphone falls silent in three looks
    assert said * HOP / RATE >= notes[said][0].since + 0.5 - 1e-6
    assert key in keys(notes[185])
    assert not notes[-1]


@pytest.mark.parametrize("limit", [1.0, 0.985])
@pytest.mark.parametrize("rate", [RATE, 48000])
def test_clipping_is_said_at_any_rate_and_where_a_converter_limits_below_full_scale(
    rate: int, limit: float
) -> None:
    """Of a top that is cut off at another rate, no two samples are equal."""
    loud = soxr.resample(8.0 * STRING.T, RATE, rate)
    sound = soxr.resample(np.clip(loud, -limit, limit), rate, RATE).T.astype(np.float32)
    assert keys(watched(sound)[-1]) == ["clipping"]
    assert not any(watched((4.7 * STRING).astype(np.float32)))  # its peaks are 0.958
    single = STRING.copy()
    single[:, ::2205] = 1.0
    assert not any(watched(single))


def test_a_sound_string_has_no_notes_even_after_a_moment_of_trouble() -> None:
    assert not any(watched(STRING))
    sound = STRING.copy()
    sound[:, RATE : RATE + 4410] = 0.0
    assert not any(watched(sound))
    assert not any(watched(STRING[:1]))  # of one microphone


@pytest.mark.parametrize("reason", OWN)
def test_reasons_to_abstain_are_said_with_what_to_do(reason: Reason) -> None:
    finding, sound = OWN[reason], STRING[:, :RATE]
    notes = watched(sound, reason)[-1]
    assert [(note.key, note.since) for note in notes] == [(finding.key, 0.0)]
    assert notes[0].sentence == finding.sentence
    assert notes[0].remedy
    assert watched(sound, reason, contact=GOOD)[-1] == notes  # contact may be estimated all the same
    assert watched(sound, str(reason))[-1] == notes  # an estimator of another package says it as text


def test_every_fault_and_every_state_of_the_inputs_has_a_note() -> None:
    assert {fault.reason for fault in FAULTS.values()} <= OWN.keys()
    assert {each.reason for each in Inputs if each.reason} <= OWN.keys()


def test_keys_are_documented() -> None:
    page = (Path(__file__).parents[2] / "docs/how-to/sinks.md").read_text(encoding="utf-8")
    table = page[page.index("| key | level |") :].partition("\n\n")[0]
    documented = {key for row in table.splitlines() for key in re.findall(r"`(\w+)`", row.split("|")[1])}
    alone = [each for each in vars(reasons).values() if isinstance(each, Finding)]
    assert documented == {each.key for each in (*OWN.values(), *alone)} | {"SINK_closed"}


def test_a_reason_that_is_not_known_here_is_said_as_it_is() -> None:
    (note,) = watched(STRING, "a moth on the string")[-1]
    assert note.key == "abstaining"
    assert "a moth on the string" in note.sentence


@pytest.mark.parametrize("reason", [Reason.NO_CONTACT, Reason.UNCERTAIN, Reason.GAP, "no contact"])
def test_an_answer_is_no_trouble(reason: str) -> None:
    assert not any(watched(STRING, reason))


def test_a_detuned_string_is_said_with_by_how_much() -> None:
    (note,) = watched(STRING, condition=Condition(deviation=0.0142, follows=True))[-1]
    assert (note.key, note.level) == ("detuned", "info")
    assert "1.4 %" in note.sentence
    (note,) = watched(STRING, "further off", Condition(deviation=-0.14, follows=False))[-1]
    assert (note.key, note.level) == ("detuned", "error")
    assert "14.0 %" in note.sentence
    assert not any(watched(STRING, condition=Condition(deviation=0.001)))
    for std, told in ((0.5, True), (2.5, False)):
        pitch = Estimate(value=997.0, std=std, unit="Hz")
        notes = watched(STRING, condition=Condition(open_frequency=pitch, deviation=-0.0065))[-1]
        assert bool(notes) is told


def test_what_the_estimator_tells_of_the_channels_is_not_looked_at_again() -> None:
    (note,) = watched(STRING, condition=Condition(inputs=Inputs.FIRST))[-1]
    assert note.key == OWN[Reason.MICROPHONE_2_SILENT].key
    copy = np.stack((STRING[0], STRING[0]))
    assert not any(watched(copy, condition=Condition(inputs=Inputs.TWO)))
    assert keys(watched(copy, condition=Condition())[-1]) == [OWN[Reason.ONE_MICROPHONE].key]


def test_a_string_that_is_followed_hides_no_other_trouble() -> None:
    notes = watched(STRING, Reason.NO_STRUCTURE, Condition(deviation=0.0142, follows=True))[-1]
    assert {*keys(notes)} == {"abstaining", "detuned"}


def test_lost_sound_and_skipped_windows_are_said_for_a_while() -> None:
    lost = [StreamHealth(dropped=0)] * 50 + [StreamHealth(dropped=128, gaps=1, xruns=2)]
    long = np.concatenate([STRING] * 4, axis=1)
    notes = watched(long, streams=lost, skipped=[0] * 100 + [3])
    assert not notes[49]
    assert keys(notes[50]) == ["sound_lost"]
    assert "128 frames" in notes[50][0].sentence
    assert keys(notes[100]) == ["sound_lost", "windows_skipped"]
    assert keys(notes[1080]) == ["windows_skipped"]
    assert not notes[-1]


def test_lost_sound_is_no_silent_microphone() -> None:
    assert not any(watched(STRING, gap=slice(100, 300)))


def test_an_xrun_that_lost_nothing_is_said_to_have_lost_nothing() -> None:
    counted = [StreamHealth(dropped=64, gaps=1)] * 50 + [StreamHealth(dropped=64, gaps=1, xruns=1)]
    long = np.concatenate([STRING] * 4, axis=1)
    notes = watched(long, streams=counted)
    assert not notes[49]
    (note,) = notes[50]
    assert (note.key, note.level) == ("xruns", "info")
    assert keys(notes[1040]) == ["xruns"]
    assert not notes[-1]


@pytest.mark.parametrize("late", [3, 0, -3])
def test_an_xrun_beside_lost_sound_is_not_said_to_have_lost_nothing(late: int) -> None:
    """The loss is counted so many windows after the xrun."""
    streams = [
        StreamHealth(xruns=int(k >= 50), dropped=64 * (k >= 50 + late), gaps=int(k >= 50 + late))
        for k in range(200)
    ]
    notes = watched(STRING, streams=streams)
    assert keys(notes[49]) == (["sound_lost"] if late < 0 else [])
    assert keys(notes[52]) == (["xruns"] if late > 0 else ["sound_lost"])
    assert keys(notes[53]) == keys(notes[199]) == ["sound_lost"]


def test_what_was_counted_before_the_stream_began_is_no_news() -> None:
    assert not any(watched(STRING, streams=[StreamHealth(dropped=5, xruns=9)], skipped=[7]))


def test_a_device_that_is_away_is_said_at_once_and_nothing_else() -> None:
    away = StreamHealth(dropped=44100, gaps=1, away="the JACK server is not running")
    back = StreamHealth(dropped=88200, gaps=1, reconnects=1)
    notes = watched(clipped(STRING), streams=[StreamHealth()] * 100 + [away] * 150 + [back])
    assert keys(notes[99]) == ["clipping"]
    assert "no_sound" in keys(notes[100])
    (note,) = notes[249]
    assert away.away in note.sentence
    assert {"sound_lost", "reconnected"} <= {*keys(notes[260])}
    assert "no_sound" not in keys(notes[260])


def test_a_clock_that_is_set_is_said_and_one_that_is_slewed_is_not() -> None:
    def at(offset: float) -> StreamHealth:
        return StreamHealth(clock_offsets={"realtime": 1e9 + offset})

    notes = watched(STRING, streams=[at(1e-4 * k) for k in range(100)] + [at(-3600.0)])
    assert not notes[99]
    assert keys(notes[100]) == ["clock_set"]
    assert "-3600.0" in notes[100][0].sentence


def test_a_new_touch_settles() -> None:
    window = Window(samples=STRING[:, :SIZE], start=0, sample_rate=RATE)
    touched = FilterState(time=0.1, onset=0.1)
    for time, expected in ((0.1, ["settling"]), (0.15, ["settling"]), (0.2, [])):
        followed = touched._replace(time=time)
        _, notes = health.step(HealthState(), window, {}, StreamHealth(), 0, followed, None, HealthSettings())
        assert keys(notes) == expected


def lived(sound: Audio, folder: Path) -> list[Update]:
    """Return the updates of a recording that the bundled model reads."""
    soundfile.write(folder / "sound.wav", sound.T, RATE, subtype="FLOAT")
    source = SOURCES.build("wav", {"path": str(folder / "sound.wav")})
    setup = LiveRun(source=source, estimator=ModelEstimator(path=Path("demo")), sensor="prototype")
    with opened(setup) as live:
        return list(live)


@pytest.mark.parametrize(("force", "floor"), [(0.0, -50.0), (1.0, -90.0)])
def test_a_string_that_breaks_is_said_not_to_ring(force: float, floor: float, tmp_path: Path) -> None:
    """It dies away within half a second, to the noise floor of the microphones, in dB of full scale."""
    broken = 2.0
    sensor = mc.VirtualSensor("prototype", build=1)
    whole = sensor.advance(1.0)[0]
    if force:
        sensor.press(0.08, force=force)
    sound = np.concatenate([whole, sensor.advance(3.0)[0]], axis=1)
    time = np.arange(sound.shape[1]) / RATE
    sound *= np.exp(-np.maximum(time - broken, 0.0) / 0.05)
    sound += 10.0 ** (floor / 20.0) * np.random.default_rng(0).standard_normal(sound.shape)
    updates = lived(sound, tmp_path)
    said = [each for each in updates if "string_still" in keys(each.notes)]
    (note,) = (note for note in said[0].notes if note.key == "string_still")
    assert broken < note.since < said[0].prediction.time < broken + 1.5
    assert note.level == "error"
    assert said == updates[-len(said) :]
    assert keys(updates[-1].notes) == ["string_still"]
    assert not any(update.prediction.estimate("position").valid for update in said)
    assert any(each.valid for each in updates[150].prediction.estimates.values())


@pytest.mark.parametrize("build", [1, 8])
def test_drivers_that_go_off_are_said_whatever_a_model_takes_the_noise_for(
    build: int, tmp_path: Path
) -> None:
    sensor = mc.VirtualSensor("prototype", build=build, world="plausible")
    ringing = sensor.advance(1.0)[0]
    sensor.drive(False, False)
    updates = lived(np.concatenate([ringing, sensor.advance(3.0)[0]], axis=1), tmp_path)
    said = ["string_still" in keys(each.notes) for each in updates]
    assert not any(said[:100])
    assert all(said[-100:])
    assert not {"soft_touch", "detuned"} & {*keys(updates[-1].notes)}


@pytest.mark.parametrize("material", ["foam", "fingertip"])
def test_a_string_that_is_damped_still_rings(material: str) -> None:
    sensor = mc.VirtualSensor("prototype", build=3, world="plausible")
    sensor.advance(1.0)
    sensor.press(0.11, 1.0, material=material)
    sensor.advance(0.5)
    damped = sensor.advance(2.0)[0]
    assert np.sqrt((damped**2).mean(axis=1)).max() < 0.03, "30 dB below full scale: it is damped"
    assert "string_still" not in {key for notes in watched(damped) for key in keys(notes)}
