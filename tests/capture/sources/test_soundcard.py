import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from monochord.capture.sources._soundcard_stream import SoundcardStream
from monochord.capture.sources.soundcard import Soundcard
from monochord.core.errors import DeviceError, InputError

RATE, BLOCK = 44100, 256


def test_without_a_card_there_is_one_line(capfd: pytest.CaptureFixture[str]) -> None:
    try:
        import sounddevice
    except OSError:
        pytest.skip("PortAudio is not installed (Debian: apt install libportaudio2)")
    if any(card["max_input_channels"] for card in sounddevice.query_devices()):
        pytest.skip("this machine has a sound card")
    with pytest.raises(DeviceError), Soundcard().open():
        pass
    assert capfd.readouterr() == ("", "")


VIRTUAL_CARD = "pcm.!default { type null }\npcm.nothing { type null }\n"
CAPTURE = """
import itertools
from monochord.capture.sources.soundcard import Soundcard
from monochord.core.errors import MonochordError
try:
    with Soundcard(device="theremin").open():
        pass
except MonochordError as error:
    print(error)
with Soundcard(device="nothing").open() as stream:
    for block in itertools.islice(stream, 200):
        print(block.start, block.dropped, *block.samples.shape, block.adc_time is not None)
"""


def test_a_real_stream_runs_on_a_virtual_card(tmp_path: Path) -> None:
    config = tmp_path / "asound.conf"
    config.write_text(VIRTUAL_CARD, encoding="ascii")
    virtual = {**os.environ, "ALSA_CONFIG_PATH": str(config)}

    command = [sys.executable, "-c", CAPTURE]
    run = subprocess.run(command, env=virtual, capture_output=True, text=True, timeout=60, check=False)
    unknown, *lines = run.stdout.splitlines()
    if "'theremin'" not in unknown:
        pytest.skip(f"no virtual card here ({unknown})")
    assert "nothing" in unknown  # the cards that are there
    assert run.returncode == 0, run.stderr
    blocks = [[int(word) for word in line.split()[:4]] for line in lines]
    assert len(blocks) == 200
    assert {tuple(block[2:]) for block in blocks} == {(2, BLOCK)}
    # This card is faster than any reader, so frames are lost; the indices tell all of them.
    assert all(b[0] == a[0] + BLOCK + b[1] for a, b in pairwise(blocks))


def test_without_the_library_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    class Absent:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "sounddevice":
                raise OSError("PortAudio library not found")

    monkeypatch.delitem(sys.modules, "sounddevice", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Absent(), *sys.meta_path])
    with pytest.raises(DeviceError, match="PortAudio"), Soundcard().open():
        pass


@pytest.mark.parametrize(
    ("options", "given"),
    [({"sample_rate": 8000}, "8000"), ({"channels": 65}, "65"), ({"block": 0}, "block' = 0")],
)
def test_options_out_of_range_are_refused(options: dict[str, int], given: str) -> None:
    with pytest.raises(InputError, match=given), Soundcard(**options).open():  # pyright: ignore[reportArgumentType]
        pass


@dataclass
class Times:
    currentTime: float = 0.0  # noqa: N815
    inputBufferAdcTime: float = 0.0  # noqa: N815


@dataclass
class Flags:
    input_overflow: bool = False


def sound(start: int, frames: int = BLOCK) -> np.ndarray:
    return np.stack([np.arange(start, start + frames), -np.arange(start, start + frames)], axis=1).astype(
        np.float32
    )


def test_the_callback_fills_the_ring_in_order() -> None:
    stream = SoundcardStream(RATE, 2)
    for k in range(8):
        stream.capture(sound(k * BLOCK), BLOCK, Times(), Flags())
    assert stream.pending == 8 * BLOCK
    reader = iter(stream)
    got = [next(reader) for _ in range(8)]
    assert [block.start for block in got] == [k * BLOCK for k in range(8)]
    assert np.array_equal(np.concatenate([b.samples for b in got], axis=1), sound(0, 8 * BLOCK).T)
    assert stream.pending == 0
    assert stream.health.frames == 8 * BLOCK
    stream.release()


def test_an_overflow_is_a_gap_as_long_as_the_converter_says() -> None:
    stream = SoundcardStream(RATE, 2)
    stream.capture(sound(0), BLOCK, Times(100.0, 99.99), Flags())
    began = time.monotonic()
    time.sleep(0.05)
    stream.capture(sound(BLOCK), BLOCK, Times(100.05, 100.04), Flags(input_overflow=True))
    slept = time.monotonic() - began
    first, second = (next(iter(stream)) for _ in range(2))
    assert first.dropped == 0
    assert 0.05 * RATE - BLOCK - 1 <= second.dropped <= (slept + 0.01) * RATE - BLOCK
    assert second.start == BLOCK + second.dropped
    health = stream.health
    assert (health.gaps, health.xruns, health.dropped) == (1, 1, second.dropped)
    stream.release()


def test_an_overflow_without_times_is_a_gap_of_a_block_at_least() -> None:
    stream = SoundcardStream(RATE, 2)
    stream.capture(sound(0), BLOCK, Times(), Flags())
    stream.capture(sound(BLOCK), BLOCK, Times(), Flags(input_overflow=True))
    _, second = (next(iter(stream)) for _ in range(2))
    assert second.dropped >= BLOCK
    assert second.adc_time is None
    stream.release()


def test_a_full_ring_is_a_gap_of_exactly_what_was_lost() -> None:
    stream = SoundcardStream(RATE, 2)
    for k in range(600):  # more than the ring's two seconds
        stream.capture(sound(k * BLOCK), BLOCK, Times(), Flags())
    reader = iter(stream)
    blocks = [next(reader) for _ in range(stream.pending // BLOCK)]
    stream.capture(sound(600 * BLOCK), BLOCK, Times(), Flags())
    last = next(reader)
    assert last.start == 600 * BLOCK
    assert last.dropped == (600 - len(blocks)) * BLOCK
    assert last.dropped > 0
    stream.release()


def test_close_ends_the_wait() -> None:
    stream = SoundcardStream(RATE, 2)
    threading.Timer(0.05, stream.close).start()
    assert list(stream) == []
    stream.release()


def test_a_card_that_stopped_is_an_error() -> None:
    stream = SoundcardStream(RATE, 2)
    stream.watch(lambda: False)
    with pytest.raises(DeviceError):
        next(iter(stream))
    stream.release()
