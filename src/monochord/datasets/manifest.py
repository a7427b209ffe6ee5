"""What a dataset is made of, in words and numbers: the file that stands beside its arrays."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path, PurePath
from typing import TypeAlias

import numpy as np

from monochord.core.config import from_tree, load_json, to_tree
from monochord.core.errors import InputError
from monochord.core.labels import Rules
from monochord.core.units import Metres, Newtons, Samples, Seconds
from monochord.datasets.checksums import BLOCK, REMEDY, FileSums
from monochord.datasets.measured import Thresholds

FORMAT = 2
"""Version of the layout on disk; from 2 on there are checksums of all files."""
FILE = "manifest.json"
MAX_WINDOWS = 1 << 26
"""In a dataset: 77 days of them, 0.1 s apart, in 0.5 GB for a column."""
MAX_RATE, MAX_CHANNELS = 10_000_000, 256
Layout: TypeAlias = tuple[type[np.generic], tuple[int, ...]]
"""Type and shape of the array in a file."""
TABLE: dict[str, type[np.generic]] = {
    "session": np.int32,
    "start": np.int64,
    "has_gap": np.bool_,
    "clipped": np.bool_,
    "not_finite": np.bool_,
}
"""Columns of the table of windows that are no labels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One session in a dataset.

    `source` is the name of its file and `checksum` that file's sha256; `audio` is the file of its samples (2,
    `frames`) below the dataset and `audio_checksum` the sha256 of the samples alone. It has `windows` rows of
    the table, from row `first` on. `labels` says where they come from: "recorded" or "measured". `late` is by
    how much its sound was late at its beginning, in s, where it has taps, and `flags` are what its alignment
    was warned of, where it was taken all the same. `music` is what sounded in the room, empty for nothing,
    and None where that is unknown. `tension` is that of its string at rest, in N, where it is known. `tuned`
    says from where: "recorded" with the sensor as tuned, or "heard", estimated from the untouched beginning.
    `mount` is the class of what holds its object, empty where that is unknown.
    """

    name: str
    source: str
    checksum: str
    audio: str
    audio_checksum: str
    frames: Samples
    first: int
    windows: int
    labels: str
    simulated: bool = False
    object: str = ""
    material: str = ""
    radius: Metres | None = None
    day: int | None = None
    build: int | None = None
    music: str | None = None
    complete: bool = True
    late: Seconds | None = None
    flags: tuple[str, ...] = ()
    tension: Newtons | None = None
    tuned: str | None = None
    mount: str = ""

    @property
    def body(self) -> str:
        """What touches in it: the material where that is known, else the object's name.

        >>> blank = dict.fromkeys(("name", "source", "checksum", "audio", "audio_checksum", "labels"), "")
        >>> Part(**blank, frames=0, first=0, windows=0, object="stick, radius 5 mm", material="wood").body
        'wood'
        """
        return self.material or self.object


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """A dataset: windows of `window` frames, `hop` apart, of all its `parts`.

    `files` are the checksums of all its arrays, by the names of their files below the dataset's folder.
    `columns` are the names of the labels, `counts` how many windows there are of each kind, `refused` the
    sessions that were left out and why. `rules` and the text `labelling` say what the label of a window is;
    `versions` which programs made it.
    """

    format: int = FORMAT
    sample_rate: int
    channels: int
    window: Samples
    hop: Samples
    windows: int
    columns: tuple[str, ...]
    rules: Rules
    labelling: str
    parts: tuple[Part, ...]
    files: dict[str, FileSums]
    counts: dict[str, int] = field(default_factory=dict[str, int])
    refused: dict[str, str] = field(default_factory=dict[str, str])
    thresholds: Thresholds = field(default_factory=Thresholds)
    forced: bool = False
    versions: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def simulated(self) -> bool:
        """Whether any of its sound is simulated."""
        return any(part.simulated for part in self.parts)

    def arrays(self) -> Mapping[str, Layout]:
        """Return the contents of each file of the dataset, by its name below the folder."""
        rows = (self.windows,)
        return {
            **{part.audio: (np.float32, (self.channels, part.frames)) for part in self.parts},
            **{f"windows/{name}.npy": (kind, rows) for name, kind in TABLE.items()},
            **{f"labels/{name}.npy": (np.float64, rows) for name in self.columns},
            **{f"valid/{name}.npy": (np.bool_, rows) for name in self.columns},
        }

    def write(self, folder: Path) -> None:
        """Write it into a folder, keys sorted, so that equal datasets have equal bytes."""
        text = json.dumps(to_tree(self), indent=1, sort_keys=True, ensure_ascii=False)
        (folder / FILE).write_text(text + "\n", encoding="utf-8")

    @classmethod
    def read(cls, folder: Path) -> "Manifest":
        """Read the manifest of a folder.

        Raises
        ------
        InputError
            If there is none, it is damaged or contradicts itself, or another version of Monochord wrote it.
        """
        if not (folder / FILE).exists():
            raise InputError(f"dataset {folder} (no {FILE} in it)", "a folder that monochord build made")
        tree = load_json(folder / FILE, REMEDY)
        if not isinstance(tree, dict) or tree.get("format") != FORMAT:
            given = f"dataset {folder} of another format"
            raise InputError(given, f"format {FORMAT}, with checksums of all files", REMEDY)
        manifest = from_tree(cls, tree, FILE)
        for wrong in _contradictions(manifest):
            raise InputError(f"{folder / FILE} ({wrong})", "what monochord build wrote", REMEDY)
        return manifest


def audio_name(number: int) -> str:
    """Return the name of the file of a session's samples, below the folder of its dataset.

    >>> audio_name(3)
    'audio/0003.npy'
    """
    return f"audio/{number:04d}.npy"


def is_column_name(name: str) -> bool:
    """Return whether a label's name can be that of a file, and of one in its folder alone.

    >>> is_column_name("force"), is_column_name("../force")
    (True, False)
    """
    return name == PurePath(name).name and name not in {"", ".."} and name.isprintable() and "\\" not in name


def _contradictions(manifest: Manifest) -> Iterator[str]:
    """Yield what cannot be true of a dataset, before anything that follows from it takes memory."""
    for name, value, largest in (
        ("sample_rate", manifest.sample_rate, MAX_RATE),
        ("channels", manifest.channels, MAX_CHANNELS),
        ("window", manifest.window, 60 * MAX_RATE),
        ("hop", manifest.hop, 60 * MAX_RATE),
    ):
        if not 1 <= value <= largest:
            yield f"{name} {value}, which is not 1 to {largest}"
    if not 0 <= manifest.windows <= MAX_WINDOWS:
        yield f"{manifest.windows} windows, which is not 0 to {MAX_WINDOWS}"
    yield from _contradictions_of_parts(manifest)
    if sum(part.windows for part in manifest.parts) != manifest.windows:
        yield f"{manifest.windows} windows, which are not those of its parts"
    if len(set(manifest.columns)) < len(manifest.columns) or not all(map(is_column_name, manifest.columns)):
        yield f"columns {', '.join(map(repr, manifest.columns))}"
    if set(manifest.files) != set(manifest.arrays()):
        yield "checksums of other files than it is made of"
    for name, sums in manifest.files.items():
        if len(sums.blocks) != -(-sums.bytes // BLOCK):
            yield f"{len(sums.blocks)} checksums of {name}, which has {sums.bytes} bytes"


def _contradictions_of_parts(manifest: Manifest) -> Iterator[str]:
    firsts = accumulate((part.windows for part in manifest.parts), initial=0)
    for number, (part, first) in enumerate(zip(manifest.parts, firsts, strict=False)):
        if part.audio != audio_name(number):
            yield f"parts[{number}].audio '{part.audio}', which is not '{audio_name(number)}'"
        if part.frames < 0 or part.windows < 0 or part.first != first:
            yield f"parts[{number}] of {part.windows} windows from {part.first} on, in {part.frames} frames"


def file_checksum(file: Path) -> str:
    """Return the sha256 of a file in hexadecimal digits."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
