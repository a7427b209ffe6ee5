"""Names for new files, by date and time."""

from datetime import datetime
from pathlib import Path


def dated_path(begin: str, suffix: str = "", folder: Path = Path()) -> Path:
    """Return an unused path in a folder: ``BEGIN_DATE_TIME`` with the suffix.

    >>> dated_path("live", ".mcap").name.startswith("live_2")
    True
    """
    stem = f"{begin}_{datetime.now():%Y%m%d_%H%M%S}"  # noqa: DTZ005  (for a person, by the clock on the wall)
    number, path = 1, folder / f"{stem}{suffix}"
    while path.exists():
        number += 1
        path = folder / f"{stem}_{number}{suffix}"
    return path
