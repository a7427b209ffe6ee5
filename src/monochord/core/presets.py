"""Presets as data: one TOML file each in a folder, found by its name."""

from importlib.resources import files
from pathlib import Path

from monochord.core.errors import InputError, did_you_mean


def preset_names(package: str) -> list[str]:
    """Return the names of the presets in a package's folder, sorted.

    Examples
    --------
    >>> "wood" in preset_names("monochord.physics.materials")
    True
    """
    found = (Path(entry.name) for entry in files(package).iterdir())
    return sorted(path.stem for path in found if path.suffix == ".toml")


def preset_path(package: str, kind: str, name: str) -> Path:
    """Return the file of a preset by its name, or the file that is named itself.

    Parameters
    ----------
    package
        Whose folder holds the presets.
    kind
        What they are, for the message: "string", "material".
    name
        A name, with hyphens or underscores, or the path of a TOML file.

    Raises
    ------
    InputError
        If there is no such preset.

    Examples
    --------
    >>> preset_path("monochord.physics.materials", "material", "allen-key").name
    'allen_key.toml'
    """
    if name.endswith(".toml"):
        return Path(name)
    key, names = name.replace("-", "_"), preset_names(package)
    if key not in names:
        raise InputError(f"{kind} '{name}'", ", ".join(names) + " or FILE.toml", did_you_mean(key, names))
    return Path(str(files(package) / f"{key}.toml"))
