"""Every preset says where it comes from and agrees with itself; a wrong one is refused."""

from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import harmonic_frequencies, inharmonicity

GOOD = """
title = "My string"
source = "a scale and a ruler"
open_frequency = 243.252
[string]
length = 0.65
linear_density = 6.5e-4
tension = 65.0
"""


@pytest.mark.parametrize("name", string_names())
def test_open_frequency_agrees_with_tension_density_and_length(name: str) -> None:
    preset = load_string(name)
    string = preset.string
    first = harmonic_frequencies(string.length, string.tension, string.linear_density, 1)[0]
    assert first == pytest.approx(preset.open_frequency, rel=2e-4)


@pytest.mark.parametrize("name", string_names())
def test_preset_is_documented_and_plausible(name: str) -> None:
    preset = load_string(name)
    assert preset.name == name
    assert preset.title
    assert len(preset.source) > 20
    assert 10.0 < preset.string.tension < 300.0
    assert 0.0 <= inharmonicity(preset.string) < 1e-3


def test_appendix_is_the_papers() -> None:
    string = load_string("appendix").string
    contact = load_string("appendix").contact
    assert (string.length, string.linear_density, string.tension) == (0.65, 6.5e-4, 65.0)
    assert (string.tension_per_force, string.damping) == (6.0, 0.02)
    assert contact is not None
    assert contact.position == pytest.approx(0.35 * 0.65)


def test_plain_010_is_close_to_the_makers_figure() -> None:
    # D'Addario's guide lists 0.00002215 lb/in for PL010, and 16.2 lb at E4 on 25.5 in.
    string = load_string("plain-010").string
    assert string.linear_density == pytest.approx(0.00002215 * 0.45359237 / 0.0254, rel=0.01)
    assert string.tension == pytest.approx(16.2 * 4.4482, rel=0.02)


def test_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    assert load_string(str(path)).name == "mine"
    preset = load_string(str(path))
    assert preset.contact is None
    assert preset.usual_contact == Contact(position=0.35 * preset.string.length, force=0.0)


def test_unknown_name_is_refused_with_a_suggestion() -> None:
    with pytest.raises(InputError, match="did you mean 'appendix'"):
        load_string("apendix")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("tension", "tensoin"), "did you mean 'tension'"),
        (GOOD.replace("source", "sauce"), "did you mean 'source'"),
        (GOOD.replace("65.0", "-65.0"), "tension -65: allowed is above 0"),
        (GOOD.replace("65.0", "'tight'"), "tension"),
        (GOOD + "damping = -0.1", "damping -0.1: allowed is 0 or more"),
        (GOOD + "[contact]\nposition = 0.7\nforce = 1.0", "strictly between 0 and 0.65 m"),
        (GOOD + "[contact]\nposition = 0.2\nforc = 1.0", "did you mean 'force'"),
        (GOOD.replace('title = "My string"', ""), "title"),
        ("length = ", "TOML"),
    ],
)
def test_wrong_file_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        load_string(str(path))
    assert "\n" not in str(caught.value)


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        load_string(str(tmp_path / "absent.toml"))
