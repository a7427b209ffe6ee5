"""What the imports of all forms share."""

from collections.abc import Iterator
from pathlib import Path

from tests.fuzz.base import Input, Target, command, taken_from
from tests.fuzz.targets.sessions import FEEDS, write_session

from monochord.core.errors import InputError
from monochord.sessions import read_session
from monochord.sessions.exports import EXPORTS


def brought_in(out: Path, *arguments: object) -> None:
    """Import; what is refused leaves no file, and what is accepted is a sound session."""
    try:
        command("sessions", "import", *arguments, "--out", out)
    except InputError:
        assert not out.exists(), "a refused import left a file"
        raise
    try:
        command("sessions", "check", out)
    except InputError as error:
        raise AssertionError(f"imported, but: {error.given[-60:]}") from error


class ImportTarget(Target):
    """A folder that an export wrote, brought in again."""

    form = ""

    def seeds(self, folder: Path) -> Iterator[Input]:
        for number, feeds in enumerate((FEEDS, FEEDS[:1])):
            path = write_session(folder / f"take{number}.mcap", number, feeds=feeds)
            EXPORTS.build(self.form).write([read_session(path)], folder / f"out{number}")
            yield taken_from(folder / f"out{number}" / path.stem)

    def run(self, folder: Path) -> None:
        out = folder.with_name("imported.mcap")
        out.unlink(missing_ok=True)
        brought_in(out, folder)
