"""Real recordings of instruments with known string and fret: a fret is a contact at a known position.

The recordings are not part of Monochord. They are looked for in the folder that MONOCHORD_REALSTRINGS names;
`folder` returns None where there are none.
"""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Hertz, Metres, Samples

SCALE: Metres = 0.65
"""Length that positions are quoted on; the instruments' own scales differ by a few mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """One recording. `position` is that of the fret, from the nut on a string of `SCALE`; NaN if unknown."""

    path: Path
    instrument: str
    string: str
    kind: str
    position: Metres
    frequency: Hertz

    def read(self) -> tuple[Audio, int]:
        """Return samples (channels, n) and the sample rate."""
        import soundfile  # noqa: PLC0415

        samples, rate = soundfile.read(self.path, dtype="float32", always_2d=True)
        return np.ascontiguousarray(samples.T, np.float32), int(rate)


def folder() -> Path | None:
    """Return the folder of the recordings, or None."""
    named = os.environ.get("MONOCHORD_REALSTRINGS")
    return Path(named) if named and (Path(named) / "manifest.csv").is_file() else None


def takes(*, kind: str | None = None, labelled: bool = False) -> list[Take]:
    """Return the recordings that the manifest lists, by file name; empty where there are none.

    Parameters
    ----------
    kind
        Only this kind: "plucked", "bowed", "slide", "interference" ...
    labelled
        Only those with known string and fret.
    """
    home = folder()
    if home is None:
        return []
    with (home / "manifest.csv").open(newline="", encoding="utf-8") as lines:
        found = [_take(home, row) for row in csv.DictReader(lines)]
    wanted = [
        take
        for take in found
        if kind in (None, take.kind) and (not labelled or (take.string and np.isfinite(take.position)))
    ]
    return sorted(wanted, key=lambda take: take.path)


def onset(samples: Audio) -> Samples:
    """Return the first frame that reaches a tenth of the peak of the first channel.

    >>> onset(np.array([[0.0, 0.01, -0.5, 1.0]], np.float32))
    2
    """
    level = np.abs(samples[0])
    return int(np.argmax(level >= 0.1 * level.max()))


def _take(home: Path, row: dict[str, str]) -> Take:
    path = home / row["file"]
    share = float(row["x_over_L"] or "nan")
    return Take(
        path=path,
        instrument=path.parent.name,
        string=row["string"],
        kind=row["kind"],
        position=share * SCALE,
        frequency=float(row["f0_measured_hz"] or "nan"),
    )
