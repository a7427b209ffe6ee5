"""Weights that others trained: one TOML file each says what they are; none of them is part of Monochord.

They are looked for in what is named, then in what the variable of their name says (MONOCHORD_AST), then where
`monochord weights get` puts them: below the folder that MONOCHORD_WEIGHTS names, else in the user's data
folder.
"""

import logging
import os
import re
import shlex
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path

from monochord.core.config import from_tree, load_toml
from monochord.core.errors import InputError
from monochord.core.presets import preset_names, preset_path

SUM_SUFFIX = ".sha256"
"""Of the file beside the weights that keeps the sum they had when fetched, or one pinned by hand."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownWeights:
    """Weights that Monochord can use.

    `url` is where they are published, an address of https or of a local file, and `file` what they are called
    there. They have `max_bytes` at most. `sha256` is their sum, empty where it is not known in advance.
    `reader` is the module whose ``describe`` reads them and says in a few words what they hold, empty where
    the sum says enough; `exporter` the one whose ``export`` writes their network as an ONNX file, empty where
    there is none.
    """

    name: str
    title: str
    source: str
    licence: str
    url: str
    file: str
    max_bytes: int = 1 << 30
    sha256: str = ""
    reader: str = ""
    exporter: str = ""
    notes: str = ""

    def __post_init__(self) -> None:
        if self.sha256 and not re.fullmatch("[0-9a-f]{64}", self.sha256):
            raise InputError(f"sha256 '{self.sha256}'", "64 hexadecimal digits in lower case")
        if self.max_bytes < 1:
            raise InputError(f"max_bytes {self.max_bytes}", "1 or more")

    @property
    def variable(self) -> str:
        """The environment variable that names their file, or the folder that it lies in."""
        return f"MONOCHORD_{self.name.upper()}"

    @property
    def usual_path(self) -> Path:
        """Where they are put when they are fetched."""
        return weights_folder() / self.name / self.file


def weight_names() -> list[str]:
    """Return the names of all weights that are known, sorted.

    Examples
    --------
    >>> weight_names()
    ['ast', 'yamnet']
    """
    return preset_names(__name__)


def load_known(name: str) -> KnownWeights:
    """Return what is known of weights by their name.

    Raises
    ------
    InputError
        If no weights are called so.

    Examples
    --------
    >>> load_known("yamnet").sha256[:8]
    '0a266465'
    """
    path = preset_path(__name__, "weights", name)
    return from_tree(KnownWeights, {**load_toml(path), "name": path.stem}, f"weights {path.stem}")


def weights_folder() -> Path:
    """Return the folder that weights are kept below, which need not exist."""
    if named := os.environ.get("MONOCHORD_WEIGHTS"):
        return Path(named)
    data = os.environ.get("XDG_DATA_HOME")
    return (Path(data) if data else Path.home() / ".local" / "share") / "monochord" / "weights"


def find_weights(known: KnownWeights, given: str = "") -> Path:
    """Return the file of weights that are at hand.

    Parameters
    ----------
    known
        Which weights.
    given
        Their file or its folder; empty to look where the module's description says.

    Raises
    ------
    InputError
        If they are not there, with the way to get them.
    """
    named = given or os.environ.get(known.variable, "")
    path = Path(named) if named else known.usual_path
    path = path / known.file if path.is_dir() else path
    if not path.is_file():
        remedy = f"fetch them with 'monochord weights get {known.name}', or name the file in {known.variable}"
        raise InputError(f"weights {path} (not there)", known.file, remedy)
    return path


def checked_sum(known: KnownWeights, path: Path) -> str:
    """Return the SHA-256 of weights, compared with the one that is known or was kept beside them.

    Where there is neither, a warning on stderr says so, with the sum that they have and the way to pin it.

    Raises
    ------
    InputError
        If they are not those, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            own = file_digest(file, "sha256").hexdigest()
        beside = path.with_name(path.name + SUM_SUFFIX)
        kept = beside.read_text(encoding="ascii").strip() if beside.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"weights {path} ({error})", "files that can be read") from error
    for due in (known.sha256, kept):
        if due and due != own:
            remedy = f"fetch them again with 'monochord weights get {known.name}'"
            raise InputError(f"weights {path} with SHA-256 {own[:12]}...", f"{due[:12]}...", remedy)
    if not (known.sha256 or kept):
        pin = f"echo {own} > {shlex.quote(str(beside))}"
        line = f"weights {path} are not pinned: nothing says which SHA-256 they should have; they have {own}"
        _LOG.warning("monochord: %s; if that is the right one, pin it: %s", line, pin)
    return own
