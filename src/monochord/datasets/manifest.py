"""What a dataset is made of, in words and numbers: the file that stands beside its arrays."""

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path

from monochord.config import from_tree, to_tree
from monochord.datasets.labels import Rules
from monochord.datasets.measured import Thresholds
from monochord.errors import InputError
from monochord.units import Metres, Samples, Seconds

FORMAT = 1
"""Version of the layout on disk."""
FILE = "manifest.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One session in a dataset.

    `source` is the name of its file and `checksum` that file's sha256; `audio` is the file of its samples
    (2, `frames`) below the dataset and `audio_checksum` the sha256 of the samples alone. It has `windows`
    rows of the table, from row `first` on. `labels` says where they come from: "recorded" or "measured".
    `late` is by how much its sound was late at its begin, in s, where taps told, and `flags` are what its
    alignment was warned of, where it was taken all the same. `music` is what sounded in the room, empty for
    nothing, and None where nobody told.
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

    @property
    def body(self) -> str:
        """What touches in it: the material where that is told, else the object's name.

        >>> blank = dict.fromkeys(("name", "source", "checksum", "audio", "audio_checksum", "labels"), "")
        >>> Part(**blank, frames=0, first=0, windows=0, object="stick, radius 5 mm", material="wood").body
        'wood'
        """
        return self.material or self.object


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """A dataset: windows of `window` frames, `hop` apart, of all its `parts`.

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
    counts: dict[str, int] = field(default_factory=dict[str, int])
    refused: dict[str, str] = field(default_factory=dict[str, str])
    thresholds: Thresholds = field(default_factory=Thresholds)
    forced: bool = False
    versions: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def simulated(self) -> bool:
        """Whether any of its sound is simulated."""
        return any(part.simulated for part in self.parts)

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
            If there is none, it is damaged, or a newer version of Monochord wrote it.
        """
        try:
            tree = json.loads((folder / FILE).read_text(encoding="utf-8"))
        except OSError as error:
            given = f"dataset {folder} ({error.strerror or 'unreadable'})"
            raise InputError(given, "a folder that monochord build made") from error
        except ValueError as error:
            raise InputError(f"dataset {folder} ({FILE} is damaged)", "JSON", "build it again") from error
        if not isinstance(tree, dict) or tree.get("format") != FORMAT:
            raise InputError(f"dataset {folder} of another format", f"format {FORMAT}", "build it again")
        return from_tree(cls, tree, FILE)


def checksum(file: Path) -> str:
    """Return the sha256 of a file in hexadecimal digits."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
