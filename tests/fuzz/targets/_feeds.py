"""What the targets that are fed live have in common: readings are polled, recorded and read again."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from monochord.capture.instruments.base import Instrument
from monochord.sessions import Description, SessionClock, SessionWriter, check, read_session


def recorded(
    instrument: Instrument, path: Path, *, max_readings: int, feed: Callable[[], None] = lambda: None
) -> None:
    """Poll an instrument while it is fed; all that it gave, and no more than it was sent, is in a session."""
    path.unlink(missing_ok=True)
    count = 0
    with instrument.open() as connection:
        description = Description(name="take", sample_rate=16000, feeds=(connection.feed,))
        with SessionWriter(path, description, SessionClock.now()) as writer:
            for _ in range(4):
                feed()
                time.sleep(0.002)
                for readings in connection.poll():
                    count += len(readings.time)
                    writer.readings(readings)
                writer.flush()
        health = connection.health
    track = read_session(path).readings(connection.feed.stream)
    assert len(track.time) == count == health.readings <= max_readings, "readings lost or made up"
    assert check(path).sound, "what was recorded is not sound"
    assert not np.isinf(track.values).any(), "a reading that is infinite"
    assert track.missing >= 0, "less than nothing is missing"
    path.unlink()
