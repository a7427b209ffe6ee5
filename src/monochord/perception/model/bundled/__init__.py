"""Bundled pretrained models, one folder each.

The ``SOURCES.md`` of each says how it was made.
"""

from importlib.resources import files
from pathlib import Path


def bundled_names() -> list[str]:
    """Return the names of the bundled pretrained models, sorted.

    Examples
    --------
    >>> bundled_names()
    ['demo']
    """
    paths = (Path(str(entry)) for entry in files(__name__).iterdir())
    return sorted(path.name for path in paths if (path / "model.json").is_file())


def bundled_folder(name: str) -> Path | None:
    """Return the folder of a bundled pretrained model, None if there is none of this name.

    Examples
    --------
    >>> bundled_folder("demo").name, bundled_folder("demos") is None
    ('demo', True)
    """
    key = name.replace("-", "_")
    return Path(str(files(__name__) / key)) if key in bundled_names() else None
