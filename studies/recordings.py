"""Build the set of real recordings from local copies of the originals.

    python -m studies.recordings ORIGINALS OUT

ORIGINALS has a folder for each source, named as its repository or package (docs/reference/recordings.md).
OUT receives FLAC files and `manifest.csv`, as MONOCHORD_REALSTRINGS expects it, in a minute. Each file is
trimmed and stored as `studies/recordings.csv` says, without a change of gain or rate, and compared with its
checksum.
"""

import csv
import hashlib
from pathlib import Path
from shutil import copyfile
from typing import Any

import click
import numpy as np
import soundfile
from numpy.typing import NDArray
from studies._command import main

from monochord.core.errors import InputError

MANIFEST = Path(__file__).with_suffix(".csv")
QUIET = 0.05
"""Peak below which a recording is stored with 24 bits instead of 16."""


@click.command()
@click.argument("originals", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path))
def recordings(originals: Path, out: Path) -> None:
    """Build the set of real recordings in OUT from local copies in ORIGINALS."""
    rows = listed()
    missing = [path for row in rows for path in sources(originals, row) if not path.is_file()]
    if missing:
        given = f"{originals} without {missing[0].relative_to(originals)} ({len(missing)} of its files)"
        raise InputError(given, "a folder for each source", "docs/reference/recordings.md lists them")
    if out.exists():
        raise InputError(f"folder '{out}', which already exists", "a new folder")
    differ = [row["file"] for row in rows if built(originals, row, out / row["file"]) != row["sha256"]]
    copyfile(MANIFEST, out / "manifest.csv")
    print(f"{len(rows)} files in {out}, {len(rows) - len(differ)} with the checksum of the manifest")
    for file in differ:
        print(f"differs: {file}")


def listed() -> list[dict[str, str]]:
    """Return the rows of the manifest: a file, its source and licence, and what is known of its string."""
    with MANIFEST.open(newline="", encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


def sources(originals: Path, row: dict[str, str]) -> list[Path]:
    """Return the original files of a row: two where channels were recorded into files of their own.

    >>> row = {"source": "github librosa/data @450cdd8", "source_path": "audio/a.ogg"}
    >>> [path.as_posix() for path in sources(Path("originals"), row)]
    ['originals/data/audio/a.ogg']
    """
    kind, name = row["source"].split()[:2]
    folder = name.rpartition("/")[2] if kind == "github" else name
    return [originals / folder / path.strip() for path in row["source_path"].split(" + ")]


def built(originals: Path, row: dict[str, str], file: Path) -> str:
    """Write a file of the set, and return the first 16 digits of its SHA-256."""
    rate = int(row["sample_rate"])
    begin, frames = round(float(row["trim_start_s"]) * rate), int(row["frames"])
    tracks: list[NDArray[Any]] = []
    for path in sources(originals, row):
        samples, found = soundfile.read(path, dtype="float64", always_2d=True)
        if found != rate:
            raise InputError(f"{path} at {found} Hz", f"{rate} Hz", "use the original file")
        tracks.append(samples[begin : begin + frames])
    shortest = min(len(track) for track in tracks)
    sound = np.concatenate([track[:shortest] for track in tracks], axis=1)
    file.parent.mkdir(parents=True, exist_ok=True)
    subtype = "PCM_24" if float(row["peak"]) < QUIET else "PCM_16"
    soundfile.write(file, sound, rate, subtype=subtype)
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


if __name__ == "__main__":
    main(recordings)
