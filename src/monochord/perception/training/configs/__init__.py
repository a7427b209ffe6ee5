"""Training presets: settings of a training run, one TOML file each, found by name."""

from pathlib import Path

from monochord.core.presets import preset_path

DEFAULT = "reader"
"""The default preset of `monochord train`, and that of the bundled model."""


def config_path(name: str) -> Path:
    """Return the file of a preset by its name, or the file that is named itself.

    Raises
    ------
    InputError
        If there is no such preset.

    Examples
    --------
    >>> config_path("paper").name
    'paper.toml'
    """
    return preset_path(__name__, "configuration", name)
