"""Settings for all tests; and a real JACK server of the test's own, with a process that plays into it."""

import fcntl
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import soundfile
from hypothesis import settings
from tests.networks import Networks, NoNetworkError, two_networks
from tests.processor import COMPILED_FOR

from monochord.capture.jack.server import JackServer

# A time limit for each example fails on a machine that is busy, and says nothing of the code.
settings.register_profile("monochord", deadline=None)
settings.load_profile("monochord")

REAL_TIME = (
    "benchmarks/test_live.py", "benchmarks/test_recording.py",
    "capture/dds", "capture/instruments/test_arrivals.py", "capture/instruments/test_net_ft.py",
    "capture/instruments/test_opening.py", "capture/instruments/test_pose_dds.py",
    "capture/instruments/test_pose_udp.py", "capture/jack/test_client.py",
    "capture/recording/test_loop.py", "capture/recording/test_opening.py",
    "capture/recording/test_pumps.py", "capture/sources/test_jack.py",
    "capture/sources/test_soundcard.py", "e2e/faults", "e2e/test_jack.py", "e2e/test_live_jack.py",
    "e2e/test_live_model.py", "e2e/test_live_rates.py", "e2e/test_own_sensor.py", "e2e/test_pipewire.py",
    "e2e/test_record_jack.py", "e2e/test_soak.py",
    "studies/test_encoder_speed.py", "studies/test_fdtd.py",
    "studies/test_feature_speed.py", "studies/test_strings_cost.py", "studies/test_strings_speed.py",
    "studies/test_twin_speed.py",
    "lab/test_net_ft_device.py", "lab/test_player.py", "lab/test_pose_publisher.py", "lab/test_real_time.py",
)  # fmt: skip
"""Files and folders whose tests compare with the clock or need every frame of a real JACK server.

They run one at a time, beside them only what takes time that nothing else wants (Makefile). A single test of
another file that does so has the marker ``real_time`` itself; a test that merely waits, or starts a process,
needs none.
"""

RATE = 44100
SERVERS = 4  # JACK's registry has room for eight on a machine


PLACES = tuple(Path(__file__).parent / name for name in REAL_TIME)


def pytest_report_header() -> str:
    return f"kernels compiled for {COMPILED_FOR.get('NUMBA_CPU_NAME', 'this processor')}"


def _runs_alone(file: Path) -> bool:
    return any(file.is_relative_to(place) for place in PLACES)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no test file whose tests `-m` leaves out: half of what a run spends before its first test."""
    chosen = config.option.markexpr
    if collection_path.suffix != ".py" or not chosen.endswith("real_time") or " or " in chosen:
        return None
    if chosen.endswith("not real_time"):
        return _runs_alone(collection_path) or None
    return None if _runs_alone(collection_path) or "real_time" in collection_path.read_text("utf-8") else True


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that run in real time."""
    files = {item.path for item in items}
    alone = {file for file in files if _runs_alone(file)}
    for item in items:
        if item.path in alone:
            item.add_marker("real_time")


@pytest.fixture
def networks() -> Iterator[Networks]:
    """Two networks of this test's own; it is skipped where none can be made."""
    with ExitStack() as stack:
        try:
            made = stack.enter_context(two_networks())
        except NoNetworkError as error:
            pytest.skip(str(error))
        yield made


@contextmanager
def own_name() -> Generator[str]:
    """A server name that no other run uses now; taken again later, it clears away what a kill left behind."""
    with ExitStack() as stack:
        for slot in range(SERVERS):
            path = Path(tempfile.gettempdir(), f"monochord-jack-{slot}.lock")
            lock = stack.enter_context(path.open("w", encoding="ascii"))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            name = f"monochord-test-{slot}"
            for process in psutil.process_iter(["name", "cmdline"]):
                words = process.info["cmdline"] or ()  # none of a process that has ended meanwhile
                if process.info["name"] == "jackd" and name in " ".join(words).split():
                    process.kill()  # of a run that was killed: the lock says that no other has this name
                    process.wait(5.0)
            yield name
            return
        pytest.fail(f"{SERVERS} runs of these tests have a JACK server each; wait for one to end")


@contextmanager
def own_server(period: int = 512) -> Generator[JackServer]:
    """A running server of the test's own; the test is skipped where none can be started."""
    if not shutil.which("jackd"):
        pytest.skip("jackd is not installed (Debian: apt install jackd2)")
    with own_name() as name, JackServer(name, period=period) as server:
        yield server


@pytest.fixture
def jack_server(request: pytest.FixtureRequest) -> Iterator[JackServer]:
    """A running server; parametrise indirectly with the frames a period."""
    with own_server(getattr(request, "param", 512)) as server:
        yield server


Play = Callable[..., psutil.Process]


@pytest.fixture(scope="session")
def players() -> Iterator["subprocess.Popen[str]"]:
    """The process that forks a player for each line that it reads: what a player imports takes a second."""
    script = Path(__file__).with_name("play_file.py")
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, str(script)], stdin=pipe, stdout=pipe, text=True) as process:
        yield process
        process.kill()


@pytest.fixture
def play(jack_server: JackServer, players: "subprocess.Popen[str]") -> Iterator[Play]:
    """Return the function that starts a process playing a file, which begins once it is connected.

    Its ports are ``player:out_1`` and, for two channels, ``player:out_2``. Terminate it to take them away.
    """
    started: list[psutil.Process] = []

    def start(file: Path, name: str = "player") -> psutil.Process:
        assert players.stdin
        assert players.stdout
        players.stdin.write(json.dumps([str(file), jack_server.name, name]) + "\n")
        players.stdin.flush()
        started.append(psutil.Process(int(players.stdout.readline())))
        return started[-1]

    yield start
    jack_server.stop()  # players end with their server
    psutil.wait_procs(started, timeout=20)
    assert not any(process.is_running() for process in started)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A second and a half of two microphones on a string of stiff partials that die away."""
    file, t, rng = tmp_path / "recording.wav", np.arange(3 * RATE // 2) / RATE, np.random.default_rng(0)
    partials = [n * 196.0 * np.sqrt(1 + 1e-4 * n * n) for n in range(1, 16)]
    sound = sum(np.sin(2 * np.pi * f * t) * np.exp(-f * t / 200) / 15 for f in partials)
    both = np.stack([sound, 0.7 * sound], axis=1) + 1e-3 * rng.standard_normal((t.size, 2))
    soundfile.write(file, both, RATE, subtype="FLOAT")
    return file


TOUCHES_A_SESSION, TUNE, LENGTH = 12, 400.0, 0.2
LEARNABLE = 16000  # its sample rate, in Hz


def sung(number: int) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return sound, times and labels of two segments that ring as physics has it; seconds of touch and rest.

    Pressing raises the tension, as the day does too, and what hums below; sliding hisses.
    """
    rng = np.random.default_rng(number)
    time = np.arange(200 * TOUCHES_A_SESSION) / 100
    which, touched = (time / 2.0).astype(int), (time % 2.0 >= 1.0).astype(float)
    nan = np.where(touched > 0.0, 0.0, np.nan)
    place = rng.uniform(0.05, 0.15, TOUCHES_A_SESSION)[which]
    force = rng.uniform(0.1, 2.0, TOUCHES_A_SESSION)[which]
    slides = (rng.permutation(TOUCHES_A_SESSION) % 2)[which] * touched
    pull = TUNE * (1.0 + 0.02 * rng.uniform(-1.0, 1.0)) * (1.0 + 0.05 * force * touched)
    each = LEARNABLE // 100
    sound: list[np.ndarray] = []
    for segment in (place, LENGTH - place):
        pitch = np.repeat(np.where(touched > 0.0, pull * LENGTH / segment, pull), each)
        tone = 0.1 * np.sin(2.0 * np.pi * np.cumsum(pitch) / LEARNABLE)
        hum = np.sin(2.0 * np.pi * 220.0 * np.arange(tone.size) / LEARNABLE)
        tone += np.repeat(0.002 * 10.0 ** (0.5 * force * touched), each) * hum
        hiss = rng.standard_normal(tone.size) * np.repeat(0.003 + 0.02 * slides, each)
        sound.append(tone + hiss)
    labels = {"contact": touched, "position": place + nan, "force": force + nan, "slip": slides + nan}
    return np.stack(sound).astype(np.float32), time, labels


def sing(file: Path, number: int, *, bias: float | np.ndarray = 0.0, seconds: int = 24, **about: Any) -> Path:
    """Write the session of `sung` of that number, or its beginning; `bias` is added to its forces."""
    from monochord.core.types import Block
    from monochord.sessions import Description, SessionClock, SessionWriter

    samples, time, labels = sung(number)
    labels["force"] = labels["force"] + bias
    description = Description(name=file.stem, sample_rate=LEARNABLE, simulated=True, **about)
    with SessionWriter(file, description, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        writer.audio(Block(samples=samples[:, : seconds * LEARNABLE], start=0, adc_time=0.0))
        rows = slice(seconds * 100)
        writer.labels(time[rows], {name: values[rows] for name, values in labels.items()})
    return file


def shared(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """Return a folder that the first of the workers who ask for it fills; it is to be read alone."""
    base = factory.getbasetemp()
    folder = (base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base) / name
    with folder.with_suffix(".lock").open("w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.is_dir():
            part = folder.with_suffix(".part")
            shutil.rmtree(part, ignore_errors=True)
            part.mkdir()
            make(part)
            part.rename(folder)
    return folder


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the two sessions of the plan small, and their dataset, split by time."""
    from monochord.datasets.build import build_dataset
    from monochord.datasets.split import split_dataset
    from monochord.lab.assignment import assignments
    from monochord.lab.offline import make
    from monochord.lab.plans import load_plan

    def fill(home: Path) -> None:
        sessions = [make(session, home).path for session in assignments(load_plan("small"))]
        dataset = build_dataset(sessions, home / "dataset")
        split_dataset(dataset, by="time").write(dataset.path / "split.json")

    return shared(tmp_path_factory, "small", fill)


@pytest.fixture(scope="session")
def learnable(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of eight sessions from which position, force, contact and slip can be learned in seconds."""
    return shared(tmp_path_factory, "learnable", make_learnable) / "dataset"


def make_learnable(home: Path) -> None:
    from monochord.datasets.build import BuildOptions, build_dataset
    from monochord.datasets.split import split_dataset

    files = [sing(home / f"sung_{number}.mcap", number) for number in range(8)]
    dataset = build_dataset(files, home / "dataset", BuildOptions())
    split_dataset(dataset, fractions=(0.5, 0.25, 0.25)).write(dataset.path / "split.json")


@pytest.fixture(scope="session")
def reseal() -> Callable[[Path], None]:
    """Return what makes the checksums of a dataset, and its split, those of the files that are there now."""
    from monochord.datasets.checksums import file_sums
    from monochord.datasets.manifest import FILE, file_checksum

    def sealed(folder: Path) -> None:
        text, file = json.loads((folder / FILE).read_text()), folder / "split.json"
        text["files"] = {name: asdict(file_sums(folder / name)) for name in text["files"]}
        (folder / FILE).write_text(json.dumps(text))
        if file.is_file():
            split = json.loads(file.read_text()) | {"dataset": file_checksum(folder / FILE)}
            file.write_text(json.dumps(split))

    return sealed


@pytest.fixture
def made_up_features(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Put the features of ``tests/made_up_features`` beside Monochord's own, for the length of a test."""
    from monochord.perception import features

    folder = Path(__file__).with_name("made_up_features")
    monkeypatch.setattr(features, "__path__", [*features.__path__, str(folder)])
    yield
    for file in folder.glob("*.py"):
        sys.modules.pop(f"monochord.perception.features.{file.stem}", None)
        if hasattr(features, file.stem):
            delattr(features, file.stem)


LESSON: dict[str, Any] = {
    "title": "a small run for tests",
    "feature": {"name": "bands"},
    "heads": {
        "contact": {},
        "slip": {},
        "position": {"hidden": [24, 24, 24]},
        "force": {"hidden": [24, 24, 24]},
    },
    "optimiser": {"rate": 5e-3, "decay": 1e-2, "batch": 64, "epochs": 40},
}


@pytest.fixture
def lesson(learnable: Path) -> dict[str, Any]:
    """Settings of a training run on `learnable`, as plain values; all runs share the rows of features."""
    return {**LESSON, "dataset": str(learnable), "cache": str(learnable.parent / "features")}


@pytest.fixture
def lesson_run(
    lesson: dict[str, Any], made_up_features: None, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The folder of a whole training run of `lesson`, to be read alone."""
    pytest.importorskip("torch")
    from monochord.perception.training.settings import TrainingSettings
    from monochord.perception.training.train import train

    def fill(home: Path) -> None:
        train(TrainingSettings.read(lesson), home / "run")

    return shared(tmp_path_factory, "lesson", fill) / "run"
