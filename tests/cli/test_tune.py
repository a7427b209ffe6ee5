"""The command `tune`, the file that it writes, and what takes that file."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, record, refusal
from tests.twins import sound_of

import monochord as mc
from monochord.cli import run
from monochord.core.types import Floats
from monochord.physics.sensors import load_sensor, sensor_design
from monochord.physics.setup import Sensor
from monochord.physics.theory import open_frequency
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.world import World, sensor_of
from monochord.sessions import read_session

RATIO = 0.953
POSITION = 0.083
NOMINAL = open_frequency(load_sensor("prototype").string)


def recorded(sensor: Sensor, path: Path) -> Path:
    """Write a recording of a sensor, 0.8 semitones too low, that is touched after 1.5 s."""
    string = replace(sensor.string, tension=sensor.string.tension * RATIO**2)
    twin = VirtualSensor(replace(sensor, string=string), seed=5)
    soundfile.write(path, sound_of(twin, 1.5, (POSITION, 0.8), 1.0)[0].T, 44100, subtype="FLOAT")
    return path


@pytest.fixture(scope="module")
def take(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the design."""
    return recorded(load_sensor("prototype"), tmp_path_factory.mktemp("tune") / "take.wav")


@pytest.fixture(scope="module")
def build() -> Sensor:
    """A sensor as one is built, with magnets that pull and ends that yield."""
    return sensor_of(load_sensor("prototype"), "plausible", build=5, day=1)


@pytest.fixture(scope="module")
def pitch(build: Sensor) -> float:
    """Its string's pitch in the recording, over the design's."""
    string = replace(build.string, tension=build.string.tension * RATIO**2 + build.drift)
    return open_frequency(string) / NOMINAL


@pytest.fixture(scope="module")
def as_built(build: Sensor, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of that build."""
    return recorded(build, tmp_path_factory.mktemp("built") / "take.wav")


@pytest.fixture
def tuned(take: Path, tmp_path: Path, capsys: Capture) -> Path:
    """The file of that sensor as tuned."""
    path = tmp_path / "sensor.toml"
    assert run(["tune", str(take), "--sensor", "prototype", "--out", str(path)]) == 0
    capsys.readouterr()
    return path


@pytest.mark.parametrize("level", [0.0, 1e-5, 1e-2])
def test_silence_and_noise_name_what_to_look_at(level: float, tmp_path: Path, capsys: Capture) -> None:
    sound = level * np.random.default_rng(0).standard_normal((44100, 2))
    soundfile.write(tmp_path / "take.wav", sound, 44100, subtype="FLOAT")
    line = refusal(capsys, "tune", str(tmp_path / "take.wav"), "--sensor", "prototype")
    assert all(word in line for word in ("driver", "gain", "input", "monochord list devices"))
    assert "let go" not in line


def test_a_measured_length_is_written_and_kept(
    as_built: Path, pitch: float, tmp_path: Path, capsys: Capture
) -> None:
    path, again = tmp_path / "sensor.toml", tmp_path / "again.toml"
    words = [str(as_built), "--sensor", "prototype", "--length", "0.1983", "--out", str(path)]
    assert run(["tune", *words]) == 0
    assert "198.3 mm, -1.7 mm off the design's" in capsys.readouterr().out
    sensor, design = load_sensor(str(path)), load_sensor("prototype")
    assert (sensor.measured_length, sensor.range) == (0.1983, design.range)
    assert sensor.string.length == pytest.approx(0.1983)
    assert open_frequency(sensor.string) / NOMINAL == pytest.approx(pitch, abs=0.002)
    assert sensor.drivers[1].sense == pytest.approx(design.drivers[1].sense - 0.0017)
    facts = record(capsys, "tune", as_built, "--sensor", path, "--out", again)["tuning"]
    assert facts["length"] == 0.1983
    assert facts["tension"] == pytest.approx(sensor.string.tension, rel=1e-6)
    assert mc.tune(as_built, sensor="prototype", length=0.1983).string.length == pytest.approx(0.1983)


@pytest.mark.parametrize("length", ["0.1932", "0.207"])
def test_the_length_of_another_string_is_refused(
    length: str, take: Path, tmp_path: Path, capsys: Capture
) -> None:
    words = ("--sensor", "prototype", "--length", length, "--out", str(tmp_path / "sensor.toml"))
    line = refusal(capsys, "tune", str(take), *words)
    assert all(word in line for word in (f"{float(length):g} m", "0.2 m within 3 %", "preset"))
    assert not (tmp_path / "sensor.toml").exists()


def test_it_prints_and_writes_the_sensor(
    as_built: Path,
    pitch: float,
    tmp_path: Path,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["tune", str(as_built), "--sensor", "prototype"]) == 0
    off = re.search(r"off nominal +([-+][\d.]+) %", capsys.readouterr().out)
    assert off
    assert float(off[1]) == pytest.approx(100.0 * (pitch - 1.0), abs=0.1)
    sensor, design = load_sensor("sensor.toml"), load_sensor("prototype")
    ratio = open_frequency(sensor.string) / NOMINAL
    assert ratio == pytest.approx(pitch, abs=0.002)
    tension = design.string.tension * ratio**2
    assert sensor == replace(design, name="prototype", string=replace(design.string, tension=tension))
    assert sensor_design("sensor.toml") == "prototype"
    result = record(capsys, "tune", as_built, "--sensor", "sensor.toml", "--force")
    written = tomllib.loads(Path("sensor.toml").read_text(encoding="utf-8"))
    assert result["tuning"]["open_frequency"] == written["tuning"]["open_frequency"]
    assert written["tuning"]["source"] == str(as_built)
    assert result["deviation"] == pytest.approx(ratio - 1.0)
    assert result["refused_windows"] >= 8  # those that are touched


def test_a_file_is_replaced_only_where_asked(tuned: Path, take: Path, capsys: Capture) -> None:
    before = tuned.read_bytes()
    line = refusal(capsys, "tune", str(take), "--sensor", "prototype", "--out", str(tuned))
    assert "--force" in line
    assert tuned.read_bytes() == before


@pytest.mark.parametrize("command", [("tune", "take.wav"), ("doctor", "--recordings", "takes")])
def test_the_file_of_the_design_is_not_replaced_by_its_own_tuning(
    command: tuple[str, ...], take: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("takes").mkdir()
    for name in ("take.wav", "takes/both.wav"):
        Path(name).write_bytes(take.read_bytes())
    assert run(["design", "--gauge", "0.254e-3", "--out", "design.toml"]) == 0
    before = Path("design.toml").read_bytes()
    line = refusal(capsys, *command, "--sensor", "design.toml", "--out", "design.toml", "--force")
    assert "design" in line
    assert Path("design.toml").read_bytes() == before


def test_a_sound_that_does_not_tell_writes_nothing(take: Path, tmp_path: Path, capsys: Capture) -> None:
    touched, out = tmp_path / "touched.wav", tmp_path / "out.toml"
    sound = soundfile.read(take)[0]
    soundfile.write(touched, sound[-22050:], 44100, subtype="FLOAT")
    to = ("--out", str(out))
    assert "touched" in refusal(capsys, "tune", str(touched), "--sensor", "prototype", *to)
    assert "string" in refusal(capsys, "tune", str(take), "--sensor", "long", *to)
    soundfile.write(touched, sound[:2000], 44100, subtype="FLOAT")
    assert "shorter" in refusal(capsys, "tune", str(touched), "--sensor", "prototype", *to)
    assert not out.exists()


def test_live_and_locate_take_the_sensor(tuned: Path, take: Path, capsys: Capture) -> None:
    assert run(["locate", str(take), "--sensor", str(tuned), "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    touched = [line["position"] for line in lines if line["time"] > 1.9]
    assert touched == pytest.approx([POSITION] * len(touched), abs=1e-3)
    assert not any(line["valid"] for line in lines if line["time"] < 1.3)
    (*_, last) = mc.listen(take, "tuning", sensor=str(tuned))
    assert last.frequency.value == pytest.approx(RATIO * NOMINAL, rel=0.002)


def test_a_session_records_the_sensor(tuned: Path, as_built: Path, pitch: float, tmp_path: Path) -> None:
    session = tmp_path / "take.mcap"
    source = ("--source", "wav", "--set", f"source.path={as_built}")
    assert run(["record", str(session), *source, "--sensor", str(tuned)]) == 0
    string = read_session(session).description.string
    assert string == load_sensor(str(tuned)).string
    again = mc.tune(session)  # whose string is that of the prototype at another tension
    assert again.design == "prototype"
    assert again.tuning.frequency == pytest.approx(pitch * NOMINAL, rel=0.002)


def test_takes_are_put_together(take: Path) -> None:
    one, two = mc.tune(take, sensor="prototype"), mc.tune(take, take, sensor="prototype")
    assert two.seconds == pytest.approx(2.0 * one.seconds)
    assert two.tuning.frequency == pytest.approx(one.tuning.frequency, rel=1e-3)


def partials(*numbers: int, of: float = 1010.0, seconds: float = 2.0) -> Floats:
    """Return sines of 1 / n at both microphones, at exact multiples of a frequency."""
    phase = 2.0 * np.pi * of / 44100 * np.arange(round(44100 * seconds))
    return np.stack([0.1 * sum(np.sin(n * phase + n) / n for n in numbers)] * 2)


SECOND = partials(2)
HISS = 1e-3 * np.random.default_rng(0).standard_normal(SECOND.shape)
TONES: dict[str, Floats] = {
    "a sine of the fundamental": partials(1),
    "a sine of the second partial, in noise": SECOND + HISS,
    "a sine that dies away": SECOND * np.exp(-np.arange(SECOND.shape[1]) / 15000),
    "a sawtooth of the second partial": partials(*range(2, 21, 2)),
    "that sawtooth, louder at one microphone": partials(*range(2, 21, 2)) * [[1.0], [0.7]] + HISS,
    "a square wave of the fundamental": partials(*range(1, 20, 2)),
    "sines without a fundamental": partials(3, 5),
    "sines whose shares differ": partials(3, 5) * [[1.0], [0.5]] + partials(5) * [[-0.3], [0.4]],
    "sines that are sums of one another": partials(2, 3, 5),
    "two sines of a sound card, clipped": np.tanh(10.0 * partials(3, 5)) / 10.0,
}


@pytest.mark.parametrize("name", TONES)
def test_a_sound_of_no_string_is_refused(name: str, tmp_path: Path, capsys: Capture) -> None:
    sound, out = tmp_path / "tone.wav", tmp_path / "out.toml"
    soundfile.write(sound, TONES[name].T, 44100, subtype="FLOAT")
    refusal(capsys, "tune", str(sound), "--sensor", "prototype", "--out", str(out))
    assert not out.exists()


def test_a_made_up_series_of_the_strings_own_pitch_is_tuned(tmp_path: Path) -> None:
    """It cannot be told from a string whose first partial is driven; the installation compiles with it."""
    sound = tmp_path / "series.wav"
    soundfile.write(sound, partials(*range(1, 9)).T, 44100)
    told = mc.tune(sound, sensor="prototype").tuning
    assert told.frequency == pytest.approx(1010.0, abs=2.0 * told.frequency_std)


@pytest.mark.xfail(
    reason="it has no magnets and no yielding ends, for which a measurement allows: docs/ROADMAP.md",
    raises=AssertionError,
)
def test_the_pitch_of_a_made_up_series_is_exact(tmp_path: Path) -> None:
    sound = tmp_path / "series.wav"
    soundfile.write(sound, partials(*range(1, 9)).T, 44100)
    assert mc.tune(sound, sensor="prototype").tuning.frequency == pytest.approx(1010.0, rel=1e-3)


@pytest.mark.xfail(
    reason="1.9 Hz above: it has no magnets and no yielding ends, as above: docs/ROADMAP.md",
    raises=AssertionError,
)
def test_the_pitch_of_a_steady_ideal_string_is_exact(tmp_path: Path) -> None:
    twin, sound = VirtualSensor("prototype", seed=3), tmp_path / "untouched.wav"
    soundfile.write(sound, twin.advance(10.0)[0].T, 44100, subtype="FLOAT")
    pitch = mc.open_frequency(mc.tune(sound, sensor="prototype").string)
    assert pitch == pytest.approx(mc.open_frequency(twin.sensor.string), abs=1.0)


def test_a_driven_partial_beside_faint_ones_is_a_string(tmp_path: Path) -> None:
    """So a string by finite differences sounds: two partials are 40 to 50 dB below the driven third."""
    sound, phase = tmp_path / "faint.wav", 2.0 * np.pi / 44100 * np.arange(44100)
    faint = 1e-3 * (np.sin(1987.2 * phase) + np.sin(3977.5 * phase))
    soundfile.write(sound, np.stack([0.1 * np.sin(2982.4 * phase) + faint] * 2, 1), 44100, subtype="FLOAT")
    assert mc.tune(sound, sensor="prototype").tuning.frequency == pytest.approx(993.4, rel=2e-3)


@pytest.mark.parametrize(("build", "world"), [(7, "plausible"), (1024, "ideal"), (3002, "plausible")])
def test_a_driven_string_is_tuned_long_after_anything_touched_it(
    build: int, world: World, tmp_path: Path
) -> None:
    """What sounds then is one partial and its exact multiples, which no other ring beside."""
    twin = VirtualSensor("prototype", seed=build, build=build, day=build + 1000, world=world)
    path, pitches = tmp_path / "untouched.wav", list[float]()
    for _ in range(2):
        soundfile.write(path, twin.advance(1.0)[0].T, 44100, subtype="FLOAT")
        pitches.append(mc.tune(path, sensor="prototype").tuning.frequency)
        twin.advance(9.0)
    assert pitches[1] == pytest.approx(pitches[0], rel=0.004)
    assert pitches[0] == pytest.approx(open_frequency(twin.sensor.string), rel=0.03)
