"""What a program types first: import monochord as mc."""

import asyncio
import re
import subprocess
import sys
from doctest import SKIP, DocTestParser
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.sessions.made import plain_readings

import monochord as mc
from monochord.core.types import WRENCH, Block, Feed
from monochord.sessions import Description, SessionClock, SessionWriter

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def touched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of a pressed virtual sensor, as a file."""
    twin = mc.VirtualSensor("prototype", seed=1)
    twin.advance(0.3)
    twin.press(0.08, 1.0, material="plastic")
    twin.advance(0.3)
    sound, _ = twin.advance(0.5)
    path = tmp_path_factory.mktemp("sound") / "touched.wav"
    soundfile.write(path, sound.T, twin.sample_rate, subtype="FLOAT")
    return path


def test_every_name_of_the_front_door_is_there() -> None:
    assert all(getattr(mc, name) is not None for name in mc.__all__)
    assert set(mc.__all__) == set(dir(mc))
    with pytest.raises(AttributeError, match="listne"):
        _ = mc.listne  # pyright: ignore[reportAttributeAccessIssue]


def test_every_name_of_the_front_door_has_an_example() -> None:
    names = set(mc.__all__) - {"__version__"}
    examples = {name: DocTestParser().get_examples(getattr(mc, name).__doc__) for name in names}
    run = {name for name, found in examples.items() if any(not each.options.get(SKIP) for each in found)}
    assert run == names


@pytest.mark.parametrize("page", ["docstring", "docs/reference/python.md"])
def test_the_front_door_shows_its_names_by_group(page: str) -> None:
    if page == "docstring":
        shown = re.findall(r"`(\w+)`", str(mc.__doc__))
    else:
        table = (ROOT / page).read_text(encoding="utf-8").partition("## Names")[2].partition("\n## ")[0]
        shown = re.findall(r"`mc\.(\w+)`", table)
    assert sorted(shown) == sorted(set(mc.__all__) - {"__version__"})


def test_types_and_base_classes_load_no_kernels() -> None:
    names = "Source Instrument Feature Head Estimator Sink Block Window Estimate Contact InputError"
    code = (
        "import sys, monochord as mc\n"
        f"assert all(getattr(mc, name) for name in {names.split()})\n"
        "print({'numba', 'scipy', 'torch', 'matplotlib', 'pandas'} & set(sys.modules))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"


def test_the_same_comes_of_it_asynchronously(touched: Path) -> None:
    async def first(count: int) -> list[float]:
        values: list[float] = []
        async for update in mc.listen_async(touched, "demo", string="prototype"):
            values.append(update.position.value)
            if len(values) == count:
                break
        return values

    same = [update.position.value for update in islice(mc.listen(touched, string="prototype"), 5)]
    assert asyncio.run(first(5)) == same


def test_a_session_becomes_arrays_and_frames(tmp_path: Path) -> None:
    feed = Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3)
    description = Description(name="take", sample_rate=16000, simulated=True, feeds=(feed,))
    with SessionWriter(
        tmp_path / "take.mcap", description, SessionClock(epoch_ns=10**18, origin=0.0)
    ) as writer:
        writer.audio(Block(samples=np.full((2, 1600), 0.5, np.float32), start=0, adc_time=0.0))
        count = np.arange(3)
        writer.readings(plain_readings("wrench", 0.01 * count, np.outer(count, np.ones(6)), sequence=count))
    session = mc.read_session(tmp_path / "take.mcap")
    assert session.to_pandas("wrench")["fz"].tolist() == [0.0, 1.0, 2.0]
    audio = session.to_numpy("audio")
    assert audio["mic_2"].tolist() == [0.5] * 1600
    assert audio["time"][-1] == pytest.approx(1599 / 16000)


def test_features_of_audio_are_those_of_its_windows(touched: Path) -> None:
    samples, rate = soundfile.read(touched, dtype="float32")
    sound = np.asarray(samples.T, np.float32)
    rows = mc.features(sound, sensor="prototype", sample_rate=rate)
    assert rows.shape == (41, 300)
    assert np.array_equal(rows[7], mc.features(sound[:, 7 * 441 : 7 * 441 + 4410], sensor="prototype")[0])


@pytest.mark.usefixtures("made_up_features")
def test_a_dataset_becomes_arrays_with_labels_and_parts(learnable: Path) -> None:
    data = mc.load_dataset(learnable)
    x, y, parts = data.arrays("bands")
    assert set(parts.tolist()) == {"train", "validation", "test"}
    assert x.shape[0] == len(parts) == len(y["contact"])
    touched_rows = y["contact"] == 1.0
    assert np.isfinite(y["position"][touched_rows]).all()
    pytest.importorskip("torch")
    part = data.torch("train", "bands")
    assert len(part) == int((parts == "train").sum())
    assert np.array_equal(part[0][0].numpy(), x[parts == "train"][0])


def test_the_virtual_sensor_follows_commands_step_by_step() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    twin.press(0.08, 1.0, material="plastic")
    sound, labels = twin.advance(0.3)
    assert sound.shape == (2, 13230)
    assert labels["contact"][0] == 0.0
    assert labels["force"][-1] == pytest.approx(1.0, abs=0.05)
    twin.slide(0.5, along=0.03)
    _, labels = twin.advance(0.5)
    assert labels["position"][-1] == pytest.approx(0.095, abs=1e-4)
    assert labels["slip"].mean() > 0.9
    other = twin.press(0.15, 0.5, material="wood")
    twin.advance(0.3)
    twin.change(2.0, touch=other)
    _, labels = twin.advance(0.3)
    assert labels["contacts"][-1] == 2.0
    assert labels["force"][-1] == pytest.approx(2.0, abs=0.1)
    twin.release()
    assert twin.advance(0.3)[1]["contact"][-1] == 0.0
