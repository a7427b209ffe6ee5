"""Repairs a session that was cut off, where it lies: what is whole is kept, an ending is put after it."""

import os
from dataclasses import dataclass
from pathlib import Path

from monochord.errors import InputError
from monochord.sessions import walk
from monochord.sessions._contents import contents
from monochord.sessions._ending import ending_after
from monochord.sessions.reader import read_session
from monochord.units import Seconds

TORN = 8 << 20
"""Bytes of one writing, at most."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """What became of a session: whether anything had to be done, and what was kept.

    `seconds` is the length of the audio. `lost_bytes` were cut away, or lie damaged where they were.
    """

    path: Path
    repaired: bool
    messages: int
    seconds: Seconds
    lost_bytes: int


def recover(path: Path) -> Recovery:
    """Repair a session in place; one that was closed is left as it is.

    All up to the last sound record is kept, bit for bit; of a chunk that is damaged before that, no index
    tells, so that readers pass it over. Behind come the index that every MCAP reader looks for and a note
    that the session was repaired. No more than an ending is written, so a full disk hardly matters; what is
    cut away was not whole, so nothing is lost that could be read. Only where that is more than a writing that
    was torn, as where the length of a record is damaged, it is kept beside as ``NAME.mcap.cut``.

    Raises
    ------
    InputError
        If the file is not there, no session, or cannot be written.
    """
    read_session(path)
    view = walk.mapped(path)
    size = len(view)
    found = contents(view)
    lost = found.damaged + (0 if found.ended else size - found.end)
    if not found.ended:
        ending = ending_after(found, lost)
        rest = bytes(view[found.end :]) if size - found.end > TORN else b""
        view.release()
        try:
            if rest:
                path.with_name(f"{path.name}.cut").write_bytes(rest)
            with path.open("r+b") as file:
                # What is not whole goes first: on a full disk its place is what the ending takes.
                file.truncate(found.end)
                file.seek(found.end)
                file.write(ending)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise InputError(f"file {path} ({error.strerror})", "a file that can be written") from error
    audio = read_session(path).audio
    return Recovery(
        path=path,
        repaired=not found.ended,
        messages=sum(found.counts.values()),
        seconds=audio.samples.shape[1] / audio.sample_rate,
        lost_bytes=lost,
    )
