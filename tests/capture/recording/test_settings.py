from pathlib import Path
from typing import Any

import pytest

from monochord.capture.recording import DiskLimits, RecordingSettings, RecordingSubject
from monochord.core.errors import InputError
from monochord.core.types import Feed, Signal, StringParams

TREE: dict[str, Any] = {
    "source": {"name": "wav", "path": "take.wav"},
    "instruments": {"net-ft": {"address": "10.0.0.1", "bias": True}},
    "about": {"object": "plastic", "sensor": "prototype", "radius": 0.004},
    "disk": {"warn": 60.0},
    "seconds": 5.0,
}
SIGNAL = Signal(sample_rate=44100, channels=2)


def test_settings_become_a_job() -> None:
    job = RecordingSettings.read(TREE).job(Path("out.mcap"))
    assert type(job.source).__name__ == "Wav"
    (instrument,) = job.instruments.values()
    assert list(job.instruments) == ["net_ft"]
    assert (getattr(instrument, "address"), getattr(instrument, "bias")) == ("10.0.0.1", True)  # noqa: B009
    assert (job.seconds, job.disk.warn, job.disk.start) == (5.0, 60.0, 100e6)


@pytest.mark.parametrize(
    ("change", "given"),
    [
        ({"source": {}}, "source"),
        ({"source": {"name": "wave"}}, "wave"),
        ({"instruments": {"netft": {}}}, "netft"),
        ({"instruments": {"net_ft": {"adress": "x"}}}, "adress"),
        ({"about": {"objekt": "x"}}, "objekt"),
        ({"about": {"sensor": "prototyp"}}, "prototyp"),
        ({"seconds": 0.0}, "0"),
        ({"disk": {"start": 1.0, "stop": 2.0}}, "stop"),
    ],
)
def test_what_cannot_be_is_refused(change: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given):
        RecordingSettings.read({**TREE, **change}).job(Path("out.mcap"))
    with pytest.raises(InputError, match=r"take\.wav"):
        RecordingSettings.read(TREE).job(Path("take.wav"))


def test_a_session_tells_what_it_is_of() -> None:
    feed = Feed(stream="pose", columns=("x",), units=("m",))
    about = RecordingSubject(
        object="plastic", material="pla", radius=0.004, sensor="prototype", note="first", day=2
    )
    description = about.describe("take", SIGNAL, (feed,))
    assert (description.name, description.object, description.material) == ("take", "plastic", "pla")
    assert (description.radius, description.notes, description.day) == (0.004, "first", 2)
    assert description.feeds == (feed,)
    assert description.sensor["name"] == "prototype"
    assert description.string is not None
    assert not description.simulated


def test_a_source_that_knows_its_string_is_a_simulation() -> None:
    string = StringParams(length=0.2, linear_density=1e-3, tension=50.0)
    signal = Signal(sample_rate=44100, channels=2, string=string)
    assert RecordingSubject().describe("take", signal, ()).simulated
    assert RecordingSubject().describe("take", signal, ()).string == string
    assert RecordingSubject(simulated=True).describe("take", SIGNAL, ()).simulated


def test_the_disk_may_fill_as_far_as_one_says() -> None:
    assert DiskLimits(start=0.0, stop=0.0).stop == 0.0
    with pytest.raises(InputError, match="-1"):
        DiskLimits(stop=-1.0)
