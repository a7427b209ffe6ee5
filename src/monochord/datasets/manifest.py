"""The manifest of a dataset: a description stored beside its arrays."""

import hashlib
import json
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from pathlib import Path, PurePath
from typing import Any, TextIO, TypeAlias

import numpy as np

from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.core.json_stream import json_members
from monochord.core.labels import Rules
from monochord.core.units import Metres, Newtons, Samples, Seconds
from monochord.datasets.checksums import BLOCK, REMEDY, FileSums
from monochord.datasets.measured import Thresholds
from monochord.datasets.records import PackedFiles, PackedRecords

FORMAT = 2
"""Version of the on-disk format; from 2 on, all files have checksums."""
FILE = "manifest.json"
MAX_WINDOWS = 1 << 26
"""Most windows in a dataset: 77 days of them, 0.1 s apart, take 0.5 GB per column."""
MAX_RATE, MAX_CHANNELS = 10_000_000, 256
Layout: TypeAlias = tuple[type[np.generic] | np.dtype[Any], tuple[int, ...]]
"""Type and shape of a file's array."""
TABLE: dict[str, type[np.generic]] = {
    "session": np.int32,
    "start": np.int64,
    "has_gap": np.bool_,
    "clipped": np.bool_,
    "not_finite": np.bool_,
}
"""Columns of the window table besides the labels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DatasetSession:
    """One session in a dataset.

    `source` is the session's file name and `checksum` the file's sha256. `audio` is the file of its samples
    (2, `frames`) below the dataset, and `audio_checksum` the sha256 of the samples alone. The session has
    `windows` rows of the table, from row `first` on. `labels` is the source of its labels: "recorded" or
    "measured". `late` is the delay of its sound at the beginning, in s, where it has taps, and `flags` are
    its alignment flags, where it was accepted despite them. `music` is the ambient sound, empty for none,
    None where unknown. `tension` is the string's tension at rest, in N, where known. `tuned` is the source of
    the tension: "recorded" with the tuned sensor, or "heard", estimated from the untouched beginning.
    `length` is the length that the session states for its string, in m, and `measured_length` its length as
    measured with a ruler, where known. `mount` is the class of its object's mount, empty where unknown.
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
    length: Metres | None = None
    measured_length: Metres | None = None
    mount: str = ""

    @property
    def body(self) -> str:
        """The touching object: its material where known, else its name.

        >>> blank = dict.fromkeys(("name", "source", "checksum", "audio", "audio_checksum", "labels"), "")
        >>> stick = {"object": "stick, radius 5 mm", "material": "wood"}
        >>> DatasetSession(**blank, **stick, frames=0, first=0, windows=0).body
        'wood'
        """
        return self.material or self.object


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """A dataset: windows of `window` frames, `hop` apart, of all its `parts`.

    `files` holds the checksums of all arrays, by file name below the dataset's folder. `columns` names the
    labels, `counts` the number of windows of each kind, `refused` the sessions left out and why. `rules` and
    the text `labelling` define the label of a window; `versions` are those of the programs used.

    `parts` and `files` of a dataset on disk are packed; an entry is unpacked when it is read. Unpacked, they
    would take five times the memory.
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
    parts: Sequence[DatasetSession]
    files: Mapping[str, FileSums]
    counts: dict[str, int] = field(default_factory=dict[str, int])
    refused: dict[str, str] = field(default_factory=dict[str, str])
    thresholds: Thresholds = field(default_factory=Thresholds)
    forced: bool = False
    versions: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def simulated(self) -> bool:
        """Whether any of its sound is simulated."""
        return any(part.simulated for part in self.parts)

    def arrays(self) -> Iterator[tuple[str, Layout]]:
        """Yield the name of each file of the dataset, below the folder, and its contents."""
        rows = (self.windows,)
        yield from ((part.audio, (np.float32, (self.channels, part.frames))) for part in self.parts)
        yield from ((f"windows/{name}.npy", (kind, rows)) for name, kind in TABLE.items())
        yield from ((f"labels/{name}.npy", (np.float64, rows)) for name in self.columns)
        yield from ((f"valid/{name}.npy", (np.bool_, rows)) for name in self.columns)

    def write(self, folder: Path) -> None:
        """Write the manifest into a folder, keys sorted, so that equal datasets have equal bytes."""
        tree = to_tree(replace(self, parts=(), files={}))
        with replacing(folder / FILE) as part, part.open("w", encoding="utf-8") as stream:
            for number, name in enumerate(sorted(tree)):
                stream.write(f"{',' if number else '{'}\n {json.dumps(name)}: ")
                if name == "parts":
                    _put(stream, "[]", (("", each) for each in self.parts))
                elif name == "files":
                    files = (
                        self.files if isinstance(self.files, PackedFiles) else PackedFiles(self.files.items())
                    )
                    _put(stream, "{}", ((f"{_text(file)}: ", sums) for file, sums in files.items()))
                else:
                    stream.write(_text(tree[name], 1))
            stream.write("\n}\n")

    @classmethod
    def read(cls, folder: Path) -> "Manifest":
        """Read the manifest of a folder; raises `InputError` where it is missing, damaged or too new."""
        if not (folder / FILE).exists():
            raise InputError(f"dataset {folder} (no {FILE} in it)", "a folder from monochord build")
        tree: Tree = {}
        wrong: InputError | None = None
        for name, value in json_members(folder / FILE, ("parts", "files"), REMEDY):
            try:
                tree[name] = _packed(name, value)
            except InputError as error:  # of less weight than another format
                wrong = wrong or error
                deque(value, 0)
        if tree.get("format") != FORMAT:
            given = f"dataset {folder} of another format"
            raise InputError(given, f"format {FORMAT}, with checksums of all files", REMEDY)
        if wrong is not None:
            raise wrong
        packed = {
            name: value for name, value in tree.items() if isinstance(value, (PackedRecords, PackedFiles))
        }
        nothing = {name: () if name == "parts" else {} for name in packed}
        manifest = replace(from_tree(cls, {**tree, **nothing}, FILE), **packed)
        for contradiction in _contradictions(manifest):
            raise InputError(
                f"{folder / FILE} ({contradiction})", "the unchanged output of monochord build", REMEDY
            )
        return manifest


def _packed(name: str, value: Any) -> Any:
    """Return a member of the manifest, its parts and checksums checked and packed one by one."""
    if name == "parts" and isinstance(value, Iterator):
        return PackedRecords(
            DatasetSession,
            (from_tree(DatasetSession, each, f"{FILE}.parts[{number}]") for number, each in enumerate(value)),
        )
    if name == "files" and isinstance(value, Iterator):
        return PackedFiles(map(_sums, value))
    return value


def _sums(entry: Any) -> tuple[str, FileSums]:
    """Return a file's name and checksums from an entry, which is a pair in an object, and none in a list."""
    if not isinstance(entry, tuple):
        raise InputError(f"{FILE}.files with {entry!r:.40}", "the name and checksums of each file", REMEDY)
    file, sums = entry
    return file, from_tree(FileSums, sums, f"{FILE}.files.{file}")


def _put(stream: TextIO, brackets: str, entries: Iterable[tuple[str, DatasetSession | FileSums]]) -> None:
    """Write entries as `json.dump` does with an indent of 1, one in memory at a time."""
    opened = False
    for name, each in entries:
        stream.write(f"{',' if opened else brackets[0]}\n  {name}{_text(to_tree(each), 2)}")
        opened = True
    stream.write(f"\n {brackets[1]}" if opened else brackets)


def _text(value: Any, indent: int = 0) -> str:
    text = json.dumps(value, indent=1, sort_keys=True, ensure_ascii=False)
    return text.replace("\n", "\n" + indent * " ")  # which no text in it has


def audio_name(number: int) -> str:
    """Return the file name of a session's samples, below the dataset's folder.

    >>> audio_name(3)
    'audio/0003.npy'
    """
    return f"audio/{number:04d}.npy"


def is_column_name(name: str) -> bool:
    """Return whether a label's name is usable as a file name in its folder.

    >>> is_column_name("force"), is_column_name("../force")
    (True, False)
    """
    return name == PurePath(name).name and name not in {"", ".."} and name.isprintable() and "\\" not in name


def _contradictions(manifest: Manifest) -> Iterator[str]:
    """Yield inconsistencies of a manifest, before memory is allocated for its content."""
    for name, value, largest in (
        ("sample_rate", manifest.sample_rate, MAX_RATE),
        ("channels", manifest.channels, MAX_CHANNELS),
        ("window", manifest.window, 60 * MAX_RATE),
        ("hop", manifest.hop, 60 * MAX_RATE),
    ):
        if not 1 <= value <= largest:
            yield f"{name} {value} (expected 1 to {largest})"
    if not 0 <= manifest.windows <= MAX_WINDOWS:
        yield f"{manifest.windows} windows (expected 0 to {MAX_WINDOWS})"
    yield from _contradictions_of_parts(manifest)
    if sum(part.windows for part in manifest.parts) != manifest.windows:
        yield f"{manifest.windows} windows, unlike the sum of its parts"
    if len(set(manifest.columns)) < len(manifest.columns) or not all(map(is_column_name, manifest.columns)):
        yield f"columns {', '.join(map(repr, manifest.columns))}"
    names = [name in manifest.files for name, _ in manifest.arrays()]
    if not all(names) or len(names) != len(manifest.files):
        yield "checksums that do not match its files"
    for name, sums in manifest.files.items():
        if len(sums.blocks) != -(-sums.bytes // BLOCK):
            yield f"{len(sums.blocks)} checksums of {name}, which has {sums.bytes} bytes"


def _contradictions_of_parts(manifest: Manifest) -> Iterator[str]:
    firsts = accumulate((part.windows for part in manifest.parts), initial=0)
    for number, (part, first) in enumerate(zip(manifest.parts, firsts, strict=False)):
        if part.audio != audio_name(number):
            yield f"parts[{number}].audio '{part.audio}', expected '{audio_name(number)}'"
        if part.frames < 0 or part.windows < 0 or part.first != first:
            yield f"parts[{number}] of {part.windows} windows from {part.first} on, in {part.frames} frames"


def file_checksum(file: Path) -> str:
    """Return the sha256 of a file in hexadecimal digits."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
