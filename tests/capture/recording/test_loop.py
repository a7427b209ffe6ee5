"""The recorder on a paced file and a simulated force sensor over real sockets, read back from disk."""

import json
import os
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.ports import free_ports

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.recording import RecordingJob, RecordingSubject, RecordingSummary, record
from monochord.capture.recording.streams import NamedInstrument
from monochord.capture.sources.base import Source, Stream
from monochord.core.clock import clock_offsets
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Audio, Block, Signal
from monochord.sessions import SessionReader, check, read_session

RATE = 44100


def samples_of(file: Path) -> Audio:
    return soundfile.read(file, always_2d=True)[0].T.astype(np.float32)


def recorded(job: RecordingJob) -> tuple[RecordingSummary, SessionReader]:
    """Record, and read the session, which must be whole and say what the summary says."""
    summary = record(job)
    report = check(job.path)
    assert report.sound, report.faults
    session = read_session(job.path)
    assert session.complete
    assert summary.size == job.path.stat().st_size
    gaps = session.audio.gaps
    assert (len(gaps), sum(stop - first for first, stop in gaps)) == (summary.gaps, summary.dropped)
    assert session.audio.samples.shape[1] == summary.frames + summary.dropped
    for feed in summary.instruments.values():
        assert len(session.readings(feed.stream).time) == feed.readings
    assert json.loads(json.dumps(summary.tree()))["frames"] == summary.frames
    assert not [thread.name for thread in threading.enumerate() if thread.name.startswith("record")]
    return summary, session


def kinds(session: SessionReader) -> list[str]:
    return [event.kind for event in session.events]


def test_a_session_holds_every_frame_as_it_was(make_job: Any, sound: Path) -> None:
    summary, session = recorded(make_job(source={"speed": 0.0, "repeat": 1}))
    assert (summary.stopped, summary.failure) == ("the source ended", "")
    assert (summary.frames, summary.dropped, dict(summary.flags)) == (2 * RATE, 0, {})
    assert np.array_equal(session.audio.samples, samples_of(sound))
    assert kinds(session) == ["stop"]


def test_a_kill_leaves_all_that_had_been_written(make_job: Any, tmp_path: Path) -> None:
    left = list[tuple[int, bytes]]()
    job = make_job(seconds=0.5)
    record(job, lambda now, _notices: left.append((now.frames, job.path.read_bytes())))
    killed = tmp_path / "killed.mcap"
    for frames, content in left:
        killed.write_bytes(content)
        assert read_session(killed).audio.samples.shape[1] == frames
    assert left[-1][0] > left[0][0] > 0


def test_audio_and_force_are_on_one_clock(make_job: Any, force: Any, sound: Path) -> None:
    device, instrument = force(rate=7000.0)
    job = make_job(instruments={"net_ft": instrument}, seconds=1.2, about=RecordingSubject(object="plastic"))
    begin = time.monotonic()
    device.begin_at(begin)
    summary, session = recorded(job)
    assert summary.stopped == "the time is over"
    assert session.description.object == "plastic"
    assert not summary.flags
    wrench = session.readings("wrench")
    assert wrench.missing == summary.instruments["net_ft"].missing == 0
    assert summary.instruments["net_ft"].rate == pytest.approx(7000.0, rel=0.15)
    assert wrench.time[0] >= 0.0
    # The ramp rises by 7 N a second from `begin` on, so that each reading tells when it was made.
    late = wrench.time + session.clock.origin - begin - wrench.column("fz") / 7.0
    assert np.median(late) == pytest.approx(0.0, abs=0.01)
    # A paced file knows when its first frame would have been heard.
    assert np.array_equal(session.audio.samples[:, :RATE], samples_of(sound)[:, :RATE])
    assert session.audio.time(RATE) - session.audio.time(0) == pytest.approx(1.0, abs=1e-6)
    assert 0.0 <= session.audio.time(0) < 1.0
    assert session.clocks.offsets["realtime"][0] == pytest.approx(clock_offsets()["realtime"], abs=0.05)


def test_clipped_samples_and_nan_are_stored_and_reported(make_job: Any, tmp_path: Path) -> None:
    samples = np.full((RATE, 2), 0.25, np.float32)
    samples[1000:1010, 0] = 32767 / 32768  # 16 bits at full scale
    samples[1020:1030, 0] = 0.99
    samples[2000:2003, 1] = np.nan
    samples[2003, 1] = -np.inf
    soundfile.write(tmp_path / "bad.wav", samples, RATE, subtype="FLOAT")
    job = make_job(tmp_path / "bad.wav", source={"speed": 20.0, "repeat": 1})
    summary, session = recorded(job)
    assert (summary.clipped, summary.not_numbers) == ((10, 0), (0, 4))
    assert summary.peak == pytest.approx((32767 / 32768, 0.25))
    assert np.array_equal(session.audio.samples, samples.T, equal_nan=True)
    assert set(kinds(session)) == {"clipping", "nan", "stop"}
    assert dict(summary.flags) == {"clipping": 1, "nan": 1}


def test_a_disk_that_cannot_keep_up_loses_nothing_of_a_patient_source(make_job: Any, sound: Path) -> None:
    # The queue has space for one block only, and is emptied ten times a second.
    job = make_job(queue_bytes=1, seconds=0.8, source={"block": 512})
    summary, session = recorded(job)
    assert summary.flags["disk_slow"] >= 1
    frames = summary.frames
    assert 512 < frames < RATE
    assert np.array_equal(session.audio.samples, samples_of(sound)[:, :frames])


@dataclass(frozen=True, slots=True, kw_only=True)
class GoneSource(Source):
    """Yields `blocks` and then fails, as a server does that comes back at another rate."""

    blocks: int = 20

    @contextmanager
    def open(self) -> Generator[Stream]:
        yield _Gone(self.blocks)


class _Gone(Stream):
    def __init__(self, blocks: int) -> None:
        self._blocks = blocks

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=RATE, channels=2)

    def __iter__(self) -> Iterator[Block]:
        for k in range(self._blocks):
            yield Block(samples=np.zeros((2, 512), np.float32), start=512 * k, adc_time=time.monotonic())
        raise DeviceError("JACK server came back at 48000 Hz: expected 44100 Hz, as before; open it anew")


def test_a_source_that_is_gone_for_good_ends_it_with_a_valid_file(tmp_path: Path, force: Any) -> None:
    _, instrument = force()
    job = RecordingJob(path=tmp_path / "take.mcap", source=GoneSource(), instruments={"net_ft": instrument})
    summary, session = recorded(job)
    assert "48000 Hz" in summary.failure
    assert summary.frames == 20 * 512
    assert summary.flags["failed"] == 1
    assert "failed" in kinds(session)


def test_without_its_devices_no_file_is_left(make_job: Any, force: Any) -> None:
    device, instrument = force()
    device.close()
    job = make_job(instruments={"net_ft": instrument})
    with pytest.raises(DeviceError):
        record(job)
    with pytest.raises(InputError, match="absent"):
        record(make_job(Path("absent.wav")))
    assert not job.path.exists()


def test_two_streams_of_one_given_name_are_refused(make_job: Any, force: Any) -> None:
    named = [NamedInstrument(instrument=force()[1], stream="left") for _ in range(2)]
    job = make_job(instruments={"first": named[0], "second": named[1]})
    with pytest.raises(InputError, match="left"):
        record(job)
    assert not job.path.exists()


def test_instruments_of_a_kind_have_streams_of_their_own(make_job: Any) -> None:
    addresses = {f"pose_{port}": f"127.0.0.1:{port}" for port in free_ports(3)}
    instruments = {name: INSTRUMENTS.build("pose_udp", {"address": at}) for name, at in addresses.items()}
    _, session = recorded(make_job(instruments=instruments, seconds=0.2))
    assert session.streams == ("pose", "pose_2", "pose_3")


def test_its_priority_is_raised_where_permitted_and_restored(make_job: Any) -> None:
    before, seen = os.getpriority(os.PRIO_PROCESS, 0), list[int]()
    record(make_job(seconds=0.2), lambda _now, _notices: seen.append(os.getpriority(os.PRIO_PROCESS, 0)))
    assert os.getpriority(os.PRIO_PROCESS, 0) == before
    assert max(seen) <= (-11 if os.geteuid() == 0 else before)


def test_it_ends_when_the_job_is_finished(make_job: Any) -> None:
    begun = list[float]()

    def finished(now: float) -> bool:
        begun.append(now)
        return now - begun[0] >= 0.3

    summary, _ = recorded(replace(make_job(), finished=finished))
    assert summary.stopped == "the time is over"
    assert 0.3 <= summary.seconds < 10.0
