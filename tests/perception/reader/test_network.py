"""The cells that the reader's network sees, and its arithmetic against a plain one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monochord.core.types import Audio, Floats, StringParams
from monochord.perception.reader.cells import CELLS, CHANNELS, LOWEST, STEP, cells_of, spectrum_cells
from monochord.perception.reader.measures import MASS, PLACE
from monochord.perception.reader.network import (
    BASIS,
    FIRST,
    KINDS,
    PARTIALS,
    POSITIONS,
    STRIDE,
    ReaderNetwork,
    activations,
    bundled_network,
)
from monochord.perception.reader.reader import Reader
from monochord.perception.spectrum import SpectrumAnalyser
from monochord.physics.strings import load_string
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials

SIZE, RATE = 4410, 44100
STRING = load_string("prototype").string


def touched(place: float, string: StringParams = STRING, rate: int = RATE) -> Audio:
    """Return a window of two ideal segments, each with five stiff partials, and hiss."""
    random, time = np.random.default_rng(1), np.arange(SIZE) / rate
    takes: list[Floats] = []
    for share in (place, 1.0 - place):
        partials = stiff_partials(
            open_frequency(string) / share, inharmonicity(string, share * string.length), np.arange(1.0, 6.0)
        )
        loudness = np.arange(1.0, 6.0) ** -2.0
        takes.append(loudness @ np.sin(2.0 * np.pi * np.outer(partials, time)))
    window = np.array([[0.8, 0.1], [0.1, 0.8]]) @ np.array(takes)
    return (0.3 * window + 1e-4 * random.standard_normal(window.shape)).astype(np.float32)


def analyser_of(string: StringParams = STRING, rate: int = RATE) -> SpectrumAnalyser:
    return SpectrumAnalyser(string=string, sample_rate=rate, size=SIZE)


def seen(window: Audio, string: StringParams = STRING, rate: int = RATE) -> Audio:
    analyser = analyser_of(string, rate)
    return spectrum_cells(analyser, analyser.analyse(window))


@pytest.mark.parametrize("place", [0.27, 0.5])
def test_partials_lie_where_their_number_over_the_segments_share_says(place: float) -> None:
    cells = seen(touched(place))
    assert cells.shape == (CHANNELS, CELLS)
    for microphone, share in enumerate((place, 1.0 - place)):
        for number in range(1, 6):
            cell = round(np.log(number / share / LOWEST) / STEP)
            around = cells[microphone, cell - 8 : cell + 9]
            peak = np.flatnonzero(around == around.max())
            assert abs(peak.mean() - 8.0) <= 1.5, (microphone, number)
            assert cells[2 + microphone, cell] > 0.5


def test_what_is_seen_is_relative_to_the_own_pitch() -> None:
    # The same samples, played twice as slowly, are of a string that is tuned an octave lower.
    other = replace(STRING, tension=0.25 * STRING.tension, young_modulus=0.25 * STRING.young_modulus)
    window = touched(0.41)
    np.testing.assert_allclose(seen(window, other, RATE // 2), seen(window), atol=1e-6)


def test_swapping_the_microphones_swaps_the_channels() -> None:
    window = touched(0.27)
    np.testing.assert_array_equal(seen(np.ascontiguousarray(window[::-1])), seen(window)[[1, 0, 3, 2]])


def test_a_spectrum_that_ends_early_leaves_the_cells_above_it_empty() -> None:
    power, height = np.ones((2, 64)), np.ones((2, 8))
    cells = cells_of(power, height, np.ones((2, 64)), open_frequency(STRING) / 100.0, inharmonicity(STRING))
    reached = int(np.log(6300.0 / open_frequency(STRING) / LOWEST) / STEP)
    assert cells[0, : reached - 10].min() == 1.0
    assert not cells[:, reached + 10 :].any()


def test_a_silent_microphone_leaves_its_cells_empty() -> None:
    window = touched(0.27)
    window[1] = 0.0
    cells = seen(window)
    assert not cells[[1, 3]].any()
    assert np.isfinite(activations(cells, bundled_network())[1]).all()


def random_network(seed: int = 0) -> ReaderNetwork:
    random, shapes = np.random.default_rng(seed), [array.shape for array in bundled_network()]
    return ReaderNetwork(*(random.normal(0.0, 0.1, shape).astype(np.float32) for shape in shapes))


def plain_outputs(cells: Audio, network: ReaderNetwork) -> tuple[Floats, Floats]:
    """Return what the last layer sees and the outputs, by sums of products in double precision."""
    own: Any = ReaderNetwork(*(array.astype(float) for array in network))  # pyright: ignore[reportArgumentType]

    def convolved(values: Floats, weights: Floats, bias: Floats, stride: int) -> Floats:
        taps = len(weights) // len(values)
        padded = np.pad(values, ((0, 0), (taps // 2, taps // 2)))
        columns = [padded[:, at : at + taps].T.ravel() for at in range(0, values.shape[1], stride)]
        return np.maximum(np.array(columns) @ weights + bias, 0.0).T

    lines = convolved(cells.astype(float), own.convolution_1, own.bias_1, STRIDE)
    lines = convolved(lines, own.convolution_2, own.bias_2, 1)
    overview = convolved(lines, own.overview_1, own.overview_bias_1, 4)
    overview = convolved(overview, own.overview_2, own.overview_bias_2, 2)
    hidden = np.maximum(overview.ravel() @ own.hidden + own.hidden_bias, 0.0)
    padded = np.pad(lines, ((0, 0), (0, CELLS)))
    combs = np.array([padded[:, at + PARTIALS].T.ravel() for at in range(FIRST, lines.shape[1])])
    combs = np.maximum(combs @ own.comb + own.comb_bias, 0.0).T
    axis = np.log(LOWEST) + STRIDE * STEP * np.arange(FIRST, lines.shape[1])
    both = np.concatenate(
        [
            [np.interp(-np.log(np.maximum(share, 0.05)), axis, comb) for comb in combs]
            for share in (POSITIONS, 1.0 - POSITIONS)
        ]
    )
    places = own.place.T @ np.concatenate((both, BASIS))
    places = np.maximum(places + (own.place_bias + hidden @ own.place_hidden)[:, np.newaxis], 0.0)
    places = convolved(places, own.along, own.along_bias, 1)
    scores = own.score[:, 0] @ places
    density = np.exp(scores) / np.exp(scores).sum()
    seen: Floats = np.concatenate((hidden, places @ density, places.max(axis=1)))
    last = seen @ own.last + own.last_bias
    return seen, np.concatenate((last[:1], scores, last[1:]))


def test_the_kernel_computes_what_plain_sums_do() -> None:
    cells = np.random.default_rng(1).random((CHANNELS, CELLS)).astype(np.float32)
    network = random_network(1)
    told, outputs = activations(cells, network)
    assert outputs.shape == (1 + len(POSITIONS) + len(KINDS),)
    plain_told, plain = plain_outputs(cells, network)
    np.testing.assert_allclose(told, plain_told, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(outputs, plain, rtol=1e-4, atol=1e-4)


def test_what_is_learned_of_one_position_holds_at_all() -> None:
    """Weights that add up a comb's own cell at both ends score highest wherever two segments meet."""
    arrays = {name: np.zeros_like(array) for name, array in bundled_network()._asdict().items()}
    for microphone in range(2):
        for tap in (3, 4, 5):  # levels of the cells from one output to the next
            arrays["convolution_1"][4 * tap + microphone, microphone] = 1.0
        arrays["convolution_2"][12 + microphone, microphone] = 1.0
        arrays["comb"][microphone, microphone] = 1.0  # a fundamental
    size = len(arrays["comb_bias"])
    arrays["place"][0, 0] = arrays["place"][size + 1, 0] = 1.0
    arrays["along"][2 * 24, 0] = arrays["score"][0, 0] = 1.0
    for place in (0.23, 0.4, 0.5, 0.71):
        _, outputs = activations(seen(touched(place)), ReaderNetwork(**arrays))
        assert POSITIONS[outputs[1 : 1 + len(POSITIONS)].argmax()] == pytest.approx(place, abs=0.011)


def test_the_network_of_the_package_finds_where_two_pure_segments_meet() -> None:
    reader = Reader.of(analyser_of())
    for place in (0.27, 0.35, 0.44, 0.62, 0.7):
        measures, _, _ = reader.alone(analyser_of().analyse(touched(place)))
        assert measures[PLACE] == pytest.approx(place, abs=0.012)
        assert measures[MASS] > 0.5
