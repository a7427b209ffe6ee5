"""The package as a user has it: built, and installed in a folder that is not the checkout."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from zipfile import ZipFile

import pytest
import soundfile
from tests.conftest import Play
from tests.e2e.requirements import link

import monochord as mc
from monochord.capture.jack.server import JackServer

ROOT = Path(__file__).parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
BLOCK_HEAD = """
from pathlib import Path
import sys
import numpy as np
import monochord as mc

assert Path(mc.__file__).is_relative_to(sys.prefix), mc.__file__
"""
CORE = """
twin = mc.VirtualSensor("prototype", seed=1)
for update in mc.listen(twin, model="demo"):  # advances it a hop an update
    if update.time == 0.3:
        twin.press(0.08, 1.0)
    update.position.value, float(update.force), update.events, update.notes
    update.tracked.position, update.truth
    if update.time == 1.0:
        break
assert abs(update.position.value - 0.08) < 1e-3 and abs(float(update.force) - 1.0) < 0.5, str(update)
sound, labels = twin.advance(0.5)
for update in mc.listen(sound, sample_rate=44100, sensor="prototype"):
    assert abs(update.position.value - 0.08) < 1e-3

model = mc.load("demo")
table = model.predict(sound, sample_rate=44100)  # a row a window
assert len(table) == 41 and not any(name in sys.modules for name in ("torch", "pandas", "matplotlib"))
try:
    table.to_pandas()
except mc.InputError as error:
    line = str(error)
assert "requires pandas >= 2.2. Install it: " in line and "pip install" in line and "\\n" not in line, line

sessions = mc.collect("quick", out="sessions")
data = mc.build(sessions, out="dataset")
report = mc.evaluate(model, data)
report.table()
model.save("mine")
assert mc.load("mine").definition == model.definition
next(mc.listen(sessions[0].path, model="mine"))

twin = mc.VirtualSensor("prototype", seed=2)
known = mc.Description(name="touches", sample_rate=44100, string=twin.sensor.string, simulated=True)
with mc.SessionWriter(Path("touches.mcap"), known) as writer:
    for position, force in [(0.06, 0.5), (0.08, 1.0), (0.1, 1.5), (0.12, 0.8)]:
        for press in (True, False):
            twin.press(position, force) if press else twin.release()
            start, (sound, labels) = round(twin.time * 44100), twin.advance(0.7)
            time = writer.clock.origin + (start + np.arange(sound.shape[1])) / 44100
            writer.audio(mc.Block(samples=sound, start=start, adc_time=time[0]))
            columns = {name: labels[name][::44] for name in ("contact", "position", "force", "slip")}
            writer.labels(time[::44], columns)
better = mc.calibrate(model, "touches.mcap")
assert better.calibration.heads["force"].touches == 4
next(mc.listen("touches.mcap", model="demo"))

rows = mc.features(sound)
assert len(rows.columns) == rows.shape[1] == 300

try:
    mc.load("demmo")
except mc.InputError as error:
    told = error.given, error.expected, error.remedy
assert "demmo" in told[0] and "demo" in told[1], told
model = mc.train(data, out="without", settings=["noise.copies=0"])
assert model.epochs == 0 and model.left_out.endswith("https://download.pytorch.org/whl/cpu"), model.left_out
assert len(mc.load("without").predict(sound)) == 61
try:
    mc.train(data, out="run", settings=['methods=["network"]'])
except mc.InputError as error:
    line = str(error)
assert "requires torch >= 2.6. Install it: " in line and "\\n" not in line, line
"""
JACK = """
for update in mc.listen("jack", seconds=0.3):  # the server's own inputs: silence
    assert not update.contact.valid
try:
    mc.tune("jack", sensor="prototype", seconds=0.5)
except mc.InputError as error:
    assert "silen" in str(error), str(error)
pitch = mc.tune("jack", ports="player:.*", sensor="prototype").measurement.estimate("open_frequency")
assert abs(pitch.value - OPEN) < 2.0 * pitch.std < 5.0, pitch  # 1 Hz is missed: docs/ROADMAP.md
for update in mc.listen("jack", ports="player:.*", seconds=0.5):
    assert update.adc_time
with mc.record("take.mcap", source="jack") as recording:
    pass
assert mc.read_session("take.mcap").complete and recording.summary
"""
PANDAS = """
table = mc.load("demo").predict(mc.VirtualSensor("prototype", seed=1).advance(0.5)[0], sample_rate=44100)
frame = table.to_pandas()
assert len(frame) == len(table) == 41 and "position" in frame
assert len(mc.read_session("sessions/hold_000.mcap").to_pandas("wrench")) > 100
"""
TRAIN = """
data = mc.load_dataset("dataset")
model = mc.train(data, out="run", settings=["optimiser.epochs=3"])
report = mc.evaluate(model, data)
print(report.table())
model.save("trained")
assert len(data.torch("train")) > 100
sound = mc.VirtualSensor("prototype", seed=1).advance(0.5)[0]
assert len(mc.load("trained").predict(sound, sample_rate=44100)) == 41
"""


def run(*command: str | Path, folder: Path | None = None, **environment: str) -> str:
    """What a command prints that is run in a folder; it has to succeed."""
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        command, cwd=folder, env=own | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-1000:]} {done.stderr[-3000:]}"
    return done.stdout


def built_from(source: Path, folder: Path) -> Path:
    """The wheel that is built from a checkout or an sdist, in a new folder."""
    run(*PIP, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, source)
    (wheel,) = folder.glob("monochord-*.whl")
    return wheel


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sdist of the checkout."""
    out = tmp_path_factory.mktemp("sdist")
    run(sys.executable, "-m", "hatchling", "build", "--target", "sdist", "--directory", out, folder=ROOT)
    (file,) = out.glob("monochord-*.tar.gz")
    return file


@pytest.fixture(scope="module")
def wheels(sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The wheels of the checkout and of the sdist."""
    sources = {"wheel": ROOT, "sdist": sdist}
    return {name: built_from(source, tmp_path_factory.mktemp(name)) for name, source in sources.items()}


def in_checkout() -> set[str]:
    """Every file of the package that git would keep, as `monochord/...`."""
    listed = run("git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard", "src/monochord")
    return {line.removeprefix("src/") for line in listed.splitlines() if (ROOT / line).exists()}


@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_a_wheel_holds_every_file_of_the_package_and_none_beside(wheels: dict[str, Path], kind: str) -> None:
    names = ZipFile(wheels[kind]).namelist()
    assert {name for name in names if ".dist-info/" not in name} == in_checkout()


def test_the_sdist_holds_the_package_and_no_studies(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = [Path(*Path(name).parts[1:]) for name in archive.getnames()]
    assert {str(name.relative_to("src")) for name in names if name.parts[0] == "src"} == in_checkout()
    others = {str(name) for name in names if name.parts[0] != "src"}
    assert {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md"} <= others
    assert not {name for name in others if name.startswith(("studies", "tests", "."))} - {".gitignore"}


@pytest.fixture(scope="module", params=["wheel", "sdist"])
def environment(
    request: pytest.FixtureRequest, wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A virtual environment that holds a wheel and what it requires.

    Both kinds stand in one folder in turn, with the same times of files: what the first compiled, the second
    need not.
    """
    venv = tmp_path_factory.getbasetemp() / "venv"
    shutil.rmtree(venv, ignore_errors=True)
    run(sys.executable, "-m", "venv", "--without-pip", venv)
    (site,) = venv.glob("lib/python3*/site-packages")
    link("monochord", site, itself=False)
    run(*PIP, "--python", venv / "bin/python", "install", "--no-index", "--no-compile", wheels[request.param])
    for path in (site / "monochord").rglob("*.py"):
        os.utime(path, (0, 0))
    return venv


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_an_empty_environment_simulates_and_locates(environment: Path, tmp_path: Path) -> None:
    def monochord(*arguments: str) -> str:
        cache = str(environment.parent / "kernels")
        return run(environment / "bin/monochord", *arguments, folder=tmp_path, NUMBA_CACHE_DIR=cache)

    with pytest.raises(AssertionError, match="No module named 'pytest'"):
        run(environment / "bin/python", "-c", "import pytest")
    assert "prototype" in monochord("list")
    monochord("simulate", "appendix", "--at", "0.2275", "--seconds", "0.5", "--out", "touch.wav")
    lines = monochord("locate", "touch.wav", "--string", "appendix", "--json").splitlines()
    positions = [found["position"] for found in map(json.loads, lines) if found["valid"]]
    assert positions
    assert all(abs(position - 0.2275) < 2e-3 for position in positions), positions
    monochord(
        "simulate", "prototype", "--model", "twin", "--at", "0.08", "--seconds", "1", "--out", "twin.wav"
    )
    monochord("live", "demo", "twin.wav", "--sink", "csv=estimates.csv")
    rows = (tmp_path / "estimates.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) > 80


@pytest.mark.slow
@pytest.mark.jack
@pytest.mark.timeout(900)
@pytest.mark.parametrize("environment", ["wheel"], indirect=True)
def test_every_line_of_the_front_door_runs_from_a_wheel(
    environment: Path, tmp_path: Path, jack_server: JackServer, play: Play
) -> None:
    def python(program: str, **values: object) -> None:
        given = "".join(f"{name} = {value!r}\n" for name, value in values.items())
        place = {
            "NUMBA_CACHE_DIR": str(environment.parent / "kernels"),
            "JACK_DEFAULT_SERVER": jack_server.name,
        }
        run(environment / "bin/python", "-P", "-c", BLOCK_HEAD + given + program, folder=tmp_path, **place)

    (site,) = environment.glob("lib/python3*/site-packages")
    python(CORE)
    link("pandas", site)
    python(PANDAS)
    link("torch", site)
    python(TRAIN)
    twin = mc.VirtualSensor("prototype", seed=3)
    soundfile.write(tmp_path / "untouched.wav", twin.advance(10.0)[0].T, twin.sample_rate, subtype="FLOAT")
    play(tmp_path / "untouched.wav")
    python(JACK, OPEN=mc.open_frequency(twin.sensor.string))
