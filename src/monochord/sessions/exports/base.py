"""The contract of an export: frozen options, and how sessions are written in another form and read back."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from monochord.core.errors import InputError
from monochord.sessions import Session


class Export(ABC):
    """Options of an export, as a frozen keyword-only dataclass."""

    @abstractmethod
    def write(self, sessions: Sequence[Session], out: Path) -> list[Path]:
        """Write sessions below the folder `out`, which is made, and return what was written.

        Raises `InputError` where `out` holds something already or a session lacks what the form needs.
        """

    def read(self, folder: Path, path: Path) -> None:
        """Write the session that one folder of this form holds to the new file `path`.

        A form that keeps less than a session does leaves this out: then it raises `InputError`.
        """
        form = type(self).__module__.rpartition(".")[2]
        given, allowed = f"folder {folder} to be read into {path}", "a form that keeps all of a session"
        raise InputError(given, allowed, f"{form} does not: keep the session itself")
