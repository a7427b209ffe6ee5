"""Real recordings of instruments: strings with known fret positions, and music and speech as interference.

They are not part of Monochord; the environment variable MONOCHORD_REALSTRINGS names their folder.
"""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.core.units import Hertz, Metres

SCALE: Metres = 0.65
"""String length that positions refer to, in m; the instruments' scales differ by a few mm."""
RATE = 44100
"""Sample rate in Hz of the interference recordings and of the takes they are added to."""
REMEDY = "set the environment variable MONOCHORD_REALSTRINGS to it"


@dataclass(frozen=True, slots=True, kw_only=True)
class RealTake:
    """One recording. `position` is that of the fret, from the nut on a string of `SCALE`; NaN if unknown."""

    path: Path
    instrument: str
    string: str
    kind: str
    position: Metres
    frequency: Hertz

    @property
    def string_name(self) -> str:
        """The instrument's and the string's name."""
        return f"{self.instrument} {self.string}"

    def read(self) -> tuple[Audio, int]:
        """Return samples (channels, n) and the sample rate in Hz."""
        import soundfile  # noqa: PLC0415

        samples, rate = soundfile.read(self.path, dtype="float32", always_2d=True)
        return np.ascontiguousarray(samples.T, np.float32), int(rate)


def folder() -> Path | None:
    """Return the recordings' folder, or None."""
    named = os.environ.get("MONOCHORD_REALSTRINGS")
    return Path(named) if named and (Path(named) / "manifest.csv").is_file() else None


def takes(*, kind: str | None = None, labelled: bool = False) -> list[RealTake]:
    """Return the recordings in the manifest, by file name; empty where there are none.

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
    with (home / "manifest.csv").open(newline="", encoding="utf-8-sig") as lines:
        listed = [_take(home, row) for row in csv.DictReader(lines)]
    chosen = [
        take
        for take in listed
        if kind in (None, take.kind) and (not labelled or (take.string and np.isfinite(take.position)))
    ]
    return sorted(chosen, key=lambda take: take.path)


def _take(home: Path, row: dict[str, str]) -> RealTake:
    path = home / row["file"]
    return RealTake(
        path=path,
        instrument=path.parent.name,
        string=row["string"],
        kind=row["kind"],
        position=float(row["x_over_L"] or "nan") * SCALE,
        frequency=float(row["f0_measured_hz"] or "nan"),
    )


def interference_recordings() -> dict[str, Audio]:
    """Return the interference recordings by name, one channel (n,), resampled to `RATE`.

    Raises
    ------
    InputError
        If this machine has none.
    """
    sounds = {take.path.stem: take.read() for take in takes(kind="interference")}
    if not sounds:
        raise InputError("no recordings of interference", "a folder with manifest.csv", REMEDY)
    return {name: resampled(samples.mean(axis=0), RATE, rate) for name, (samples, rate) in sounds.items()}


def resampled(sound: Audio, sample_rate: int, source_rate: int = RATE) -> Audio:
    """Return a sound (n,) of `source_rate` at another sample rate, in Hz."""
    import soxr  # noqa: PLC0415

    if sample_rate == source_rate:
        return np.asarray(sound, np.float32)
    return np.asarray(soxr.resample(sound, source_rate, sample_rate), np.float32)
