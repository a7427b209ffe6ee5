"""Whatever is typed or handed in: one line on stderr with status 2, or windows that abstain.

The lines of the table name what was given, or what was expected instead of it.
"""

import subprocess
import sys
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture, records, refusal

from monochord.cli import run
from monochord.core.ownership import part_folder
from monochord.core.types import Block, Floats
from monochord.physics.strings import load_string
from monochord.sessions import Description, SessionClock, SessionWriter

STRING = "--length 0.65 --open-frequency 110"
SAVED = "--sink jsonl={out} --save-config {out}.toml"
RECORD = "record {out}.mcap --source wav --set source.path={one}"
DATASET = "evaluate --dataset {dataset}"
SUITE = "evaluate demo --sessions {session} --out {out}"
TRAIN = "train paper --dataset {dataset} --out {out}"
SIMULATE = "simulate appendix --out {out}.wav"
REFUSED = {
    # live and locate: names, settings, values
    "live one.wav two.wav --source wav": "one.wav",
    "live one.wav two.wav three.wav --source wav": "three.wav",
    "live demo demo": "demo, demo",
    "live run": "run",
    "live dmeo": "'demo'",
    "live dmeo --source jack": "'demo'",
    "live dmeo --source soundcard": "'demo'",
    "live dmeo --source twin": "'demo'",
    "live dmeo --source wav": "'demo'",
    "live dmeo --device card": "'demo'",
    "live DEMO": "'demo'",
    "live ./mymodel_x": "no such file or folder",
    "live ./my:model": "no such file or folder",
    "live mymodel_x --source jack": "no such file or folder",
    "live mymodel_x --source twin": "no such file or folder",
    "live mymodel_x --device card": "a model",
    "live prototpye --source twin": "'prototype'",
    "live demo nosuch": "'nosuch'",
    "live demmo prototype --source twin": "demmo",
    "live twin": "--source twin",
    "live demo {short} --source twin": "0.19 m",  # of which the twin has as many modes
    "live --source split_string --string apendix": "'appendix'",
    f"live {{one}} --source wave {STRING}": "'wav'",
    f"live {{one}} {STRING} --sink terminl": "'terminal'",
    f"live {{one}} {STRING} --sink jsonl=/no/such/file": "/no/such/file",
    f"live {{one}} {STRING} --sink jsonl=/dev/full": "/dev/full|space",
    f"live {{one}} {STRING} --set window.hp=1": "'hop'",
    f"live {{one}} {STRING} --set window": "VALUE",
    f"live {{one}} {STRING} --save-config /no/such/file": "/no/such/file",
    f"live {{one}} {STRING} --seconds -1": "-1",
    "live --source twin --set source.sped=1": "source.sped",
    "live --source twin --set sinks.terminal.with=1": "sinks.terminal.with",
    "live --config no.toml": "no.toml",
    "live --config {one}": "TOML",
    f"live --source wav {STRING}": "path",
    f"live --source soundcard {STRING} --seconds 1": "PortAudio|sound|device",
    "live --source jack --rate 48000": "--rate 48000",
    "live --rate 8000 --device card": "8000",
    "live demo --source twin --window 0.2": "8820",
    "locate demo": "FILE",
    "locate demmo take.wav": "'demo'",
    f"locate {STRING}": "FILE",
    "locate {one}": "length",
    "locate {one} --length 0 --open-frequency 110": "length",
    "locate {one} --length nan --open-frequency 110": "length",
    "locate {one} --length 0.65 --open-frequency low": "open",
    f"locate {{one}} {STRING} --widow 0.1": "--window",
    f"locate {{one}} {STRING} --window 1e-9": "1e-09",
    f"locate {{one}} {STRING} --window 86400": "86400",
    f"locate {{one}} {STRING} --hop 0": "hop",
    f"locate {{one}} {STRING} --set estimator.reech=0.2": "'reach'",
    f"locate {{one}} {STRING} --estimator closed-from": "closed_form",
    f"locate {{one}} {STRING} --calibrate {{one}}": "FILE:POSITION",
    f"locate {{one}} {STRING} --calibrate no.wav:0.1": "no.wav",
    f"locate {{one}} {STRING} --calibrate {{silence}}:0.1": "silence.wav",
    f"locate {{one}} {STRING} --calibrate {{one}}:0.9": "0.65|0.9",
    # live and locate: options that have no effect beside others
    "live --source split_string --string appendix": "INPUT",
    "live take.wav --device card": "--device",
    f"live {{two}} --string appendix --calibrate {{one}}:0.2 {SAVED}": "calibration",
    f"live {{two}} --string appendix --length 0.5 {SAVED}": "length",
    f"live {{one}} --string appendix --calibrate {{one}}:99 {SAVED}": "position",
    f"live {{one}} {STRING} --set estimator.tension_law=geometric {SAVED}": "tension_law",
    f"live {{two}} --string appendix --set estimator.reach=0.5 {SAVED}": "reach",
    f"live {{one}} --string appendix {STRING} {SAVED}": "--string",
    f"live {{one}} {STRING} {SAVED} --json": "--json",
    f"live {{one}} {STRING} {SAVED} --sink jsonl={{out}}2": "jsonl",
    f"live demo {{session}} --estimator closed-form {SAVED}": "--estimator",
    f"live demo {{session}} --calibrate {{one}}:0.1 {SAVED}": "{one}",
    f"live demo {{session}} --length 0.2 {SAVED}": "length",
    f"live {{one}} {STRING} --allow-host lab": "web",
    f"live {{one}} {STRING} --sink web=0 --allow-host lab --allow-host lab/page": "lab/page",
    "live {one} --sensor a=prototype --sensor prototype": "sensor",
    "live {one} --sensor a=prototype --sensor a=long": "sensor",
    "live {one} --sensor a=prototype --sensor b=prototype": "channel",
    "locate {two} --string appendix --calibrate {one}:0.2": "calibration",
    "locate {two} --string appendix --length 0.5": "length",
    f"locate {{one}} --string appendix {STRING}": "--string",
    "locate {one} --string prototype --sensor prototype": "--sensor|--string",
    "locate {one} --string appendix --calibrate {one}:-0.1": "--calibrate",
    "locate {session} --allow-truncated": "truncated",
    "locate {session} --calibrate {session}:0.1": "calibration",
    "locate {session} --string prototype": "prototype",
    # demo
    "demo {short}": "{short} --estimator closed_form",
    "demo --json --allow-host lab": "--allow-host",
    "demo --no-browser --allow-host https://lab": "https://lab",
    "demo --estimator modle": "'model'",
    "demo --material wod": "'wood'",
    "demo --seconds 0": "--seconds",
    "demo --seed -1": "--seed",
    # record
    f"{RECORD} --instrument netft=1.2.3.4": "'net_ft'",
    f"{RECORD} --set net_ft.bias=true": "--instrument net_ft",
    f"{RECORD} --set source.sped=1": "'speed'",
    f"{RECORD} --sensor nonsense": "'nonsense'",
    f"{RECORD} --set disk.start=1e18": "MB",
    f"{RECORD} --seconds -1": "-1",
    f"{RECORD} --radius 20": "--radius",
    f"{RECORD} --instrument a:udp=0 --instrument a:udp=1": "'a'",
    f"{RECORD} --instrument a-b:udp=0 --set a_b.stream=c": "'c'",
    f"{RECORD} --instrument disk:udp=0": "'disk'",
    f"{RECORD} --instrument udp:pose_udp=0": "'udp'",
    f"{RECORD} --instrument audio:pose_udp=0": "'audio'",
    f"{RECORD} --instrument wrench:pose_udp=0": "'wrench'",
    f"{RECORD} --instrument :pose_udp=0": "stream ''",
    # collect, build, calibrate
    "collect smal --out {out}": "'small'",
    "collect absent.toml --out {out}": "absent.toml",
    "collect small --out {out} --set senser=long": "'sensor'",
    "collect small --out {out} --only slid": "'slide'",
    "collect small --out {out} --workers 0": "workers",
    "collect small --out {out} --workers 2 --cluster tcp://127.0.0.1:9": "--workers",
    "collect small --out {out} --real-time --workers 2": "--real-time",
    "collect small --out {out} --server x": "--server",
    "build {session} --out {out} --split time --held-out wood": "held-out",
    "build {session} --out {out} --window 100": "window",
    "build {session} --out {out} --split sesion": "'session'",
    "build {session} --out {out} --labels guessed": "'guessed'",
    "calibrate demo --sessions {session} --touches 0 --objects others": "--objects",
    "calibrate demo --sessions {session} --objects other --out {out}": "'other'",
    # doctor, identify
    "doctor --drift 3": "--sensor",
    "doctor --recordings .": "--sensor",
    "doctor --sensor nope": "'nope'",
    "doctor --sensor prototype --recordings nowhere": "'nowhere'",
    "doctor --sensor prototype --recordings {folder}": "quiet.wav",
    "doctor --sensor prototype --recordings {folder} --source twin": "--recordings",
    "doctor --sensor prototype --out mine.txt": ".toml",
    "doctor --sensor prototype --out nowhere/mine.toml": "'nowhere'",
    "doctor --yes --sensor prototype --source jack --set source.server=no-such-server": "jackd",
    "doctor --web": "--sensor and --web",
    "doctor --sensor prototype --port 8500": "--sensor and --web",
    "doctor --sensor prototype --web --recordings .": "--recordings",
    "doctor --sensor prototype --web --json": "--json",
    "doctor --sensor nope --web": "'nope'",
    "doctor --sensor prototype --web --source twin --out nowhere/mine.toml": "'nowhere'",
    "identify {one} --length 0.65": "--sensor",
    "identify {one} --length 0.2 --weighed nan": "nan",
    "identify {one} --length 0": "--length",
    "identify {silence} --length 0.2": "silence.wav",
    "identify no.wav --length 0.2": "no.wav",
    "identify --length 0.2": "FILES",
    "identify {one}": "--length",
    "identify {one} --length 0.2 --out mine.json": ".toml",
    "identify {one} --length 0.2 --out {short}": "--force",
    "identify {one} --length 0.2 --sensor protoype": "'prototype'",
    # train
    "train papr --out {out}": "'paper'",
    "train no_such.toml --out {out}": "no_such.toml",
    "train paper --dataset nowhere --out {out}": "nowhere",
    f"{TRAIN} --set heads.contact.hiden=3": "'hidden'",
    f"{TRAIN} --set feature.name=log_mell": "'log_mel'",
    f"{TRAIN} --set sensor=protoype": "'prototype'",
    # evaluate
    "evaluate": "sessions",
    "evaluate nowhere": "nowhere",
    "evaluate --dataset nowhere": "nowhere",
    "evaluate --sessions nowhere.mcap": "nowhere.mcap",
    f"{DATASET} --sessions x": "--sessions",
    f"{DATASET} --split nowhere.json": "nowhere.json",
    f"{DATASET} --noise pimk:3": "'pink'",
    f"{DATASET} --estimator closed_from": "'closed_form'",
    f"{DATASET} --sensor prototipe": "'prototype'",
    f"{DATASET} --set sides=both": "string",
    f"{SUITE} --split {{session}}": "--split",
    f"{SUITE} --part test": "--part",
    f"{SUITE} --dataset {{session}}": "--dataset",
    f"{SUITE} --feature x": "--feature",
    f"{SUITE} --seed 1": "--seed",
    f"{SUITE} --estimator closed_form": "--estimator",
    "evaluate demo --sessions {session} --suite": "noise",
    "evaluate demo --sessions {session} --suite --out {out}": "noise",
    "evaluate demo --suite nois": "nois",
    # simulate
    "simulate": "PRESET",
    "simulate apendix": "'appendix'",
    "simulate prototype --model twin --at 0.3": "0.3 m",
    "simulate prototype --model twin --set materiel=wood": "'material'",
    "simulate appendix --model split_strin": "'split_string'",
    "simulate appendix --route modl": "'modal'",
    f"{SIMULATE} --at 0.65": "0.65 m",
    f"{SIMULATE} --at 0": "position 0 m",
    f"{SIMULATE} --at nan": "nan",
    f"{SIMULATE} --force -1": "'--force': '-1'",
    f"{SIMULATE} --seconds 0": "seconds",
    f"{SIMULATE} --seconds 0.001": "0.01 s",
    "simulate appendix --at 0.05 --set time_step=1e-6": "time_step=5e-07",
    f"{SIMULATE} --untouched --at 0.2": "--untouched",
    f"{SIMULATE} --model twin --route fdtd": "route",
    "simulate appendix --out touch.mp3": "touch.mp3",
    "simulate appendix --out nowhere/touch.wav": "nowhere",
    "simulate appendix --set drive.amplitud=1": "'amplitude'",
    "simulate appendix --set mixing=[0.5,0.5] --route modal": "mixing",
    # figure, bench, weights, list, sessions
    "figure": "NAME",
    "figure sesion": "'session'",
    "figure session": "path",
    "figure session --set stp=3": "'step'",
    "figure session --set path={session} --set step=few": "step",
    "figure session --out a.bmp": ".png",
    "figure session --out absent/a.png": "absent",
    "figure scatter --set results=absent.npz --out {out}.png": "absent.npz",
    "figure learning --set run={folder} --out {out}.png": "config.toml",
    "bench lve": "'live'",
    "bench live --set second=1": "'seconds'",
    "bench --set seconds=1": "--set",
    "list sorces": "'sources'",
    "list sources jakc": "'jakc'",
    "audit absent": "absent",
    "audit {dataset} --split absent.json": "absent.json",
    "tune {one}": "--sensor",
    "tune {one} --sensor protoype": "'prototype'",
    "sessions imprt": "'imprt'",
    "sessions check": "FILES",
    "sessions check {one}": "one.wav",
    "sessions show none.mcap": "none.mcap",
    "sessions show {session} --figure {out}.txt": ".png",
    "sessions export hdf5 {session} --out {out}": "'hdf5'",
    "sessions export wav-csv {session}": "--out",
    "sessions export wav-csv {session} --out {folder}": "empty",
    "sessions export wav-csv {session} --out {out} --set rate=1": "wav-csv.rate",
    "sessions import {folder} --out {out}.mcap": "session.json",
    "sessions import {folder} a.csv --out {out}.mcap": "folder",
    "sessions import {folder} --out {out}.mcap --radius 0.01": "--radius",
    "sessions import {one} --out {out}.mcap --radius 20": "--radius",
    "sessions import {one} --out {out}.wav": ".mcap",
    "sessions import {one} --out {out}.mcap --sensor long --string appendix": "sensor",
    "sessions label {out}.wav --source twin": ".mcap",
    "sessions label {out}.mcap --source twin --forces 2 1": "lower force",
    "sessions label {out}.mcap --source twin --model dmeo": "demo",
    # design, publish
    "design --length 0.1": "0.01 m or less",
    "design --length nan": "--length",
    "design --forces 2 1": "least",
    "design --gauge 0.254": "gauge",
    "design --tension 400 --gauge 0.254e-3": "thicker",
    "design --wire musicwire": "music_wire",
    "design --frame aluminum": "aluminium",
    "design --material plastik": "plastic",
    "design --mount glued": "bolted",
    "design --out design.txt": ".toml",
    "design --figure design.bmp": ".png",
    "design --window 0.001": "window",
    "design --model nope": "nope",
    "publish demoo --licence mit --out {out}": "did you mean 'demo'",
    "publish demo --licence mit --out .": "already exists",
    "publish demo --licence {words} --out {out}": "an identifier of the Hub",
    "publish demo --licence mit --scores missing --out {out}": "missing",
    "publish demo --out {out}": "--licence",
    # what is elsewhere
    "bench strings": "studies.strings_speed",
    "figure trends --set steps=5": "studies.trends",
}


@pytest.fixture(scope="module")
def material(small: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Sound of one and of two microphones, silence, a session, a sensor of 195 mm, a folder, a dataset."""
    folder = tmp_path_factory.mktemp("material")
    tone = 0.3 * np.sin(2.0 * np.pi * 500.0 * np.arange(22050) / 44100)
    soundfile.write(folder / "one.wav", tone, 44100, subtype="FLOAT")
    soundfile.write(folder / "two.wav", np.stack([tone, tone], axis=1), 44100, subtype="FLOAT")
    string = load_string("prototype").string
    about = Description(name="session", sample_rate=44100, simulated=True, string=string)
    with SessionWriter(folder / "session.mcap", about, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        writer.audio(Block(samples=np.stack([tone, tone]).astype(np.float32), start=0, adc_time=0.0))
    soundfile.write(folder / "silence.wav", np.zeros(44100), 44100, subtype="FLOAT")
    files = {name: folder / f"{name}.wav" for name in ("one", "two", "silence")}
    prototype = (resources.files("monochord.physics.sensors") / "prototype.toml").read_text(encoding="utf-8")
    (folder / "short.toml").write_text(f"{prototype}\n[override]\nlength = 0.19\n", encoding="utf-8")
    files |= {"session": folder / "session.mcap", "short": folder / "short.toml", "folder": folder}
    return files | {"dataset": small / "dataset"}


@pytest.mark.parametrize("line", REFUSED)
def test_it_is_refused_and_nothing_is_written(
    line: str,
    material: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: Capture,
) -> None:
    if line.startswith("train"):
        pytest.importorskip("torch")
    monkeypatch.chdir(tmp_path)
    given = {**material, "out": tmp_path / "out", "words": "my own"}
    error = refusal(capfd, *(word.format(**given) for word in line.split()))
    assert any(words in error for words in REFUSED[line].format(**given).split("|"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("live rnu", "run"),
        ("evaluate rnu --sessions a.mcap", "run"),
        ("live demo silnce.wav", "silence.wav"),
        (f"locate silnce.wav {STRING}", "silence.wav"),
        ("sessions show sub/tkae.mcap", "sub/take.mcap"),
    ],
)
def test_a_typo_suggests_what_is_there(
    words: str, meant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    for folder in ("run", "sub"):
        (tmp_path / folder).mkdir()
    for file in ("silence.wav", "silnc.txt", "sub/take.mcap"):
        (tmp_path / file).touch()
    monkeypatch.chdir(tmp_path)
    assert f"'{meant}'" in refusal(capsys, *words.split())


@pytest.mark.parametrize(
    "text", ["source = 5", "instruments = 5", 'about = "x"', "[instruments]\npose_udp = [1]"], ids=ascii
)
@pytest.mark.parametrize("command", ["record out.mcap --instrument pose_udp --object key", "live"])
def test_settings_that_are_no_table_are_refused(
    tmp_path: Path, command: str, text: str, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("settings.toml").write_text(text, encoding="utf-8")
    refusal(capsys, *command.split(), "--config", "settings.toml")
    assert not Path("out.mcap").exists()


RATE = 44100
TONE = 0.3 * np.sin(2 * np.pi * 165.0 * np.arange(RATE) / RATE) + 0.1 * np.sin(
    2 * np.pi * 330.0 * np.arange(RATE) / RATE
)
Write = Callable[[Path], Path]


def sound(samples: Floats) -> Write:
    def write(folder: Path) -> Path:
        soundfile.write(folder / "take.wav", samples, RATE, subtype="FLOAT")
        return folder / "take.wav"

    return write


def cut(folder: Path) -> Path:
    path = sound(np.random.default_rng(0).uniform(-0.5, 0.5, RATE))(folder)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


UNUSABLE: dict[str, tuple[Write, str]] = {
    "missing": (lambda folder: folder / "missing.wav", "missing.wav"),
    "three channels": (sound(np.stack([TONE] * 3, axis=1)), "3 channels"),
    "cut": (cut, "take.wav"),
    "shorter than a window": (sound(TONE[:1000]), "window"),
}
"""A file of each kind that `tests/capture/sources/test_wav.py` has, and what a line names."""
ABSTAINED: dict[str, Write] = {
    "NaN": sound(np.full(RATE, np.nan)),
    "infinite": sound(np.full(RATE, np.inf)),
    "one NaN a window": sound(np.where(np.arange(RATE) % 400 == 0, np.nan, TONE)),
    "all zero": sound(np.zeros(RATE)),
    "constant": sound(np.full(RATE, 0.5)),
    "white noise": sound(np.random.default_rng(1).standard_normal(RATE) * 0.1),
}


@pytest.mark.parametrize("case", UNUSABLE)
def test_a_file_that_cannot_be_used_is_refused(case: str, tmp_path: Path, capsys: Capture) -> None:
    make, named = UNUSABLE[case]
    path = make(tmp_path)
    for command in ("locate", "live"):
        assert named in refusal(capsys, command, path, *STRING.split(), "--json")


@pytest.mark.parametrize("case", ABSTAINED)
def test_sound_without_a_string_in_it_is_abstained_from(case: str, tmp_path: Path, capsys: Capture) -> None:
    lines = records(capsys, "locate", ABSTAINED[case](tmp_path), *STRING.split())
    assert len(lines) == 91
    abstained = [line for line in lines if not line["valid"]]
    # Noise may look like a string once in a while; nothing else may.
    assert len(abstained) >= (80 if case == "white noise" else 91)
    for line in abstained:
        assert line["position"] is line["position_std"] is line["frequency"] is None
        assert line["why_not"]


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("case", ["clipped", "far too loud", "far too quiet"])
def test_one_microphone_is_enough_and_any_level_is_borne(
    case: str, channels: int, tmp_path: Path, capsys: Capture
) -> None:
    one = {
        "clipped": np.clip(5.0 * TONE, -1.0, 1.0),
        "far too loud": 1e30 * TONE,
        "far too quiet": 1e-9 * TONE,
    }
    samples = np.stack([one[case]] * channels, axis=1)
    lines = records(capsys, "locate", sound(samples)(tmp_path), *STRING.split())
    assert len(lines) == 91
    for line in lines:
        assert not line["valid"] or abs(line["position"] - 0.65 * (1 - 110 / 165)) < 2e-3


def test_no_jack_server_is_one_line(monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    monkeypatch.setenv("JACK_DEFAULT_SERVER", "monochord-test-no-such-server")
    assert run(["live", "--source", "jack", *STRING.split(), "--seconds", "1"]) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "jackd" in captured.err


def test_a_working_directory_that_was_removed_is_named(tmp_path: Path) -> None:
    code = "import os, sys; os.rmdir(os.getcwd()); from monochord.cli import run; sys.exit(run(sys.argv[1:]))"
    words = ["simulate", "appendix", "--seconds", "0.1", "--out", "touch.wav"]
    (tmp_path / "gone").mkdir()
    python = [sys.executable, "-c", code, *words]
    done = subprocess.run(python, cwd=tmp_path / "gone", capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("monochord: a working directory that was removed")


def test_a_folder_that_cannot_be_written_is_named_and_not_its_lock() -> None:
    with pytest.raises(OSError, match="/proc/dataset'") as refused, part_folder(Path("/proc/dataset")):
        pass
    assert refused.value.filename == "/proc/dataset"
