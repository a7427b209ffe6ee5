"""What every form that sessions are exported to promises."""

from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Block, Feed, Readings
from monochord.sessions import Description, SessionClock, SessionReader, SessionWriter, check, read_session
from monochord.sessions.exports import EXPORTS, form_of

RATE = 16000
each_form = pytest.mark.parametrize("form", EXPORTS.names())


def session(path: Path, seed: int = 0) -> SessionReader:
    feed = Feed(stream="wrench", columns=("fx",), units=("N",), rate=100.0)
    description = Description(name=path.stem, sample_rate=RATE, feeds=(feed,))
    with SessionWriter(path, description, SessionClock(epoch_ns=10**18)) as writer:
        noise = np.random.default_rng(seed).standard_normal((2, RATE)).astype(np.float32)
        writer.audio(Block(samples=noise[:, :1000], start=0, adc_time=0.0))
        writer.audio(Block(samples=noise[:, 1000:], start=1100, dropped=100, adc_time=1100 / RATE))
        time = np.arange(100) / 100
        none, fine = np.full(100, -1), np.zeros(100, np.uint32)
        values = time[:, None]
        writer.readings(
            Readings(stream="wrench", time=time, values=values, sequence=none, device_time=none, status=fine)
        )
        writer.labels(time, {"contact": np.ones(100)})
    return read_session(path)


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@each_form
def test_it_tells_every_file_that_it_writes_and_leaves_the_sessions_alone(form: str, tmp_path: Path) -> None:
    takes = [session(tmp_path / "a.mcap"), session(tmp_path / "b.mcap", seed=1)]
    before = [take.path.read_bytes() for take in takes]
    written = EXPORTS.build(form).write(takes, tmp_path / "new" / "out")
    assert sorted(written) == sorted(p for p in (tmp_path / "new" / "out").rglob("*") if p.is_file())
    assert [take.path.read_bytes() for take in takes] == before


@each_form
def test_the_same_sessions_make_the_same_samples(form: str, tmp_path: Path) -> None:
    takes = [session(tmp_path / "a.mcap")]
    for name in ("one", "two"):
        EXPORTS.build(form).write(takes, tmp_path / name)
    one, two = content(tmp_path / "one"), content(tmp_path / "two")
    assert set(one) == set(two)
    # A WAV file of floats bears the second in which it was written.
    assert all(one[name] == two[name] for name in one if not name.endswith(".wav"))


@each_form
def test_what_is_there_is_never_written_over(form: str, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="not empty"):
        EXPORTS.build(form).write([session(tmp_path / "a.mcap")], tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["mine.txt"]


@each_form
def test_a_place_that_cannot_be_a_folder_is_refused(form: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="file"):
        EXPORTS.build(form).write([session(tmp_path / "a.mcap")], tmp_path / "file" / "out")


@each_form
def test_it_reads_back_all_or_says_that_it_cannot(form: str, tmp_path: Path) -> None:
    take = session(tmp_path / "a.mcap")
    EXPORTS.build(form).write([take], tmp_path / "out")
    try:
        EXPORTS.build(form).read(tmp_path / "out" / "a", tmp_path / "again.mcap")
    except InputError:
        assert not (tmp_path / "again.mcap").exists()
        return
    assert form_of(tmp_path / "out" / "a") == form
    again = read_session(tmp_path / "again.mcap")
    assert again.audio.samples.tobytes() == take.audio.samples.tobytes()
    assert again.audio.gaps == take.audio.gaps == ((1000, 1100),)
    assert check(tmp_path / "again.mcap").sound
    with pytest.raises(InputError, match="exists"):
        EXPORTS.build(form).read(tmp_path / "out" / "a", tmp_path / "again.mcap")
