"""The recipes of CONTRIBUTING.md are complete files: each is added, passes the contracts, and works."""

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from tests.ports import free_ports

from monochord import cli
from monochord.benchmarks import BENCHMARKS
from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.sources import SOURCES
from monochord.core.types import Estimate, Prediction, Signal, StreamHealth, Window
from monochord.core.windows import windows
from monochord.figures import FIGURES
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Run, Update
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.features import FEATURES
from monochord.perception.heads import HEADS
from monochord.physics.simulators import SIMULATORS, Case
from monochord.physics.strings import load_string
from monochord.physics.theory import harmonic_frequencies

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
RECIPES: Mapping[str, str] = dict(
    re.findall(r"^`(src/monochord/[^`]+)`\n\n```\w+\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
)
MODULES = [path for path in RECIPES if path.endswith(".py")]
SIGNAL = Signal(sample_rate=44100, channels=1)

Load = Callable[[str], None]


@pytest.fixture
def load(add: Callable[[str, str, str], Path]) -> Load:
    """Return the function that adds a recipe's module to its folder."""

    def put(path: str) -> None:
        package = ".".join(Path(path).parent.parts[1:])
        add(package, Path(path).stem, RECIPES[path])

    return put


def test_recipes_are_new_files_in_house_style(tmp_path: Path) -> None:
    assert len(RECIPES) == TEXT.count("```python") + TEXT.count("```toml") > 0
    assert not [path for path in RECIPES if (ROOT / path).exists()]
    for path in MODULES:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(RECIPES[path], encoding="utf-8")
    ruff = [sys.executable, "-m", "ruff"]
    settings = ["--no-cache", "--config", str(ROOT / "pyproject.toml"), str(tmp_path)]
    for command in (["check", "--quiet"], ["format", "--check"]):
        run = subprocess.run([*ruff, *command, *settings], capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout + run.stderr


PLUGIN = """
from importlib import import_module
for package in {packages}:
    import_module(package).__path__.append({folder!r} + package)
"""


def test_recipes_pass_the_contracts(tmp_path: Path) -> None:
    """Every contract test of the recipes runs in a process whose plug-in folders hold them."""
    packages = {".".join(Path(path).parent.parts[1:]) for path in MODULES}
    for path in MODULES:
        package = tmp_path / ".".join(Path(path).parent.parts[1:])
        package.mkdir(exist_ok=True)
        (package / Path(path).name).write_text(RECIPES[path], encoding="utf-8")
    plugin = PLUGIN.format(packages=sorted(packages), folder=f"{tmp_path}/")
    (tmp_path / "recipes.py").write_text(plugin, encoding="utf-8")
    names = [Path(path).stem for path in MODULES if not path.startswith("src/monochord/cli/")]
    tests = ["plugins", "sources", "instruments", "sinks", "features", "heads"]
    command = [sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(ROOT)]
    command += ["-p", "recipes", "-p", "no:cacheprovider", "-v", "-k", " or ".join([*names, "file_sink"])]
    command += [str(ROOT / "tests" / "contract" / f"test_{name}.py") for name in tests]
    path = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout[-5000:] + run.stderr[-2000:]
    passed = [line for line in run.stdout.splitlines() if "PASSED" in line]
    for name in names:
        assert any(re.search(rf"[/\[-]{name}\b", line) for line in passed), f"no contract ran for {name}"


def window(level: float, *, has_gap: bool = False) -> Window:
    samples = np.full((1, 4410), level, np.float32)
    return Window(samples=samples, start=0, sample_rate=44100, has_gap=has_gap)


def test_source(load: Load) -> None:
    load("src/monochord/capture/sources/tone.py")
    with SOURCES.build("tone", {"note": "A4", "frames": 1000}).open() as stream:
        assert stream.signal == SIGNAL
        (whole,) = windows(stream, size=1000, hop=1000, sample_rate=44100)
    assert not whole.has_gap
    np.testing.assert_allclose(whole.samples[0], np.sin(2 * np.pi * 440 / 44100 * np.arange(1000)), atol=1e-6)


def test_instrument(load: Load) -> None:
    load("src/monochord/capture/instruments/wrench_text.py")
    (port,) = free_ports(1)
    with (
        INSTRUMENTS.build("wrench_text", {"address": f"127.0.0.1:{port}"}).open() as connection,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        for text in (b"0.1 0 -1.5 0 0 2e-3", b"1 2 3", b"1 2 3 4 5 nan", b"\xff", b"0 0 0 0 0 0"):
            sender.sendto(text, ("127.0.0.1", port))
        values = np.concatenate([part.values for part in connection.poll()])
        assert connection.health.faulty == 3
    np.testing.assert_array_equal(values, [[0.1, 0.0, -1.5, 0.0, 0.0, 2e-3], np.zeros(6)])


def test_sink(load: Load, tmp_path: Path) -> None:
    load("src/monochord/live/sinks/touches.py")
    file = tmp_path / "touches.txt"
    here, away = Estimate(value=0.2, std=0.001, unit="m"), Estimate.abstain("m", "silence")
    with SINKS.build("touches", {"path": str(file)}).open(Run(signal=SIGNAL)) as writer:
        for index, estimate in enumerate([away, here, here, away, here]):
            prediction = Prediction(start=0, time=0.5 * index, estimates={"position": estimate})
            health = StreamHealth()
            writer.write(Update(prediction=prediction, window=window(0), health=health, truth={}, skipped=0))
    assert file.read_text(encoding="utf-8") == "0.500 0.2000\n2.000 0.2000\n"


def test_feature(load: Load) -> None:
    load("src/monochord/perception/features/band_levels.py")
    extract = FEATURES.build("band_levels", {"count": 8}).prepare(SIGNAL, 4410)
    time = np.arange(4410) / 44100
    tones = [[np.sin(2 * np.pi * frequency * time)] for frequency in (250.0, 6000.0)]
    assert extract(np.array(tones, np.float32)).argmax(axis=1).tolist() == [0, 7]


def test_head(load: Load) -> None:
    load("src/monochord/perception/heads/slip_velocity.py")
    task = HEADS.build("slip_velocity", {"hidden": [8]}).task()
    assert (task.label, task.hidden, task.touched) == ("slip_velocity", (8,), True)


def test_estimator(load: Load) -> None:
    load("src/monochord/perception/estimators/loudness.py")
    estimate = ESTIMATORS.build("loudness", {"full_scale": 0.5}).prepare(SIGNAL, 4410)
    assert estimate(window(0.05))["loudness"].value == pytest.approx(-20.0, abs=1e-5)
    for silent in (window(0.0), window(np.nan), window(0.1, has_gap=True)):
        assert not estimate(silent)["loudness"].valid


def test_figure(load: Load, tmp_path: Path) -> None:
    load("src/monochord/figures/mode_shapes.py")
    canvas = FIGURES.build("mode_shapes", {"count": 3}).draw()
    assert len(canvas.axes[0].lines) == 3
    canvas.savefig(tmp_path / "modes.png")


def test_benchmark(load: Load) -> None:
    load("src/monochord/benchmarks/spectrum.py")
    begun = time.perf_counter()
    (row,) = BENCHMARKS.build("spectrum", {"repeats": 3}).run()
    assert 0.0 < row.value < time.perf_counter() - begun
    assert row.ratio is not None


def test_simulator(load: Load) -> None:
    load("src/monochord/physics/simulators/partials.py")
    appendix = load_string("appendix")
    case = Case(string=appendix.string, contact=appendix.usual_contact, seconds=0.5)
    sound = SIMULATORS.build("partials", {"count": 3}).run(case)
    strongest = np.abs(np.fft.rfft(sound.microphones)).argmax(axis=1) / case.seconds
    assert strongest == pytest.approx(sound.summary["theory"], abs=1.0 / case.seconds)


def test_string(tmp_path: Path) -> None:
    path = tmp_path / "plain_011.toml"
    path.write_text(RECIPES["src/monochord/physics/strings/plain_011.toml"], encoding="utf-8")
    preset = load_string(str(path))
    string = preset.string
    (frequency,) = harmonic_frequencies(string.length, string.tension, string.linear_density, 1)
    assert frequency == pytest.approx(preset.open_frequency, rel=1e-3)


def test_command(load: Load, capsys: pytest.CaptureFixture[str]) -> None:
    load("src/monochord/cli/pitch.py")
    assert cli.run(["pitch", "plain_012"]) == 0
    assert capsys.readouterr().out == "329.63 Hz\n"
    assert cli.run(["pitch", "plain_021"]) == 2
    assert "plain_0" in capsys.readouterr().err
