import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.capture.sources.wav import Wav
from monochord.core.errors import InputError
from monochord.core.types import Audio, Block

RATE = 44100


def noise(frames: int, channels: int = 2) -> Audio:
    return 0.1 * np.random.default_rng(frames).standard_normal((channels, frames), np.float32)


def write(path: Path, samples: Audio, rate: int = RATE, subtype: str | None = None) -> Path:
    soundfile.write(path, samples.T, rate, subtype=subtype)
    return path


def blocks(path: Path, **options: Any) -> list[Block]:
    with Wav(path=path, **options).open() as stream:
        return list(stream)


def audio(path: Path, **options: Any) -> Audio:
    return np.concatenate([block.samples for block in blocks(path, **options)], axis=1)


@pytest.mark.parametrize(("channels", "block"), [(1, 1), (2, 100), (2, 4096)])
def test_floating_point_comes_back_bit_for_bit(tmp_path: Path, channels: int, block: int) -> None:
    sent = noise(1234, channels)
    file = write(tmp_path / "a.wav", sent, subtype="FLOAT")
    got = blocks(file, block=block)
    assert np.array_equal(np.concatenate([b.samples for b in got], axis=1), sent)
    assert [b.start for b in got] == list(range(0, 1234, block))
    assert all(b.samples.dtype == np.float32 and b.adc_time is None and not b.dropped for b in got)


@pytest.mark.parametrize("name", ["a.flac", "a.wav"])
def test_sixteen_bits_come_back_to_the_last_one(tmp_path: Path, name: str) -> None:
    sent = noise(5000)
    steps = np.clip(np.round(sent * 32768), -32768, 32767).astype(np.int16)
    soundfile.write(tmp_path / name, steps.T, RATE, subtype="PCM_16")
    assert np.array_equal(audio(tmp_path / name), steps.astype(np.float32) / 32768)


def test_the_signal_is_the_files(tmp_path: Path) -> None:
    with Wav(path=write(tmp_path / "a.wav", noise(10, 1), rate=96000)).open() as stream:
        assert (stream.signal.sample_rate, stream.signal.channels) == (96000, 1)
        assert stream.pending == 0
        assert list(stream)
        assert stream.health.frames == 10


def test_samples_that_are_not_numbers_pass(tmp_path: Path) -> None:
    sent = noise(600)
    sent[0, 100:200] = np.nan
    file = write(tmp_path / "a.wav", sent, subtype="FLOAT")
    assert np.array_equal(audio(file), sent, equal_nan=True)


@pytest.mark.parametrize("block", [7, 512])
def test_repeating_runs_on_without_a_seam(tmp_path: Path, block: int) -> None:
    sent = noise(1000)
    got = blocks(write(tmp_path / "a.wav", sent, subtype="FLOAT"), block=block, repeat=3)
    assert np.array_equal(np.concatenate([b.samples for b in got], axis=1), np.tile(sent, 3))
    assert got[-1].start + got[-1].samples.shape[1] == 3000
    assert all(b.samples.shape[1] == block for b in got[:-1])


def test_real_time_pace_with_stamps(tmp_path: Path) -> None:
    file = write(tmp_path / "a.wav", noise(RATE // 2))
    began = time.monotonic()
    with Wav(path=file, speed=1.0).open() as stream:
        for block in stream:
            now = time.monotonic()
            assert block.adc_time is not None
            assert now >= block.adc_time + block.samples.shape[1] / RATE - 1e-6
    assert time.monotonic() - began >= 0.5


def test_twenty_times_real_time_pace(tmp_path: Path) -> None:
    file, began = write(tmp_path / "a.wav", noise(2 * RATE)), time.monotonic()
    assert all(block.adc_time is None for block in blocks(file, speed=20.0))
    assert 0.1 <= time.monotonic() - began < 1.9


def test_a_late_reader_sees_what_is_pending(tmp_path: Path) -> None:
    with Wav(path=write(tmp_path / "a.wav", noise(RATE)), speed=1.0).open() as stream:
        reader = iter(stream)
        next(reader)
        time.sleep(0.1)
        assert 0.08 * RATE < stream.pending < RATE
        assert stream.pending % 512 == 0
        reader.close()  # pyright: ignore[reportAttributeAccessIssue]


def cut(path: Path, part: float) -> Path:
    content = path.read_bytes()
    path.write_bytes(content[: int(part * len(content))])
    return path


@pytest.mark.parametrize("name", ["a.wav", "a.flac"])
@pytest.mark.parametrize("part", [0.3, 0.999])
def test_a_truncated_file_is_refused_or_read_as_far_as_it_goes(
    tmp_path: Path, name: str, part: float
) -> None:
    sent = noise(RATE, 1)
    whole = audio(write(tmp_path / name, sent))
    file = cut(tmp_path / name, part)
    with pytest.raises(InputError, match=name):
        audio(file)
    got = audio(file, allow_truncated=True)
    assert 0.7 * part < got.shape[1] / RATE < min(1.1 * part, 1.0)
    assert np.array_equal(got, whole[:, : got.shape[1]])


@pytest.mark.parametrize("name", ["a.mp3", "a.ogg", "a.aiff"])
@pytest.mark.parametrize("part", [0.3, 0.999])
def test_other_formats_that_are_cut_are_refused_or_read(tmp_path: Path, name: str, part: float) -> None:
    file = write(tmp_path / name, noise(4 * RATE, 1))
    whole = audio(file)
    assert abs(whole.shape[1] - 4 * RATE) < 2000  # an mp3 begins a little late
    assert np.array_equal(audio(file), whole)
    with pytest.raises(InputError, match="truncated"):
        audio(cut(file, part))
    assert 0 < audio(file, allow_truncated=True).shape[1] < whole.shape[1]


@pytest.mark.parametrize(
    ("suffix", "kind"), [("wav", "MP3"), ("raw", "WAV"), ("sd2", "OGG"), ("vox", "AIFF"), ("txt", "MP3")]
)
def test_the_content_of_a_file_says_what_it_is(tmp_path: Path, suffix: str, kind: str) -> None:
    path = tmp_path / f"a.{suffix}"
    with path.open("wb") as file:
        soundfile.write(file, noise(RATE, 1).T, RATE, format=kind)
    assert abs(audio(path).shape[1] - RATE) < 2000


@pytest.mark.parametrize("suffix", ["raw", "sd2", "vox", "mp3"])
def test_a_suffix_makes_no_sound_of_a_text(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a.{suffix}"
    text(path)
    with pytest.raises(InputError, match="wav, flac, mp3, ogg, aiff"):
        audio(path)


def test_a_file_that_was_written_to_a_pipe_is_whole(tmp_path: Path) -> None:
    file = write(tmp_path / "a.wav", noise(1000))
    content = bytearray(file.read_bytes())
    for at in (4, content.index(b"data") + 4):
        content[at : at + 4] = b"\xff\xff\xff\xff"
    file.write_bytes(content)
    assert audio(file).shape == (2, 1000)


def test_a_large_files_header_is_understood(tmp_path: Path) -> None:
    sent = noise(1000)
    soundfile.write(tmp_path / "a.wav", sent.T, RATE, format="RF64", subtype="FLOAT")
    assert np.array_equal(audio(tmp_path / "a.wav"), sent)


def test_a_flac_stream_that_does_not_say_its_length_is_refused_or_read(tmp_path: Path) -> None:
    file = write(tmp_path / "a.flac", noise(5120))
    content = bytearray(file.read_bytes())
    total = 4 + 4 + 13  # in STREAMINFO: 36 bits
    content[total] &= 0xF0
    content[total + 1 : total + 5] = bytes(4)
    file.write_bytes(content)
    with pytest.raises(InputError):
        audio(file)
    assert audio(file, allow_truncated=True).shape[1] > 4000


@pytest.mark.parametrize("allow_truncated", [False, True])
def test_a_damaged_file_fails_where_the_damage_is_reached(tmp_path: Path, *, allow_truncated: bool) -> None:
    file = write(tmp_path / "a.flac", noise(RATE))
    whole, content = audio(file), bytearray(file.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 200] = b"\x55" * 200
    file.write_bytes(content)
    if allow_truncated:
        got = audio(file, allow_truncated=True)
        assert np.array_equal(got, whole[:, : got.shape[1]])
    else:
        with pytest.raises(InputError, match=r"a\.flac"):
            audio(file)


def test_a_truncated_file_repeats_what_it_has(tmp_path: Path) -> None:
    file = cut(write(tmp_path / "a.flac", noise(RATE)), 0.5)
    once = audio(file, allow_truncated=True)
    assert np.array_equal(audio(file, allow_truncated=True, repeat=2), np.tile(once, 2))


def unfinished(path: Path, kind: str) -> np.ndarray:
    """Write a file as it stands where its recorder died, and return the samples that are in it."""
    samples = noise(3000)
    form = kind if kind in ("RF64", "AIFF") else "WAV"
    endian = "BIG" if kind == "RIFX" else "FILE"
    soundfile.write(path, samples.T, RATE, subtype="FLOAT", format=form, endian=endian)
    content = bytearray(path.read_bytes())
    if kind == "junk":
        content[12:12] = b"JUNK" + (28).to_bytes(4, "little") + bytes(28)
    at = content.index(b"SSND" if kind == "AIFF" else b"data") + 4
    content[4:8] = content[at : at + 4] = b"\xff" * 4 if kind == "RF64" else bytes(4)
    if kind == "RF64":
        content[20:44] = bytes(24)
    path.write_bytes(content[:-5] if kind == "torn" else content)
    return samples[:, : -1 if kind == "torn" else None]


@pytest.mark.parametrize("kind", ["RIFF", "RIFX", "RF64", "junk", "torn", "AIFF"])
def test_what_a_recorder_left_that_died_is_refused_or_read(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "a.wav"
    samples = unfinished(path, kind)
    before = path.read_bytes()
    with pytest.raises(InputError) as caught:
        blocks(path)
    assert "--allow-truncated" in caught.value.remedy
    assert np.array_equal(audio(path, allow_truncated=True), samples)
    assert np.array_equal(audio(path, allow_truncated=True, repeat=2), np.tile(samples, 2))
    assert path.read_bytes() == before


def test_a_file_without_sound_but_with_notes_is_not_an_unfinished_one(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    soundfile.write(path, np.zeros((0, 2)), RATE)
    path.write_bytes(path.read_bytes() + b"LIST" + (8).to_bytes(4, "little") + b"INFOabcd")
    with pytest.raises(InputError):
        blocks(path, allow_truncated=True)


def text(path: Path) -> None:
    path.write_text("this is not sound\n" * 20, encoding="ascii")


def header_only(path: Path) -> None:
    path.write_bytes(b"RIFF\x00\x00\x00\x00WAVE")


@pytest.mark.parametrize(
    ("make", "given"),
    [
        (lambda _: None, ""),
        (lambda path: path.mkdir(), ""),
        (lambda path: path.touch(), ""),
        (text, "b'this'"),
        (header_only, ""),
        (lambda path: write(path, noise(0)), "0 frames"),
        (lambda path: write(path, noise(99, 3)), "3 channels"),
        (lambda path: write(path, noise(99), rate=8000), "8000"),
        (lambda path: write(path, noise(99), rate=384000), "384000"),
    ],
)
def test_what_cannot_be_used_is_one_line(tmp_path: Path, make: Any, given: str) -> None:
    make(tmp_path / "a.wav")
    for allow_truncated in (False, True):
        with pytest.raises(InputError) as caught:
            audio(tmp_path / "a.wav", allow_truncated=allow_truncated)
        assert given in str(caught.value)
        assert "a.wav" in caught.value.given
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "given"),
    [({"block": 0}, "0"), ({"speed": -1.0}, "-1"), ({"speed": float("nan")}, "nan"), ({"repeat": -1}, "-1")],
)
def test_options_out_of_range_are_refused(tmp_path: Path, options: Any, given: str) -> None:
    with pytest.raises(InputError, match=given):
        blocks(write(tmp_path / "a.wav", noise(99)), **options)
