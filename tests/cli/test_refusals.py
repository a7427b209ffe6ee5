"""Options that are wrong, have no effect beside others or no physical meaning: one line, nothing written."""

from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.cli import run
from monochord.core.types import Block
from monochord.perception.features import FEATURES
from monochord.physics.strings import load_string
from monochord.sessions import Description, SessionClock, SessionWriter

STRING = "--length 0.65 --open-frequency 110"
SAVED = "--sink jsonl={out} --save-config {out}.toml"
RECORD = "record {out}.mcap --source wav --set source.path={one}"
DATASET = "evaluate --dataset {dataset}"
COARSE = "simulate appendix --at 0.05 --set time_step=1e-6"
REFUSED = {
    # live and locate
    "live one.wav two.wav --source wav": "model one.wav (not there): allowed is a folder that",
    "live one.wav two.wav three.wav --source wav": "one MODEL at most, and one INPUT at most",
    "live --source split_string --string appendix": "name it as INPUT",
    "live --source split_string --string apendix": "'appendix'",
    f"live {{one}} --source wave {STRING}": "did you mean 'wav'",
    f"live {{one}} {STRING} --sink terminl": "'terminal'",
    f"live {{one}} {STRING} --sink jsonl=/no/such/file": "/no/such/file",
    f"live {{one}} {STRING} --sink jsonl=/dev/full": "space",
    f"live {{one}} {STRING} --set window.hp=1": "'hop'",
    f"live {{one}} {STRING} --set window": "VALUE",
    f"live {{one}} {STRING} --set source.blok=1": "'block'",
    f"live {{one}} {STRING} --save-config /no/such/file": "/no/such/file",
    f"live {{one}} {STRING} --seconds -1": "above 0",
    "live {one} --string apendix": "'appendix'",
    "live --config no.toml": "no.toml",
    "live --config {one}": "TOML",
    f"live --source wav {STRING}": "path",
    f"live --source soundcard {STRING} --seconds 1": "PortAudio|sound|device",
    f"locate {STRING}": "FILE",
    "locate {one}": "length",
    "locate {one} --length 0 --open-frequency 110": "above 0",
    "locate {one} --length -0.65 --open-frequency 110": "above 0",
    "locate {one} --length nan --open-frequency 110": "above 0",
    "locate {one} --length 0.65 --open-frequency low": "above 0",
    f"locate {{one}} {STRING} --widow 0.1": "--window",
    f"locate {{one}} {STRING} --window 1e-9": "0.01 to 60 s",
    f"locate {{one}} {STRING} --window 86400": "60 s",
    f"locate {{one}} {STRING} --hop 1e-9": "0.001 to 60 s",
    f"locate {{one}} {STRING} --hop 0": "above 0",
    f"locate {{one}} {STRING} --calibrate {{one}}": "FILE:POSITION",
    f"locate {{one}} {STRING} --calibrate no.wav:0.1": "no.wav",
    f"locate {{one}} {STRING} --calibrate {{silence}}:0.1": "silence.wav",
    f"locate {{one}} {STRING} --calibrate {{one}}:0.9": "0.65|0.9",
    f"locate {{one}} {STRING} --estimator closed-from": "closed_form",
    f"live {{two}} --string appendix --calibrate {{one}}:0.2 {SAVED}": "calibration",
    f"live {{two}} --string appendix --length 0.5 {SAVED}": "length",
    f"live {{one}} --string appendix --calibrate {{one}}:99 {SAVED}": "position",
    f"live {{one}} {STRING} --set estimator.tension_law=geometric {SAVED}": "tension_law",
    f"live {{two}} --string appendix --set estimator.reach=0.5 {SAVED}": "reach",
    f"live {{one}} --string appendix {STRING} {SAVED}": "--string",
    f"live {{one}} {STRING} {SAVED} --json": "--json",
    f"live {{one}} {STRING} {SAVED} --sink jsonl={{out}}2": "twice",
    f"live demo {{session}} --estimator closed-form {SAVED}": "--estimator",
    f"live demo {{session}} --calibrate {{one}}:0.1 {SAVED}": "{one}",
    f"live demo {{session}} --length 0.2 {SAVED}": "length",
    "locate {two} --string appendix --calibrate {one}:0.2": "calibration",
    "locate {two} --string appendix --length 0.5": "length",
    f"locate {{one}} --string appendix {STRING}": "--string",
    "locate {one} --string appendix --calibrate {one}:0.65": "calibration",
    "locate {one} --string appendix --calibrate {one}:-0.1": "--calibrate",
    "locate {session} --allow-truncated": "allow_truncated",
    "locate {session} --calibrate {session}:0.1": "calibration",
    "locate {session} --string prototype": "string 'prototype'",
    f"live {{one}} {STRING} --allow-host lab": "--sink web",
    f"live {{one}} {STRING} --sink web=0 --allow-host lab --allow-host lab/page": "NAME or NAME:PORT",
    # demo
    "demo --json --allow-host lab": "--allow-host beside --json",
    "demo --no-browser --allow-host https://lab": "NAME or NAME:PORT",
    "demo --estimator modle": "did you mean 'model'",
    "demo --material wod": "did you mean 'wood'",
    "demo --seconds 0": "--seconds",
    "demo --seed -1": "--seed",
    # record
    f"{RECORD} --instrument netft=1.2.3.4": "did you mean 'net_ft'",
    f"{RECORD} --set net_ft.bias=true": "add --instrument net_ft",
    f"{RECORD} --set source.sped=1": "did you mean 'speed'",
    f"{RECORD} --sensor nonsense": "sensor 'nonsense'",
    f"{RECORD} --set disk.start=1e18": "MB free: allowed is",
    f"{RECORD} --seconds -1": "a number above 0",
    f"{RECORD} --radius 20": "--radius",
    f"{RECORD} --set pose_udp.rate=5": "--instrument pose_udp",
    f"{RECORD} --instrument a:udp=0 --instrument a:udp=1": "'a'",
    f"{RECORD} --instrument a-b:udp=0 --set a_b.stream=c": "'c'",
    f"{RECORD} --instrument disk:udp=0": "'disk'",
    f"{RECORD} --instrument udp:pose_udp=0": "'udp'",
    f"{RECORD} --instrument audio:pose_udp=0": "'audio'",
    f"{RECORD} --instrument wrench:pose_udp=0": "'wrench'",
    f"{RECORD} --instrument :pose_udp=0": "stream ''",
    # collect
    "collect smal --out {out}": "did you mean 'small'",
    "collect absent.toml --out {out}": "absent.toml",
    "collect small --out {out} --set senser=long": "did you mean 'sensor'",
    "collect small --out {out} --only slid": "did you mean 'slide'",
    "collect small --out {out} --workers 0": "workers",
    "collect small --out {out} --workers 2 --cluster tcp://127.0.0.1:9": "--workers",
    "collect small --out {out} --real-time --workers 2": "--real-time with --workers or --cluster",
    "collect small --out {out} --server x": "--server: allowed is with --real-time",
    # calibrate, build, evaluate
    "calibrate demo --sessions {session} --touches 0 --objects others": "--objects others with --touches 0",
    "calibrate demo --sessions {session} --objects other --out {out}": "'other' is not one of",
    "evaluate": "no sessions to evaluate",
    "evaluate nowhere": "model nowhere",
    "evaluate --dataset nowhere": "dataset",
    "evaluate --sessions nowhere.mcap": "sessions 'nowhere.mcap'",
    f"{DATASET} --sessions x": "--sessions beside --dataset",
    f"{DATASET} --split nowhere.json": "nowhere.json (No such file",
    f"{DATASET} --noise pimk:3": "did you mean 'pink'",
    f"{DATASET} --estimator closed_from": "did you mean 'closed_form'",
    f"{DATASET} --sensor prototipe": "did you mean 'prototype'",
    f"{DATASET} --set sides=both": "an unknown string",
    "build {session} --out {out} --split time --held-out wood": "held-out",
    "build {session} --out {out} --window 100": "window",
    "evaluate demo --sessions {session} --out {out} --split {session}": "--split",
    "evaluate demo --sessions {session} --out {out} --part test": "--part",
    "evaluate demo --sessions {session} --out {out} --dataset {session}": "--dataset",
    "evaluate demo --sessions {session} --out {out} --feature x": "--feature",
    "evaluate demo --sessions {session} --out {out} --seed 1": "--seed",
    "evaluate demo --sessions {session} --suite": "write --suite noise",
    "evaluate demo --sessions {session} --suite --out {out}": "--suite without a name: allowed is noise",
    "evaluate demo --suite nois": "--suite nois",
    "evaluate demo --suite hardware": "python -m studies.hardware_suite",
    "transfer demo": "python -m studies.unseen_builds",
    "ablate features": "python -m studies.ablation",
    "collect builds --out o": "studies/plans/builds.toml",
    "evaluate demo --sessions {session} --out {out} --estimator closed_form": "--estimator",
    # simulate, figure, bench, weights, list
    "simulate": "Missing argument 'PRESET'",
    "simulate apendix": "did you mean 'appendix'?",
    "simulate prototype --model twin --at 0.3": "a touch at 0.3 m: allowed is 0.004 to 0.196 m",
    "simulate prototype --model twin --set materiel=wood": "did you mean 'material'?",
    "simulate appendix --model split_strin": "did you mean 'split_string'?",
    "simulate appendix --route modl": "did you mean 'modal'?",
    "simulate appendix --at 0.65": "position 0.65 m: allowed is strictly between 0 and 0.65 m",
    "simulate appendix --at 0": "position 0 m",
    "simulate appendix --at nan": "position nan m",
    "simulate appendix --force -1": "force -1 N: allowed is 0 N or more",
    "simulate appendix --seconds 0": "0 seconds: allowed is above 0",
    "simulate appendix --seconds 0.001": "allowed is 0.01 s or more",
    COARSE: "below 5.891e-07 s = 0.95 dxi/v on the segment of 0.05 m; --set time_step=5e-07",
    "simulate appendix --untouched --at 0.2": "--untouched with --at or --force",
    "simulate appendix --out touch.mp3": "file 'touch.mp3': allowed is a name that ends in .wav",
    "simulate appendix --out nowhere/touch.wav": "make 'nowhere' first",
    "simulate appendix --set drive.amplitud=1": "did you mean 'amplitude'?",
    "simulate appendix --set mixing=[0.5,0.5] --route modal": "mixing l1 + l2 = 1",
    "figure": "Missing argument",
    "figure trend": "did you mean 'trends'",
    "figure trends --set stps=3": "did you mean 'steps'",
    "figure trends --set steps=few": "steps",
    "figure trends --out a.bmp": ".png, .pdf, .svg",
    "figure trends --out absent/a.png": "a folder that exists",
    "figure trends --set string=apendix": "did you mean 'appendix'",
    "figure trends --model splitstring": "did you mean 'split_string'",
    "figure convergence --model splitstring": "did you mean 'split_string'",
    "bench lve": "did you mean 'live'",
    "bench live --set second=1": "did you mean 'seconds'",
    "bench --set seconds=1": "one NAME with --set",
    "bench model --set sec=1": "option 'sec'",
    "bench realstrings": "python -m studies.real_strings",
    "bench twin": "python -m studies.twin_speed",
    "figure slip": "python -m studies.slip",
    "weights get atst": "did you mean 'ast'",
    "weights export atst --out {out}.onnx": "did you mean 'ast'",
    "list sorces": "did you mean 'sources'",
    "list sources jakc": "source 'jakc': allowed is",
    "simulate appendix --out {out}.wav --at 0.7": "position",
    "simulate appendix --out {out}.wav --at -0.1": "position",
    "simulate appendix --out {out}.wav --force -1": "force",
    "simulate appendix --out {out}.wav --seconds -1": "seconds",
    "simulate appendix --out {out}.wav --untouched --at 0.1": "--untouched",
    "simulate appendix --out {out}.wav --model twin --route fdtd": "route",
    "figure modes --out {out}.png --model twin --set model=split_string": "--model",
    "bench --set size=3": "--set",
    "weights export ast --out {out}.onnx --frames 0": "--frames",
    # sessions
    "sessions import {folder} --out {out}.mcap --radius 0.01": "--radius",
    "sessions import {one} --out {out}.mcap --radius 20": "--radius",
}


@pytest.fixture(scope="module")
def material(small: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Sound of one and of two microphones, silence, a session of two microphones, a folder, a dataset."""
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
    return files | {"session": folder / "session.mcap", "folder": folder, "dataset": small / "dataset"}


@pytest.mark.skipif("yamnet" in FEATURES.names(), reason="monochord-yamnet is installed")
@pytest.mark.parametrize(
    "line",
    [
        "train paper --dataset {dataset} --out {out} --set feature.name=yamnet",
        "weights get yamnet",
        "weights check yamnet",
    ],
)
def test_what_is_a_package_of_its_own_is_told_where_it_is(
    line: str, material: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    given = {**material, "out": tmp_path / "out"}
    assert run([word.format(**given) for word in line.split()]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert error.endswith("pip install ./studies/monochord-yamnet, in the repository\n")


@pytest.mark.parametrize("line", REFUSED)
def test_it_is_refused(
    line: str,
    material: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    given = {**material, "out": tmp_path / "out"}
    assert run([word.format(**given) for word in line.split()]) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("monochord: ")
    assert any(words in captured.err for words in REFUSED[line].format(**given).split("|"))
    assert not list(tmp_path.iterdir())
