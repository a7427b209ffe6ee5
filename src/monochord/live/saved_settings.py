"""The settings of a run in a file, written once the run begins."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.live.sinks.base import Listener, Run, Update, Writer


class SavedSettings(Listener):
    """A sink that writes settings to a file once the source is open and the estimator accepts its signal."""

    def __init__(self, path: Path, text: str) -> None:
        self._path, self._text = path, text

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:  # noqa: ARG002
        """Write the file; raises `InputError` where it cannot be written."""
        try:
            with replacing(self._path) as part:
                part.write_text(self._text, encoding="utf-8")
        except OSError as error:
            given = f"file {self._path} ({error.strerror})"
            raise InputError(given, "a writable path") from error
        yield self

    def write(self, update: Update) -> None:
        """Do nothing."""
