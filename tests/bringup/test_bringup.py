"""The checks of a bring-up as pure functions, the sensor's file, and the report."""

import json
import math
import re
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from monochord.bringup import STEPS, BringUp, Live, Take, Virtual, examine, record, recordings, steps, write
from monochord.bringup.drawing import LEFT, RIGHT, drawing
from monochord.bringup.inputs import dropped_check, inputs_check, level_checks, order_check, rate_check
from monochord.bringup.noise import hum_checks
from monochord.bringup.string import measure_pluck, tuner_turns
from monochord.bringup.timing import drift_checks, latency_check
from monochord.capture.sources.base import Source, Stream
from monochord.capture.sources.session import SessionSource
from monochord.cli import run
from monochord.core.errors import InputError
from monochord.core.types import Block, Signal
from monochord.physics.sensors import load_sensor, retuned, sensor_names, sensor_tuning
from monochord.physics.theory import inharmonicity, open_frequency
from monochord.sessions import Description, SessionClock, SessionWriter

RATE = 44100
DESIGN = load_sensor("prototype")


def take(samples: np.ndarray) -> Take:
    return Take(samples=samples.astype(np.float32), sample_rate=RATE)


@pytest.fixture(scope="module")
def healthy() -> BringUp:
    virtual = Virtual(sensor=DESIGN, seed=3)
    return examine("prototype", DESIGN, {step.name: virtual.take(step) for step in STEPS}, time="now")


def tones(*lines: tuple[float, float], seconds: float = 2.0) -> np.ndarray:
    time = np.arange(round(seconds * RATE)) / RATE
    return sum(
        (level * math.sqrt(2.0) * np.sin(2 * np.pi * f * time) for f, level in lines), np.zeros(time.size)
    )


def test_the_pluck_gives_pitch_stiffness_and_decay_of_the_string(healthy: BringUp) -> None:
    assert healthy.pluck
    assert healthy.pluck.tuning.frequency == pytest.approx(open_frequency(DESIGN.string), rel=1e-3)
    assert healthy.pluck.tuning.inharmonicity == pytest.approx(inharmonicity(DESIGN.string), rel=0.1)
    assert healthy.pluck.tuning.decay == pytest.approx(15.0, rel=0.3)


def test_the_sensor_file_is_read_with_the_measured_pitch(healthy: BringUp, tmp_path: Path) -> None:
    file, report = write(healthy, tmp_path / "mine.toml")
    assert file
    assert healthy.pluck
    assert open_frequency(load_sensor(str(file)).string) == pytest.approx(healthy.pluck.tuning.frequency)
    tuning = sensor_tuning(str(file))
    assert tuning
    assert tuning.microphones == (1, 2)
    assert "# level of microphone 1: " in file.read_text(encoding="utf-8")
    text = report.read_text(encoding="utf-8")
    assert text.count("<svg") == 2 * len(STEPS)
    assert not re.search(r"(src|href)=|@import|url\(", text)


def test_a_rehearsal_says_so_wherever_it_is_written(healthy: BringUp, tmp_path: Path) -> None:
    file, report = write(healthy, tmp_path / "mine.toml")
    assert healthy.simulated
    assert file
    assert file.read_text(encoding="utf-8").startswith("# Simulated")
    html = report.read_text(encoding="utf-8")
    assert "simulated</title>" in html
    assert "simulated</h1>" in html
    assert healthy.verdict in html


def test_what_was_recorded_is_not_called_simulated(healthy: BringUp, tmp_path: Path) -> None:
    takes = {name: replace(each, simulated=False) for name, each in healthy.takes.items()}
    real = examine("prototype", DESIGN, takes)
    _, report = write(real, tmp_path / "mine.toml")
    assert "imulated" not in report.read_text(encoding="utf-8") + (real.toml() or "") + real.verdict


@pytest.mark.parametrize("simulated", [True, False])
def test_what_a_session_and_its_exported_sound_say_of_themselves_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], *, simulated: bool
) -> None:
    session, folder = tmp_path / "pluck.mcap", tmp_path / "exported"
    about = Description(name="pluck", sample_rate=RATE, simulated=simulated)
    with SessionWriter(session, about, SessionClock(epoch_ns=10**18)) as writer:
        writer.audio(Block(samples=np.full((2, RATE), 0.1, np.float32), start=0, adc_time=0.0))
    played = record(SessionSource(path=session), math.inf, "pluck")
    assert played.simulated is simulated
    assert run(["sessions", "export", "wav_csv", str(session), "--out", str(folder)]) == 0
    (sound,) = folder.rglob("*.wav")
    sound.rename(tmp_path / "pluck.wav")
    (take_of_it,) = recordings(tmp_path, STEPS).values()
    assert take_of_it.simulated is simulated
    assert np.array_equal(take_of_it.samples, played.samples)
    doctor = ["doctor", "--sensor", "prototype", "--recordings", str(tmp_path)]
    capsys.readouterr()
    assert run(doctor) == 1  # it is no pluck
    first, *_, last = capsys.readouterr().out.splitlines()
    assert (first == "Simulated: a rehearsal on the virtual sensor.") is simulated
    assert ("Simulated" in last) is simulated
    assert run([*doctor, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["simulated"] is simulated


@pytest.mark.parametrize("name", sensor_names())
def test_the_drawing_has_every_part_at_its_place(name: str) -> None:
    sensor = load_sensor(name)
    root = ET.fromstring(drawing(sensor))  # noqa: S314  (ours)
    parts = {each.attrib["data-part"]: each for each in root.iter() if "data-part" in each.attrib}
    assert {part for step in steps(60.0) for part in step.lit} <= parts.keys()
    scale = (RIGHT - LEFT) / sensor.string.length
    for number, driver in enumerate(sensor.drivers, 1):
        coils = [each for each in parts[f"driver_{number}"] if each.get("class") == "coil"]
        middles = [float(each.attrib["x"]) + float(each.attrib["width"]) / 2 for each in coils]
        assert middles == pytest.approx([LEFT + scale * driver.sense, LEFT + scale * driver.drive], abs=0.1)
    for part, place in (("tap", 0.01), ("pluck", 0.025), ("press", sensor.string.length / 3)):
        label = next(each for each in parts[part] if each.text == part)
        assert float(label.attrib["x"]) == pytest.approx(LEFT + scale * place, abs=0.1)


def test_advice_cannot_put_markup_into_the_report(healthy: BringUp, tmp_path: Path) -> None:
    first = replace(healthy.checks[0], advice="<script>")
    _, report = write(replace(healthy, checks=(first,)), tmp_path / "mine.toml")
    assert "<script>" not in report.read_text(encoding="utf-8")


def test_the_tuner_is_turned_further_for_a_larger_error_and_either_way() -> None:
    nominal = open_frequency(DESIGN.string)
    low, lower, high = (tuner_turns(DESIGN.string, share * nominal) for share in (0.98, 0.96, 1.02))
    assert high < 0.0 < low < lower
    stretched = (
        (DESIGN.string.tension - retuned(DESIGN.string, 0.98 * nominal).tension) / (2e11 * 5.067e-8) * 0.2
    )
    assert low == pytest.approx(stretched * 14.0 / (math.pi * 6e-3), rel=1e-3)


def test_no_string_is_found_in_noise() -> None:
    noise = 1e-3 * np.random.default_rng(1).normal(size=(2, RATE))
    found = measure_pluck(take(noise), DESIGN)
    assert found is None or len(found.partials) < 12


@pytest.mark.parametrize(
    ("lines", "cause"),
    [(((100.0, 0.02), (50.0, 0.005)), "ripple"), (((50.0, 0.02), (150.0, 0.01)), "ground loop")],
)
def test_the_cause_of_hum_is_told_by_its_harmonics(
    lines: tuple[tuple[float, float], ...], cause: str
) -> None:
    sound = tones(*lines)
    checks = hum_checks(take(np.stack([sound, sound])))
    assert [check.fault for check in checks] == ["hum", "hum"]
    assert cause in checks[0].advice
    assert checks[0].value == pytest.approx(
        20.0 * math.log10(math.hypot(*(level for _, level in lines))), abs=0.5
    )


def test_hum_in_one_microphone_is_its_cable() -> None:
    checks = hum_checks(take(np.stack([tones((60.0, 0.02)), tones((60.0, 1e-4))])))
    assert [check.fault for check in checks] == ["hum", ""]
    assert "cable" in checks[0].advice


@pytest.mark.parametrize("number", [1, 2])
def test_a_microphone_that_clips_alone_is_named(number: int) -> None:
    """Whichever step it clips in."""
    sound = np.stack([tones((1000.0, 0.2))] * 2)
    loud = sound.copy()
    loud[number - 1] = np.clip(8.0 * sound[number - 1], -1.0, 1.0)
    for steps_ in ((loud, sound), (sound, loud)):
        checks = level_checks([take(each) for each in steps_])
        assert [check.fault for check in checks if check.fault] == [f"microphone {number} clipped"]


@pytest.mark.parametrize(("louder", "fault"), [(2.0, ""), (1.0, "unclear tap"), (0.5, "microphones swapped")])
@pytest.mark.parametrize("relative", [0.2, 1.0, 5.0])
def test_the_order_of_the_microphones_is_told_whatever_their_gains(
    louder: float, fault: str, relative: float
) -> None:
    """A tap is `louder` at microphone 1, whose sensitivity is `relative` to the other one's."""
    tap = np.zeros(RATE)
    tap[20000:20100] = 0.05 * np.sin(np.arange(100))
    check = order_check(take(np.stack([louder * relative * tap, tap])), relative)
    assert check.value == pytest.approx(20.0 * math.log10(louder), abs=0.1)
    assert check.fault == fault


def test_latency_is_the_time_from_the_click_to_its_return() -> None:
    sound = np.zeros((2, RATE))
    sound[0, 1000], sound[1, 1000 + 441] = 0.5, 0.2
    check = latency_check(take(sound))
    assert check.passed
    assert check.value == pytest.approx(10.0)
    sound[1] = 1e-3 * np.random.default_rng(0).normal(size=RATE)
    assert latency_check(take(sound)).passed is None


@pytest.mark.parametrize(("cents", "fault"), [(5.0, ""), (60.0, "drift")])
def test_drift_is_in_cents_a_minute(cents: float, fault: str) -> None:
    time = np.arange(10 * RATE) / RATE
    phase = 2 * np.pi * 2000.0 * np.cumsum(2.0 ** (cents * time / 60.0 / 1200.0)) / RATE
    sound = 0.2 * np.sin(phase)
    (check,) = drift_checks(take(np.stack([sound, sound])), 1000.0)
    assert check.value == pytest.approx(cents, rel=0.05)
    assert check.fault == fault


def test_a_live_source_at_another_rate_and_lost_frames_are_told() -> None:
    sound = take(np.zeros((2, 3 * RATE)))
    assert rate_check({"quiet": replace(sound, elapsed=3.0)}).passed
    wrong = rate_check({"quiet": replace(sound, elapsed=3.0 * RATE / 48000)})
    assert wrong.fault == "wrong rate"
    assert wrong.value == pytest.approx(48000.0)
    assert dropped_check({"quiet": replace(sound, dropped=64)}).fault == "lost frames"


@pytest.mark.parametrize(
    "takes",
    [
        {},
        {"pluck": take(np.zeros((1, RATE)))},
        {"pluck": take(np.zeros((2, 100)))},
        {"pluck": take(np.full((2, RATE), np.nan))},
        {"pluck": take(np.zeros((2, RATE))), "quiet": replace(take(np.zeros((2, RATE))), sample_rate=48000)},
    ],
)
def test_takes_that_cannot_be_are_refused(takes: dict[str, Take]) -> None:
    with pytest.raises(InputError):
        examine("prototype", DESIGN, takes)


def test_silence_is_two_dead_microphones() -> None:
    quiet = take(np.zeros((2, 2 * RATE)))
    result = examine("prototype", DESIGN, {step.name: quiet for step in STEPS})
    assert result.faults == ("microphone 1 dead", "microphone 2 dead")
    assert result.toml() is None


def test_a_design_of_one_driver_is_not_asked_for_the_other(healthy: BringUp) -> None:
    design = load_sensor("prototype_one_driver")
    result = examine("prototype_one_driver", design, healthy.takes)
    assert next(check for check in result.checks if check.step == "driver_2").passed is None


@dataclass(frozen=True, slots=True, kw_only=True)
class Late(Source):
    """A device of two channels at 44.1 kHz whose frames come at `rate`, to a reader that is late."""

    rate: float

    @contextmanager
    def open(self) -> Generator[Stream]:
        yield _LateStream(self.rate)


class _LateStream(Stream):
    def __init__(self, rate: float) -> None:
        self._rate = rate

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=RATE, channels=2)

    @property
    def paced(self) -> bool:
        return True

    def __iter__(self) -> Iterator[Block]:
        for start in range(0, 2 * RATE, 4410):
            time.sleep(0.1 if start == 4410 else 0.0)
            yield Block(
                samples=np.zeros((2, 4410), np.float32), start=start, adc_time=10.0 + start / self._rate
            )


@pytest.mark.parametrize(("rate", "fault"), [(RATE, ""), (48000, "wrong rate")])
def test_the_rate_is_judged_by_the_devices_times_and_not_by_the_readers(rate: float, fault: str) -> None:
    take = Live(source=Late(rate=rate), name="late").take(STEPS[1])
    assert take.elapsed == pytest.approx(take.samples.shape[1] / rate, rel=1e-2)
    assert rate_check({"pluck": take}).fault == fault


def test_two_inputs_are_compared_as_live(healthy: BringUp) -> None:
    assert inputs_check(healthy.takes).passed
    random = np.random.default_rng(0)

    def faults(change: Callable[[np.ndarray], np.ndarray]) -> str:
        return inputs_check({step: take(change(each.samples)) for step, each in healthy.takes.items()}).fault

    def noise(one: np.ndarray) -> np.ndarray:
        return 1e-4 * random.standard_normal(one.size)

    assert faults(lambda both: np.stack((both[0], -0.5 * both[0]))) == "one microphone"
    assert faults(lambda both: np.stack((both[0], noise(both[0])))) == "microphone 2 dead"
    assert faults(lambda both: np.stack((noise(both[1]), both[1]))) == "microphone 1 dead"
    copied = {step: take(np.stack((each.samples[0],) * 2)) for step, each in healthy.takes.items()}
    assert "one microphone" in examine("prototype", DESIGN, copied).faults
