"""The contract of an export: frozen options, and how sessions are written in another form and read back."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError, MissingLibraryError
from monochord.core.ranges import Checked
from monochord.sessions import SessionReader


class Export(Checked, ABC):
    """Options of an export, as a frozen keyword-only dataclass."""

    @abstractmethod
    def write(self, sessions: Sequence[SessionReader], out: Path) -> list[Path]:
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


def arrow(form: str) -> tuple[Any, Any]:
    """Return pyarrow and its Parquet part; raises `MissingLibraryError` where they are not installed."""
    try:
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415
    except ImportError as error:
        raise MissingLibraryError(f"Exporting {form}", "pyarrow >= 17", "export") from error
    return pa, pq


def new_folder(out: Path) -> Path:
    """Make a folder, or take one that is empty; raises `InputError` where it holds something already."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise InputError(f"folder {out} (not empty)", "a new folder", "name another one")
    except OSError as error:
        raise InputError(f"folder {out} ({error.strerror})", "a folder that can be made") from error
    return out


def folder_each(sessions: Sequence[SessionReader], out: Path) -> list[tuple[SessionReader, Path]]:
    """Make a folder below `out` for each session, called as its file is; refuses what `new_folder` does."""
    names = [session.path.stem for session in sessions]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two sessions called {twice}", "files of different names", "export them apart")
    new_folder(out)
    return [(session, new_folder(out / name)) for session, name in zip(sessions, names, strict=True)]
