"""What a distribution requires, linked from this environment into another one: nothing is downloaded."""

from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement


def needed(name: str, extras: tuple[str, ...] = ()) -> dict[str, Distribution]:
    """Return a distribution and all that it depends on, by name, as far as it is installed here."""
    there: dict[str, Distribution] = {}
    waiting = [(name, extras)]
    while waiting:
        name, extras = waiting.pop()
        try:
            there[name] = found = distribution(name)
        except PackageNotFoundError:  # of another system or another version of Python
            continue
        for text in found.requires or ():
            each = Requirement(text)
            wanted = not each.marker or any(each.marker.evaluate({"extra": extra}) for extra in ("", *extras))
            if wanted and (each.name not in there or each.extras):
                waiting.append((each.name, tuple(each.extras - {*extras})))
    return there


def link(name: str, site: Path, *, itself: bool = True) -> None:
    """Put a distribution, unless only what it requires is asked for, into an environment's packages."""
    for key, each in needed(name).items():
        if key == name and not itself:
            continue
        for part in {file.parts[0] for file in each.files or ()} - {"..", "__pycache__"}:
            place = site / part
            if not place.exists() and not part.endswith(".pth"):
                place.symlink_to(str(each.locate_file(part)))
