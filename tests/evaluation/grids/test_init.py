"""Every preset can be read, and what is given stands in place of what it says."""

from pathlib import Path

import pytest
from monochord.evaluation.grid import WHOLE

from monochord.core.errors import InputError
from monochord.evaluation.grids import grid_names, load_grid
from monochord.perception.estimators import ESTIMATORS


@pytest.mark.parametrize("name", grid_names())
def test_every_preset_is_a_grid_of_settings_that_there_are(name: str) -> None:
    from monochord.core.config import load_toml, override
    from monochord.perception.training.configs import config_path
    from monochord.perception.training.settings import Settings

    grid = load_grid(name)
    assert grid.title
    assert grid.sensor == "prototype"
    for variation in grid.compared.values():
        if variation.estimator:
            ESTIMATORS.build(variation.estimator, override({}, variation.estimator_set))
        tree = override(load_toml(config_path(variation.config or grid.config)), [*grid.set, *variation.set])
        Settings.read(tree).resolved()


def test_features_are_compared_with_and_without_the_reference() -> None:
    grid = load_grid("features")
    assert (grid.part, grid.noise) == ("test", ("music:10",))
    assert WHOLE not in grid.compared
    names = {name.removesuffix("_alone") for name in grid.compared}
    assert names == {
        "closed_form",
        "fft_harmonic",
        "fft_harmonic_plain",
        "fft_harmonic_sparse",
        "log_mel",
        "yamnet",
        "yamnet_10ms",
        "yamnet_embedding",
        "ast_random",
    }
    thin = {name for name, variation in grid.compared.items() if variation.hop is not None}
    assert thin == {"fft_harmonic_sparse", "yamnet_embedding", "ast_random", "ast_random_alone"}
    for name, variation in grid.compared.items():
        assert ("context.on=false" in variation.set) == name.endswith("_alone")
        assert variation.feature.endswith("without reference") == name.endswith("_alone")


def test_parts_are_judged_on_validation_beside_the_whole() -> None:
    grid = load_grid("parts")
    assert grid.part == "validation"
    assert next(iter(grid.compared)) == WHOLE
    assert {"no_reference", "no_noise", "one_driver", "microphone_1", "window_20ms"} < set(grid.compared)


def test_what_is_given_stands_in_place_of_the_file() -> None:
    told = load_grid("parts", {"dataset": "d", "part": "test"}, ['variations.one_driver.sessions=["one"]'])
    assert (told.dataset, told.part) == (Path("d"), "test")
    assert told.compared["one_driver"].sessions == ("one",)
    assert load_grid("parts", {}, ["noise=['hum:5']"]).noise == ("hum:5",)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[variations.whole]\n", "variation 'whole'"),
        ('[variations."../up"]\n', "variation '../up'"),
        ("[variations.short]\nwindow = 0.05\n", "windows of its own"),
        ("[variations.few]\nshare = 0.0\n", "share 0 of the training sessions"),
        ("variation = 3\n", "did you mean 'variations'"),
        ("title = 3", "title"),
    ],
)
def test_a_grid_that_cannot_be_is_told_in_a_line(tmp_path: Path, text: str, line: str) -> None:
    (tmp_path / "grid.toml").write_text(text)
    with pytest.raises(InputError) as told:
        load_grid(str(tmp_path / "grid.toml"))
    assert line in str(told.value)
    assert "\n" not in str(told.value)


def test_an_unknown_preset_is_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'parts'"):
        load_grid("part")
