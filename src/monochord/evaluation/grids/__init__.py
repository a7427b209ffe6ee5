"""Grids as data: what an ablation compares, one TOML file each, found by its name."""

from collections.abc import Mapping, Sequence
from typing import Any

from monochord.core.config import from_tree, load_toml, override
from monochord.core.presets import preset_names, preset_path
from monochord.evaluation.grid import Grid


def grid_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> grid_names()
    ['features', 'parts']
    """
    return preset_names(__name__)


def load_grid(name: str, differs: Mapping[str, Any] | None = None, assignments: Sequence[str] = ()) -> Grid:
    """Return a preset by its name, or read one from a file of your own.

    Parameters
    ----------
    name
        A name from `grid_names`, or the path of a TOML file laid out as the presets are.
    differs
        Values that stand in place of the file's, by name.
    assignments
        The same as text, such as ``variations.one_driver.sessions=["one"]``; they are the last word.

    Raises
    ------
    InputError
        If there is no such preset, or the file cannot be used.

    Examples
    --------
    >>> load_grid("parts").part, load_grid("parts", {"part": "test"}).part
    ('validation', 'test')
    """
    path = preset_path(__name__, "grid", name)
    tree = override({**load_toml(path), **(differs or {})}, assignments)
    return from_tree(Grid, tree, f"grid {path.stem}")
