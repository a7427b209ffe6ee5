"""Weights trained by others, described by one TOML file each; none of them is part of Monochord.

They are looked for at the given path, then at the path in their environment variable (MONOCHORD_AST), then
where `monochord weights get` puts them: below the folder in MONOCHORD_WEIGHTS, else in the user's data
folder. Packages with encoders of their own add descriptions by entry points of the group
``monochord.weights``.
"""

import logging
import os
import re
import shlex
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.presets import Presets
from monochord.core.ranges import Checked, Count
from monochord.perception import MOVED

__all__ = ["KnownWeights", "checked_sum", "find_weights", "load_known", "weight_names"]

CHECKSUM_SUFFIX = ".sha256"
"""Of the file beside the weights with their SHA-256 when fetched, or one pinned by hand."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownWeights(Checked):
    """Weights that Monochord can use.

    `url` is where they are published, an address of https or of a local file, and `file` their name there.
    They have `max_bytes` at most. `sha256` is their checksum, empty where it is not known in advance.
    `reader` is the module whose ``describe`` checks and describes their contents, empty where the checksum is
    enough; `exporter` the one whose ``export`` writes their network as an ONNX file, empty if there is none.
    """

    name: str
    title: str
    source: str
    licence: str
    url: str
    file: str
    max_bytes: Count = 1 << 30
    sha256: str = ""
    reader: str = ""
    exporter: str = ""
    notes: str = ""

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.sha256 and not re.fullmatch("[0-9a-f]{64}", self.sha256):
            raise InputError(f"sha256 '{self.sha256}'", "64 hexadecimal digits in lower case")

    @property
    def variable(self) -> str:
        """The environment variable with the path of their file or of its folder."""
        return f"MONOCHORD_{self.name.upper()}"

    @property
    def usual_path(self) -> Path:
        """Where `monochord weights get` puts them."""
        return weights_folder() / self.name / self.file


WEIGHTS = Presets(
    package=__name__, kind="weights", read=lambda tree, where: from_tree(KnownWeights, tree, where)
)


def weight_names() -> list[str]:
    """Return the names of all known weights, sorted.

    Examples
    --------
    >>> "ast" in weight_names()
    True
    """
    return WEIGHTS.names()


def load_known(name: str) -> KnownWeights:
    """Return the description of weights by their name.

    Raises
    ------
    InputError
        If there are none of this name.

    Examples
    --------
    >>> load_known("ast").file
    'model.safetensors'
    """
    if name in MOVED and name not in (names := weight_names()):
        raise InputError(f"weights '{name}'", ", ".join(names), MOVED[name])
    return WEIGHTS.load(name)


def weights_folder() -> Path:
    """Return the folder below which weights are stored, which need not exist."""
    if folder := os.environ.get("MONOCHORD_WEIGHTS"):
        return Path(folder)
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "monochord" / "weights"


def find_weights(known: KnownWeights, given: str = "") -> Path:
    """Return the file of weights on this machine.

    Parameters
    ----------
    known
        Which weights.
    given
        Their file or its folder; empty to look in the places that this module's docstring lists.

    Raises
    ------
    InputError
        If they are not there, with the way to get them.
    """
    chosen = given or os.environ.get(known.variable, "")
    path = Path(chosen) if chosen else known.usual_path
    path = path / known.file if path.is_dir() else path
    if not path.is_file():
        remedy = f"fetch them with 'monochord weights get {known.name}', or name the file in {known.variable}"
        raise InputError(f"weights {path} (not there)", known.file, remedy)
    return path


def checked_sum(known: KnownWeights, path: Path) -> str:
    """Return the SHA-256 of weights after comparing it with the known one and the one beside them.

    Where there is neither, a warning on stderr says so, with their checksum and the way to pin it.

    Raises
    ------
    InputError
        If they differ, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            actual = file_digest(file, "sha256").hexdigest()
        beside = path.with_name(path.name + CHECKSUM_SUFFIX)
        pinned = beside.read_text(encoding="ascii").strip() if beside.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"weights {path} ({error})", "files that can be read") from error
    for expected in (known.sha256, pinned):
        if expected and expected != actual:
            remedy = f"fetch them again with 'monochord weights get {known.name}'"
            raise InputError(f"weights {path} with SHA-256 {actual[:12]}...", f"{expected[:12]}...", remedy)
    if not (known.sha256 or pinned):
        pin = f"echo {actual} > {shlex.quote(str(beside))}"
        line = f"weights {path} are not pinned: their SHA-256 {actual} is compared with nothing"
        _LOG.warning("monochord: %s; if that is the right one, pin it: %s", line, pin)
    return actual
