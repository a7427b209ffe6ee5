"""Faults that can be put into the source one at a time, and how each finds its place in a tree."""

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent, indent

import msgspec

FAULTS = Path(__file__).with_name("faults.toml")
SOURCE = Path("src", "monochord")


class DoesNotApplyError(ValueError):
    """The text that a fault replaces is in no file, or in several places."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of the source.

    Parameters
    ----------
    name
        What it is called.
    package
        The package of ``src/monochord`` whose tests should notice it.
    file
        Where its text stood when it was written, from ``src/monochord`` on.
    before, after
        The text that is replaced, a part of a line or whole lines at any indentation, and the faulty one.
    effect
        What a user would see.
    fix
        Subject of the commit whose fix it takes back; empty for a fault that was never there.
    tests
        The files, folders and tests (``FILE::TEST``) that should notice it; its package's folder by default.
    slow
        Whether a test that should is a slow one.
    """

    name: str
    package: str
    file: str
    before: str
    after: str
    effect: str
    fix: str = ""
    tests: tuple[str, ...] = ()
    slow: bool = False

    def applied(self, root: Path) -> tuple[Path, str]:
        """Return the file of a tree that has the fault's place, and its text with the fault.

        A text that has moved to another file of the same kind is followed.

        Raises
        ------
        DoesNotApplyError
            If the text is in no file, or in several places.
        """
        source, pattern = root / SOURCE, self._pattern()
        own = source / self.file
        texts = {file: file.read_text(encoding="utf-8") for file in sorted(source.rglob(f"*{own.suffix}"))}
        found = {file: n for file, text in texts.items() if (n := len(pattern.findall(text)))}
        places = {own: found[own]} if own in found else found
        if sum(places.values()) != 1:
            raise DoesNotApplyError(
                f"its text is in {sum(places.values())} places" if places else "its text is in no file"
            )
        (file,) = places
        return file, pattern.sub(self._replacement, texts[file])

    def paths(self, root: Path) -> list[str]:
        """Return the tests of a tree that should notice it, all of its package where those have gone."""
        named = [name for name in self.tests if (root / name.partition("::")[0]).exists()]
        package = f"tests/{self.package}"
        return named or [package if (root / package).is_dir() else "tests"]

    def _pattern(self) -> re.Pattern[str]:
        lines = dedent(self.before).strip("\n").split("\n")
        if len(lines) == 1:
            return re.compile(f"(?P<margin>){re.escape(lines[0])}")
        whole = "\n".join(f"(?P=margin){re.escape(line)}" if line else "" for line in lines)
        return re.compile(f"^(?P<margin>[ \t]*){whole.removeprefix('(?P=margin)')}$", re.MULTILINE)

    def _replacement(self, match: re.Match[str]) -> str:
        return indent(dedent(self.after).strip("\n"), match["margin"])


def read_faults(file: Path = FAULTS) -> dict[str, Fault]:
    """Return the faults of a file by their names.

    Raises
    ------
    ValueError
        In one line, if the file cannot be read or holds something else.
    """
    try:
        tree = tomllib.loads(file.read_text(encoding="utf-8"))
        faults = msgspec.convert(tree, dict[str, list[Fault]]).get("fault", [])
    except (OSError, ValueError) as error:
        raise ValueError(f"{file}: {' '.join(str(error).split())}") from error
    named = {fault.name: fault for fault in faults}
    if len(named) < len(faults):
        raise ValueError(f"{file}: two faults of one name")
    return named
