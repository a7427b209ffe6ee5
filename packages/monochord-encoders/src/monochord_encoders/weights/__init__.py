"""Published weights of encoders, each described by a TOML file. Monochord does not ship the weights.

Weights are searched for in this order: the given path; the path in their environment variable, such as
MONOCHORD_AST; the place where `monochord weights get` stores them, which is the folder in MONOCHORD_WEIGHTS,
or else the user's data folder. Other packages can add descriptions with entry points of the group
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
from monochord.core.errors import InputError, MissingLibraryError
from monochord.core.presets import Presets
from monochord.core.ranges import Checked, Count
from monochord.perception.features import FEATURES

__all__ = ["KnownWeights", "checked_sum", "find_weights", "load_known", "weight_names"]

CHECKSUM_SUFFIX = ".sha256"
"""Suffix of the file next to the weights with their SHA-256, from the download or pinned by the user."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownWeights(Checked):
    """The description of weights that Monochord can use.

    `url` is the https or file address of the published weights, and `file` the name of the file. The file has
    at most `max_bytes` bytes. `sha256` is its checksum; empty if unknown in advance. `reader` is a module
    whose ``describe`` checks and describes a file; empty if the checksum suffices. `exporter` is a module
    whose ``export`` writes the network as an ONNX file; empty if there is none.
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
        """The environment variable for the path of the file or its folder."""
        return f"MONOCHORD_{self.name.upper()}"

    @property
    def usual_path(self) -> Path:
        """The path where `monochord weights get` stores the file."""
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
    """Return the description of weights by name.

    Raises
    ------
    InputError
        If the name is unknown.

    Examples
    --------
    >>> load_known("ast").file
    'model.safetensors'
    """
    if (package := FEATURES.moved.get(name)) and name not in weight_names():
        raise MissingLibraryError(f"The network '{name}'", f"the package {package}", package)
    return WEIGHTS.load(name)


def weights_folder() -> Path:
    """Return the folder in which weights are stored; it may not exist."""
    if folder := os.environ.get("MONOCHORD_WEIGHTS"):
        return Path(folder)
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "monochord" / "weights"


def find_weights(known: KnownWeights, given: str = "") -> Path:
    """Return the path of a weights file on this machine.

    Parameters
    ----------
    known
        Description of the weights.
    given
        The file or its folder; empty to search the places in this module's docstring.

    Raises
    ------
    InputError
        If the file is missing; the message says how to get it.
    """
    chosen = given or os.environ.get(known.variable, "")
    path = Path(chosen) if chosen else known.usual_path
    path = path / known.file if path.is_dir() else path
    if not path.is_file():
        remedy = f"fetch them with 'monochord weights get {known.name}', or name the file in {known.variable}"
        raise InputError(f"weights {path} (not there)", known.file, remedy)
    return path


def checked_sum(known: KnownWeights, path: Path) -> str:
    """Return the SHA-256 of a weights file after checking it.

    It must match the checksum in the description and the one in the file next to the weights. Without either,
    a warning on stderr states the checksum and how to pin it.

    Raises
    ------
    InputError
        If a checksum differs or a file cannot be read.
    """
    try:
        with path.open("rb") as file:
            actual = file_digest(file, "sha256").hexdigest()
        beside = path.with_name(path.name + CHECKSUM_SUFFIX)
        pinned = beside.read_text(encoding="ascii").strip() if beside.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"weights {path} ({error})", "readable files") from error
    for expected in (known.sha256, pinned):
        if expected and expected != actual:
            remedy = f"fetch them again with 'monochord weights get {known.name}'"
            raise InputError(f"weights {path} with SHA-256 {actual[:12]}...", f"{expected[:12]}...", remedy)
    if not (known.sha256 or pinned):
        pin = f"echo {actual} > {shlex.quote(str(beside))}"
        line = f"weights {path} are not pinned: no checksum to compare their SHA-256 {actual} with"
        _LOG.warning("monochord: %s; if it is correct, pin it: %s", line, pin)
    return actual
