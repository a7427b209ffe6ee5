"""The session reader: `sessions check`, `show` and `recover`."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from tests.fuzz.base import Input, Target, command, given_file, taken_from

from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Block, Feed, Readings
from monochord.sessions import Description, SessionClock, SessionWriter, read_session, recover

RATE = 16000
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0, ticks=7000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0, ticks=1e9),
    Feed(stream="oven", columns=("temperature", "time"), units=("K", ""), details={"address": "here"}),
)


def write_session(path: Path, seed: int, *, feeds: tuple[Feed, ...] = FEEDS, close: bool = True) -> Path:
    """Write a session of some 50 ms with a gap, in six chunks, with one of everything that a session has."""
    random = np.random.default_rng(seed)
    description = Description(
        name=path.stem,
        sample_rate=RATE,
        channels=2,
        simulated=True,
        feeds=feeds,
        day=seed,
        object="made",
        material="steel",
    )
    writer = SessionWriter(path, description, SessionClock(epoch_ns=10**18, origin=5.0))
    for k in range(6):
        start, now = 160 * k + 80 * (k > 3), 5.0 + 0.01 * k
        samples = np.round(random.standard_normal((2, 160)), 1).astype(np.float32)
        writer.audio(
            Block(samples=samples, start=start, dropped=80 * (k == 4), adc_time=now, frame_time=start)
        )
        for feed in feeds:
            values = np.round(random.standard_normal((3, len(feed.columns))), 1)
            count = np.arange(3 * k, 3 * k + 3)
            time = now + 0.003 * np.arange(3.0)
            writer.readings(
                Readings(
                    stream=feed.stream, time=time, values=values, sequence=count, device_time=count * 7 + 1,
                    status=np.zeros(3, np.uint32),
                )
            )  # fmt: skip
        writer.labels(
            now + 0.002 * np.arange(4.0),
            {"contact": np.array([0.0, 1.0, 1.0, 0.0]), "position": np.full(4, 0.08)},
        )
        writer.event(now, "phase", "press", n=k, soft=True)
        writer.clocks(now, {"realtime": 1.5e9 + k, "jack": 0.25})
        writer.flush()
    if close:
        writer.close()
    else:
        writer._file.close()
    return path


def readable(path: Path) -> int:
    """Return how many messages can be read, 0 where it is no session."""
    count = 0
    with suppress(Exception):
        session = read_session(path)
        count = sum(1 for topic in session.topics for _ in session.messages(topic))
    return count


class Fuzz(Target):
    """Open, check, show; recover, after which as much is there as before, and nothing is left to do."""

    def seeds(self, folder: Path) -> Iterator[Input]:
        for number, feeds in enumerate((FEEDS, (), FEEDS[:1])):
            for close in (True, False):
                path = write_session(folder / "take.mcap", number, feeds=feeds, close=close)
                yield taken_from(folder)
                if not close:
                    recover(path)
                    yield taken_from(folder)
                path.unlink()

    def run(self, folder: Path) -> None:
        file = given_file(folder, "take.mcap")
        before = readable(file)
        refused: InputError | None = None
        for arguments in (("check",), ("show", "--json"), ("recover", "--json")):
            try:
                command("sessions", arguments[0], file, *arguments[1:])
            except InputError as error:
                refused = error
            else:
                if arguments[0] == "recover":
                    assert readable(file) >= before, "recover lost messages"
                    again = json.loads(command("sessions", "recover", file, "--json"))
                    assert not again["repaired"], "recover found something to do twice"
                    with suppress(InputError):
                        command("sessions", "check", file)
        if refused:
            raise refused
