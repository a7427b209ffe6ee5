"""Options that have no effect beside others, or no physical meaning: status 2, one line, nothing written."""

from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.cli import run
from monochord.core.types import Block
from monochord.physics.strings import load_string
from monochord.sessions import Description, SessionClock, SessionWriter

STRING = "--length 0.65 --open-frequency 110"
SAVED = "--sink jsonl={out} --save-config {out}.toml"
TABLE = {
    # live and locate
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
    # demo
    "demo --seconds 0": "--seconds",
    "demo --seed -1": "--seed",
    # record
    "record {out}.mcap --source wav --set source.path={one} --radius 20": "--radius",
    "record {out}.mcap --source wav --set source.path={one} --set pose_udp.rate=5": "--instrument pose_udp",
    "record {out}.mcap --source wav --set source.path={one} --instrument a:udp=0 --instrument a:udp=1": "'a'",
    "record {out}.mcap --source wav --set source.path={one} --instrument a-b:udp=0 --set a_b.stream=c": "'c'",
    "record {out}.mcap --source wav --set source.path={one} --instrument disk:udp=0": "'disk'",
    "record {out}.mcap --source wav --set source.path={one} --instrument udp:pose_udp=0": "'udp'",
    "record {out}.mcap --source wav --set source.path={one} --instrument audio:pose_udp=0": "'audio'",
    "record {out}.mcap --source wav --set source.path={one} --instrument wrench:pose_udp=0": "'wrench'",
    "record {out}.mcap --source wav --set source.path={one} --instrument :pose_udp=0": "stream ''",
    # collect
    "collect small --out {out} --workers 2 --cluster tcp://127.0.0.1:9": "--workers",
    "collect small --out {out} --real-time --workers 2": "--workers",
    "collect small --out {out} --server x": "--server",
    # build, evaluate
    "build {session} --out {out} --split time --held-out wood": "held-out",
    "build {session} --out {out} --window 100": "window",
    "evaluate demo --sessions {session} --out {out} --split {session}": "--split",
    "evaluate demo --sessions {session} --out {out} --part test": "--part",
    "evaluate demo --sessions {session} --out {out} --dataset {session}": "--dataset",
    "evaluate demo --sessions {session} --out {out} --feature x": "--feature",
    "evaluate demo --sessions {session} --out {out} --seed 1": "--seed",
    "evaluate demo --sessions {session} --out {out} --estimator closed_form": "--estimator",
    # simulate, figure, bench, weights
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
def material(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Sound of one and of two microphones, a session of two microphones, and a folder."""
    folder = tmp_path_factory.mktemp("material")
    tone = 0.3 * np.sin(2.0 * np.pi * 500.0 * np.arange(22050) / 44100)
    soundfile.write(folder / "one.wav", tone, 44100, subtype="FLOAT")
    soundfile.write(folder / "two.wav", np.stack([tone, tone], axis=1), 44100, subtype="FLOAT")
    string = load_string("prototype").string
    about = Description(name="session", sample_rate=44100, simulated=True, string=string)
    with SessionWriter(folder / "session.mcap", about, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        writer.audio(Block(samples=np.stack([tone, tone]).astype(np.float32), start=0, adc_time=0.0))
    found = {name: folder / f"{name}.wav" for name in ("one", "two")}
    return found | {"session": folder / "session.mcap", "folder": folder}


@pytest.mark.parametrize("line", TABLE)
def test_it_is_refused(
    line: str, material: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    given = {**material, "out": tmp_path / "out"}
    assert run([word.format(**given) for word in line.split()]) == 2
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("monochord: ")
    assert TABLE[line].format(**given) in captured.err
    assert not list(tmp_path.iterdir())
