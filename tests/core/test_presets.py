"""Presets are found by name, or named as a file."""

from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.core.presets import preset_names, preset_path

MATERIALS = "monochord.physics.materials"


def test_every_name_leads_to_its_file() -> None:
    names = preset_names(MATERIALS)
    assert names == sorted(names)
    for name in names:
        assert preset_path(MATERIALS, "material", name).stem == name
        assert preset_path(MATERIALS, "material", name.replace("_", "-")).is_file()


def test_a_file_of_ones_own_is_taken_as_it_is() -> None:
    assert preset_path(MATERIALS, "material", "of/mine.toml") == Path("of/mine.toml")


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"material 'wod': allowed is .*wood.*FILE\.toml.*wood"):
        preset_path(MATERIALS, "material", "wod")
