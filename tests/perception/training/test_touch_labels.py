"""`calibrate` refuses labels that no touch has, and saves nothing then."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.twins import sound_of

from monochord.cli import run
from monochord.core.types import Block, Floats
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.sessions import Description, SessionClock, SessionWriter, read_session

RATE = 44100
KILOGRAM = 9.80665
Change = Callable[[Floats, Floats], tuple[Floats, Floats]]
"""From what position and force are to what is written down."""


@pytest.fixture(scope="module")
def touched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of six touches of a build of the twin; it names no string."""
    path = tmp_path_factory.mktemp("touched") / "touched.mcap"
    twin = VirtualSensor("prototype", seed=5, build=131, day=51, world="plausible")
    random = np.random.default_rng(3)
    places = random.permutation(np.linspace(0.06, 0.14, 6)).tolist()
    truth = [*zip(places, np.linspace(0.5, 1.5, 6).tolist(), strict=True)]
    sound, _ = sound_of(twin, 1.0, *(step for touch in truth for step in (touch, 0.8, None, 0.4)))
    time = np.arange(0.0, sound.shape[1] / RATE, 0.01)
    columns = {name: np.full(time.size, np.nan) for name in ("position", "force")}
    columns["contact"] = np.zeros(time.size)
    for number, (position, force) in enumerate(truth):
        held = (time >= 1.3 + 1.2 * number) & (time < 1.8 + 1.2 * number)
        columns["contact"][held], columns["position"][held], columns["force"][held] = 1.0, position, force
    description = Description(name="touched", sample_rate=RATE, simulated=True)
    with SessionWriter(path, description, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        writer.audio(Block(samples=sound, start=0, adc_time=0.0))
        writer.labels(time, columns)
    return path


def relabelled(session: Path, out: Path, change: Change) -> Path:
    """Write a session again, with other labels."""
    read = read_session(session)
    columns = dict(read.labels.columns)
    columns["position"], columns["force"] = change(columns["position"], columns["force"])
    with SessionWriter(out, replace(read.description), read.clock) as writer:
        writer.audio(Block(samples=read.audio.samples[:], start=0, adc_time=0.0))
        writer.labels(read.labels.time, columns)
    return out


def calibrated(session: Path, out: Path, touches: int | None) -> int:
    few = () if touches is None else ("--touches", str(touches))
    return run(["calibrate", "demo", "--sessions", str(session), "--out", str(out), *few])


@pytest.mark.parametrize(
    ("change", "looks_like"),
    [
        pytest.param(lambda x, f: (x, 1e3 / KILOGRAM * f), "grams", id="grams"),
        pytest.param(lambda x, f: (x, f / KILOGRAM), "kilograms", id="kilograms"),
        pytest.param(lambda x, f: (x, -f), "presses", id="negative"),
        pytest.param(lambda x, f: (f, x), "swapped", id="exchanged"),
        pytest.param(lambda x, f: (1e3 * x, f), "millimetres", id="millimetres"),
        pytest.param(lambda x, f: (0.2 - x, f), "other end", id="other end"),
        pytest.param(lambda x, f: (np.roll(x, 120), f), "from the model's", id="rows"),
    ],
)
def test_labels_that_cannot_be_make_no_model(
    change: Change, looks_like: str, touched: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, touches = tmp_path / "mine", 0 if looks_like in ("grams", "other end") else None
    assert calibrated(relabelled(touched, tmp_path / "wrong.mcap", change), out, touches) == 2
    printed = capsys.readouterr()
    assert not out.exists()
    assert printed.out == ""
    assert looks_like in printed.err


@pytest.mark.parametrize("touches", [None, 0])
def test_true_labels_make_one(touches: int | None, touched: Path, tmp_path: Path) -> None:
    assert calibrated(touched, tmp_path / "mine", touches) == 0
    assert (tmp_path / "mine").is_dir()
