"""What trains the reader of modes: of windows of pure lines both networks learn something in seconds."""

from pathlib import Path

import numpy as np
import pytest
from studies._command import main
from studies._place_network import Cells, exported, probabilities_of, train_places
from studies.mode_networks import (
    Examples,
    both_ways,
    chosen,
    joined,
    mirrored,
    pure_examples,
    train_ranking,
    with_places,
    write_network,
)

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.perception.closed_form.hypotheses import MEASURES, PLACE_MEASURES
from monochord.perception.closed_form.place_density import PLACES, SAME_PLACE, density, place_network
from monochord.perception.closed_form.ranking import probabilities, read_ranking
from studies import _place_network, mode_networks

pytest.importorskip("torch")


@pytest.fixture(scope="module")
def examples() -> Examples:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mode_networks, "PURE_WINDOWS", 120)
        return joined(pure_examples())


def test_chosen_windows_keep_their_hypotheses(examples: Examples) -> None:
    some = chosen(examples, examples.build % 3 == 0)
    assert len(some.truth) == len(some.cells) == np.count_nonzero(examples.build % 3 == 0)
    for window, (begin, end) in enumerate(zip(some.first[:-1], some.first[1:], strict=True)):
        of = int(np.flatnonzero(examples.build == some.build[window])[0])
        rows = slice(examples.first[of], examples.first[of + 1])
        np.testing.assert_array_equal(some.position[begin:end], examples.position[rows])
        np.testing.assert_array_equal(some.measures[begin:end], examples.measures[rows])
        assert some.truth[window] == examples.truth[of]


def test_mirroring_twice_changes_nothing(examples: Examples) -> None:
    np.testing.assert_array_equal(mirrored(mirrored(examples.measures)), examples.measures)
    assert examples.measures.shape[1] == MEASURES


def test_the_kernel_gives_what_the_trained_network_does(
    examples: Examples, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_place_network, "EPOCHS", 3)
    monkeypatch.setattr(_place_network, "BATCH", 16)
    network = train_places(examples.cells, examples.truth)
    losses = [float(line.rsplit(maxsplit=1)[1]) for line in capsys.readouterr().out.splitlines()]
    assert len(losses) == 3
    assert losses[2] < losses[1] < losses[0]
    by_torch = probabilities_of(network, examples.cells[:8], swapped=False)
    kernel = [density(cells.astype(np.float32), exported(network)) for cells in examples.cells[:8]]
    np.testing.assert_allclose(kernel, by_torch, rtol=1e-3, atol=1e-7)


def test_the_ranking_learns_to_trust_a_network_that_is_right(
    examples: Examples, monkeypatch: pytest.MonkeyPatch
) -> None:
    def told(_network: object, cells: Cells, *, swapped: bool) -> Floats:
        truth = 1.0 - examples.truth if swapped else examples.truth
        likelihood = np.exp(-0.5 * ((PLACES - truth[:, np.newaxis]) / 0.004) ** 2) + 1e-9
        assert len(cells) == len(truth)
        return likelihood / likelihood.sum(axis=1, keepdims=True)

    monkeypatch.setattr(mode_networks, "probabilities_of", told)
    monkeypatch.setattr(mode_networks, "BATCH", 16)
    measures = both_ways(examples, None)
    known = measures[: len(examples.measures), PLACE_MEASURES] > np.log(0.5)
    near = np.abs(examples.position - examples.truth[examples.window]) < SAME_PLACE + 0.003
    assert np.mean(near[known]) > 0.95
    ranking = train_ranking(examples, measures)
    right = 0
    for window, (begin, end) in enumerate(zip(examples.first[:-1], examples.first[1:], strict=True)):
        probability = probabilities(measures[begin:end].astype(float), ranking)
        right += abs(examples.position[begin + probability.argmax()] - examples.truth[window]) < 0.015
    assert right > 0.95 * len(examples.truth)  # a fifth of windows had no places in training


def test_networks_are_read_back_as_they_were_written(
    examples: Examples, tmp_path_factory: pytest.TempPathFactory
) -> None:
    ranking = train_ranking(examples, np.concatenate((examples.measures, mirrored(examples.measures))))
    file = tmp_path_factory.mktemp("networks") / "ranking.safetensors"
    write_network(ranking, file)
    for written, read in zip(ranking, read_ranking(file), strict=True):
        np.testing.assert_array_equal(np.float32(written), read)


def test_places_by_a_network_of_the_package_are_filled_in(examples: Examples) -> None:
    filled = with_places(examples, place_network())
    np.testing.assert_array_equal(filled.measures[:, :PLACE_MEASURES], examples.measures[:, :PLACE_MEASURES])
    assert filled.measures[:, PLACE_MEASURES:].max() <= 1e-6
    assert filled.measures[:, PLACE_MEASURES:].min() < -1.0


def test_without_a_touch_or_a_dataset_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(InputError, match="touch"):
        joined([])
    for words, said in ((["nowhere"], "nowhere"), (["."], "dataset"), ([".", "--out", "absent"], "--out")):
        monkeypatch.setattr("sys.argv", ["mode_networks", *words])
        monkeypatch.chdir(tmp_path)
        (tmp_path / "src/monochord/perception/closed_form").mkdir(parents=True, exist_ok=True)
        with pytest.raises(SystemExit) as left:
            main(mode_networks.mode_networks)
        error = capsys.readouterr().err
        assert (left.value.code, error.count("\n")) == (2, 1)
        assert said in error
