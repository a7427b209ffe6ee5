"""The front door as a user has it: from a wheel, in a folder that is not the checkout."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
from pathlib import Path
import sys
import monochord as mc

assert Path(mc.__file__).is_relative_to(sys.argv[1]), mc.__file__
times = []
for prediction in mc.listen("twin", model="demo", seconds=2.0):
    times.append((prediction.time, prediction["position"].value, prediction["position"].std))
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


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the wheel is installed, and nothing else."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    subprocess.run(
        [*pip, "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, ROOT], check=True
    )
    (wheel,) = folder.glob("monochord-*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", folder / "site", wheel], check=True)
    return folder / "site"


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_every_line_of_the_front_door_runs_from_a_wheel(site: Path, tmp_path: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(site)}
    python = [sys.executable, "-P"]
    for line in ("collect small --out sessions", "build sessions --out dataset"):
        command = [*python, "-m", "monochord", *line.split()]
        subprocess.run(command, cwd=tmp_path, env=environment, check=True, capture_output=True)
    ran = subprocess.run(
        [*python, "-c", PROGRAM, site],
        cwd=tmp_path,
        env=environment,
        check=False,
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0, ran.stderr
