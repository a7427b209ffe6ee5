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
from tests.e2e.requirements import link

ROOT = Path(__file__).parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
PROGRAM = """
from pathlib import Path
import sys
import monochord as mc

assert Path(mc.__file__).is_relative_to(sys.argv[1]), mc.__file__
times = []
for update in mc.listen("twin", model="demo", seconds=2.0):
    times.append((update.time, update.position.value, update.position.std))
assert times

model = mc.load("demo")
session = mc.read_session("sessions/hold_000.mcap")
frame = session.to_pandas("wrench")
assert frame.index.is_monotonic_increasing and len(frame) > 100

data = mc.load_dataset("dataset")
x, y, parts = data.arrays("fft_harmonic")
assert x.shape[1] == 300 and all(len(column) == len(x) for column in y.values())
assert {"train", "validation"} <= set(parts.tolist())
assert len(data.torch("train")) > 100

twin = mc.VirtualSensor("prototype", seed=1)
twin.press(0.08, 1.0, material="plastic")
sound, labels = twin.advance(0.2)
twin.release()
rows = mc.features(sound, sensor="prototype")
assert rows.shape[1] == 300
"""


def run(*command: str | Path, folder: Path | None = None, **environment: str) -> str:
    """What a command prints that is run in a folder; it has to succeed."""
    done = subprocess.run(
        command, cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=False
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


@pytest.fixture(scope="module")
def site(wheels: dict[str, Path]) -> Path:
    """A folder into which the wheel is installed, and nothing else."""
    folder = wheels["wheel"].parent / "site"
    run(*PIP, "install", "--no-deps", "--target", folder, wheels["wheel"])
    return folder


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_line_of_the_front_door_runs_from_a_wheel(site: Path, tmp_path: Path) -> None:
    python = [sys.executable, "-P"]
    for line in ("collect small --out sessions", "build sessions --out dataset"):
        run(*python, "-m", "monochord", *line.split(), folder=tmp_path, PYTHONPATH=str(site))
    run(*python, "-c", PROGRAM, site, folder=tmp_path, PYTHONPATH=str(site))
