"""The contract of an export format: frozen options, a writer of sessions, and a reader."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError, required
from monochord.core.files import usable_path
from monochord.core.ranges import Checked
from monochord.sessions import SessionReader


class Export(Checked, ABC):
    """Options of an export format, as a frozen keyword-only dataclass."""

    @abstractmethod
    def write(self, sessions: Sequence[SessionReader], out: Path) -> list[Path]:
        """Create the folder `out`, write the sessions into it, and return the files written.

        Raises `InputError` where `out` is not empty or a session lacks what the format needs.
        """

    def read(self, folder: Path, path: Path) -> None:
        """Convert one exported folder back into a session, the new file `path`.

        A lossy format does not implement this and raises `InputError`.
        """
        form = type(self).__module__.rpartition(".")[2]
        given, allowed = f"folder {folder} to be read into {path}", "a lossless form (parquet, wav_csv)"
        raise InputError(given, allowed, f"{form} leaves data out: keep the session itself")


def arrow(form: str) -> tuple[Any, Any]:
    """Return pyarrow and its Parquet part; raises `MissingLibraryError` where they are not installed."""
    with required(f"Exporting {form}", "pyarrow >= 17", "export"):
        import pyarrow as pa  # noqa: PLC0415
        import pyarrow.parquet as pq  # noqa: PLC0415
    return pa, pq


def new_folder(out: Path) -> Path:
    """Create a folder or accept an empty one; raises `InputError` where it is not empty."""
    with usable_path(f"folder {out}", "a folder that can be created"):
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise InputError(f"folder {out} (not empty)", "a new folder", "choose another name")
    return out


def folder_each(sessions: Sequence[SessionReader], out: Path) -> list[tuple[SessionReader, Path]]:
    """Create a folder below `out` for each session, named after its file; raises as `new_folder` does."""
    names = [session.path.stem for session in sessions]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two sessions called {twice}", "files of different names", "export them separately")
    new_folder(out)
    return [(session, new_folder(out / name)) for session, name in zip(sessions, names, strict=True)]
