import itertools
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.sessions.made import plain_readings

from monochord.capture.sources.session import SessionSource
from monochord.core.errors import InputError
from monochord.core.types import WRENCH, Block, Feed, StringParams
from monochord.core.windows import windows
from monochord.sessions import Description, SessionClock, SessionWriter

RATE = 44100
STRING = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
CLOCK = SessionClock(epoch_ns=10**18, origin=100.0)


def recorded(*, lost: int = 500) -> list[Block]:
    """Blocks as a device gave them: one lost frame before the first, some in between."""
    rng, blocks, start = np.random.default_rng(1), list[Block](), 0
    for number, frames in enumerate([256, 256, 200, 256, 44100]):
        dropped = {0: 1, 2: lost}.get(number, 0)
        start += dropped
        samples = rng.normal(size=(2, frames)).astype(np.float32)
        at = CLOCK.origin + 0.25 + start / RATE
        blocks.append(Block(samples=samples, start=start, dropped=dropped, adc_time=at))
        start += frames
    return blocks


def write(path: Path, blocks: list[Block], *, close: bool = True, **described: Any) -> SessionWriter:
    fields: dict[str, Any] = {"name": "take", "sample_rate": RATE, **described}
    writer = SessionWriter(path, Description(**fields), CLOCK)
    for block in blocks:
        writer.audio(block)
    if close:
        writer.close()
    return writer


def played(path: Path, **options: Any) -> list[Block]:
    with SessionSource(path=path, **options).open() as stream:
        return list(stream)


@pytest.mark.parametrize("block", [1, 100, 512, 100_000])
def test_frames_keep_their_indices_and_gaps_their_places(tmp_path: Path, block: int) -> None:
    sent = recorded()
    write(tmp_path / "a.mcap", sent)
    got = played(tmp_path / "a.mcap", block=block)
    end = sent[-1].start + sent[-1].samples.shape[1]
    received, expected = np.full((2, end), np.nan, np.float32), np.full((2, end), np.nan, np.float32)
    for blocks, line in ((got, received), (sent, expected)):
        for each in blocks:
            line[:, each.start : each.start + each.samples.shape[1]] = each.samples
    np.testing.assert_array_equal(received, expected)
    assert [(b.start, b.dropped) for b in got if b.dropped] == [
        (b.start, b.dropped) for b in sent if b.dropped
    ]
    assert all(each.samples.shape[1] <= block for each in got)
    assert all(a.start + a.samples.shape[1] + b.dropped == b.start for a, b in itertools.pairwise(got))


def test_windows_are_those_of_the_recording(tmp_path: Path) -> None:
    sent = recorded()
    write(tmp_path / "a.mcap", sent)
    cut: dict[str, int] = {"size": 882, "hop": 309, "sample_rate": RATE}
    live = list(windows(sent, **cut))
    again = list(windows(played(tmp_path / "a.mcap", block=333), **cut))
    assert len(live) == len(again) > 50
    for one, other in zip(live, again, strict=True):
        assert (one.start, one.has_gap) == (other.start, other.has_gap)
        assert one.samples.tobytes() == other.samples.tobytes()


def test_lost_frames_are_counted_and_the_string_is_known(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", recorded(), string=STRING)
    with SessionSource(path=tmp_path / "a.mcap").open() as stream:
        list(stream)
        health = stream.health
        assert stream.signal.string == STRING
    assert (health.frames, health.dropped, health.gaps) == (45068, 501, 2)


def test_it_keeps_the_given_pace(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", recorded())
    began = time.monotonic()
    played(tmp_path / "a.mcap", speed=4.0)
    assert 0.25 < time.monotonic() - began < 2.0


def test_a_session_that_was_cut_off_plays_as_far_as_it_goes(tmp_path: Path) -> None:
    writer = write(tmp_path / "a.mcap", recorded()[:2], close=False)
    writer.flush()
    for block in recorded()[2:]:
        writer.audio(block)
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "a.mcap").read_bytes())
    writer.close()
    assert sum(block.samples.shape[1] for block in played(tmp_path / "cut.mcap")) == 512


def labelled(path: Path, **columns: list[float]) -> SessionSource:
    """A second of sound whose labels lie 0.1 s apart, from 0.05 s on; frame 0 is 0.25 s after the start."""
    writer = write(
        path, [Block(samples=np.zeros((2, RATE), np.float32), start=0, adc_time=100.25)], close=False
    )
    count = len(next(iter(columns.values())))
    times = 100.25 + 0.05 + 0.1 * np.arange(count, dtype=np.float64)
    writer.labels(times, {name: np.array(column) for name, column in columns.items()})
    writer.close()
    return SessionSource(path=path)


def frames(seconds: float) -> int:
    return round(seconds * RATE)


def test_truth_is_labelled_as_datasets_label_a_window(tmp_path: Path) -> None:
    nan = float("nan")
    source = labelled(
        tmp_path / "a.mcap",
        contact=[0, 0, 1, 1, 1, 1],
        position=[nan, nan, 0.1, 0.2, 0.3, nan],
        slip=[0, 0, 0, 1, 1, nan],
        settled=[1, 1, 0, 1, 1, 1],
    )
    with source.open() as stream:
        # Touched from 0.25 s on.
        assert stream.truth(frames(0.2), frames(0.3)) == {"transition": 1.0, "settled": pytest.approx(0.5)}
        touched = stream.truth(frames(0.35), frames(0.55))
        assert touched == {
            "contact": 1.0,
            "transition": 0.0,
            "settled": pytest.approx(1.0, abs=1e-4),
            "position": pytest.approx(0.25, abs=1e-4),
            "slip": 1.0,
        }
        assert "slip" not in stream.truth(frames(0.55), frames(0.65))  # NaN there
        assert stream.truth(frames(0.46), frames(0.48))["position"] == pytest.approx(0.3)
        assert stream.truth(frames(0.8), frames(0.9)) == {}  # after the last label


def test_truth_without_contact_is_what_is_known(tmp_path: Path) -> None:
    with labelled(tmp_path / "a.mcap", settled=[1, 0, 1, 1, 1, 1]).open() as stream:
        assert stream.truth(frames(0.05), frames(0.15)) == {"settled": pytest.approx(1.0)}


def test_without_labels_nothing_is_true(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", recorded())
    with SessionSource(path=tmp_path / "a.mcap").open() as stream:
        assert stream.truth(0, RATE) == {}


def refusal(path: Path, **options: Any) -> str:
    with pytest.raises(InputError) as caught, SessionSource(path=path, **options).open():
        pass
    return str(caught.value)


def test_what_cannot_be_played_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", recorded())
    write(tmp_path / "silent.mcap", [])
    write(tmp_path / "many.mcap", [], channels=3)
    write(tmp_path / "slow.mcap", [], sample_rate=8000)
    (tmp_path / "other.mcap").write_bytes(b"RIFF")
    assert "block 0" in refusal(tmp_path / "a.mcap", block=0)
    assert "speed -1" in refusal(tmp_path / "a.mcap", speed=-1.0)
    assert "0 frames of audio" in refusal(tmp_path / "silent.mcap")
    assert "with 3 channels: allowed is 1 or 2" in refusal(tmp_path / "many.mcap")
    assert "8000" in refusal(tmp_path / "slow.mcap")
    assert "other.mcap" in refusal(tmp_path / "other.mcap")
    assert "No such file" in refusal(tmp_path / "none.mcap")


def tapped(path: Path, late: float) -> Path:
    """Two groups of three taps, heard `late` s after the force notices them; labels are on its clock."""
    feed = Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0)
    taps = np.array([0.5, 0.8, 1.15, 5.0, 5.3, 5.65])
    time = np.arange(6500) / 1000
    force = np.exp(-0.5 * ((time[:, None] - taps - 0.003) / 0.0015) ** 2).sum(axis=1)
    rng = np.random.default_rng(0)
    sound = 1e-4 * rng.standard_normal((2, round(6.5 * RATE)))
    for tap in taps + late:
        first = round(tap * RATE)
        sound[:, first : first + 4000] += (
            np.exp(-np.arange(4000) / 800) * rng.standard_normal((2, 4000)) * 0.1
        )
    description = Description(name="tapped", sample_rate=RATE, feeds=(feed,))
    with SessionWriter(path, description, CLOCK) as writer:
        for start in range(0, sound.shape[1], 4410):
            samples = sound[:, start : start + 4410].astype(np.float32)
            writer.audio(Block(samples=samples, start=start, adc_time=100.0 + start / RATE))
        values = np.zeros((len(time), 6))
        values[:, 2] = force + 0.005 * rng.standard_normal(len(time))
        writer.readings(plain_readings("wrench", 100.0 + time, values, sequence=np.arange(len(time))))
        writer.labels(100.0 + time, {"contact": (time >= 3.0).astype(np.float64)})
    return path


def test_labels_are_on_the_clock_of_the_force(tmp_path: Path) -> None:
    path, late = tapped(tmp_path / "a.mcap", 0.1), 0.1
    onset = round((3.0 + late) * RATE)  # the frame in which the touch that begins at 3 s is heard
    margin = round(0.01 * RATE)
    with SessionSource(path=path).open() as stream:
        assert stream.truth(onset - 2 * margin, onset - margin)["contact"] == 0.0
        assert stream.truth(onset + margin, onset + 2 * margin)["contact"] == 1.0
    with SessionSource(path=path, aligned=False).open() as stream:
        assert stream.truth(onset - 2 * margin, onset - margin)["contact"] == 1.0
