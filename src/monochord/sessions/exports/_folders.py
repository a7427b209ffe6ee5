"""Folders to export to: new ones, and one a session."""

from collections.abc import Sequence
from pathlib import Path

from monochord.core.errors import InputError
from monochord.sessions import Session


def new_folder(out: Path) -> Path:
    """Make a folder, or take one that is empty; raises `InputError` where it holds something already."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise InputError(f"folder {out} (not empty)", "a new folder", "name another one")
    except OSError as error:
        raise InputError(f"folder {out} ({error.strerror})", "a folder that can be made") from error
    return out


def folder_each(sessions: Sequence[Session], out: Path) -> list[tuple[Session, Path]]:
    """Make a folder below `out` for each session, called as its file is; refuses what `new_folder` does."""
    names = [session.path.stem for session in sessions]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two sessions called {twice}", "files of different names", "export them apart")
    new_folder(out)
    return [(session, new_folder(out / name)) for session, name in zip(sessions, names, strict=True)]
