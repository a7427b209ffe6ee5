"""The cells that the reader's network sees, and its arithmetic against a plain one."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Audio, Floats, StringParams
from monochord.perception.reader.cells import CELLS, CHANNELS, LOWEST, STEP, cells_of, spectrum_cells
from monochord.perception.reader.measures import MASS, PLACE
from monochord.perception.reader.network import (
    DILATIONS,
    KINDS,
    POSITIONS,
    STRIDES,
    Network,
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


def random_network(seed: int = 0) -> Network:
    random, shapes = np.random.default_rng(seed), [array.shape for array in bundled_network()]
    return Network(*(random.normal(0.0, 0.1, shape).astype(np.float32) for shape in shapes))


def plain_outputs(cells: Audio, network: Network) -> Floats:
    """Return the network's outputs by a sum for each number, in double precision."""
    values: Floats = cells.astype(float)
    arrays = [array.astype(float) for array in network]
    for layer, (stride, dilation) in enumerate(zip(STRIDES, DILATIONS, strict=True)):
        weights, bias = arrays[2 * layer], arrays[2 * layer + 1]
        taps = len(weights) // len(values)
        pad = taps // 2 * dilation
        padded = np.pad(values, ((0, 0), (pad, pad)))
        columns = [
            padded[:, at : at + (taps - 1) * dilation + 1 : dilation].T.ravel()
            for at in range(0, values.shape[1], stride)
        ]
        values = np.maximum(np.array(columns) @ weights + bias, 0.0).T
    hidden, hidden_bias, last, last_bias = arrays[-4:]
    return np.maximum(values.ravel() @ hidden + hidden_bias, 0.0) @ last + last_bias


def test_the_kernel_computes_what_a_plain_convolution_does() -> None:
    cells = np.random.default_rng(1).random((CHANNELS, CELLS)).astype(np.float32)
    network = random_network(1)
    hidden, outputs = activations(cells, network)
    assert hidden.min() >= 0.0
    assert hidden @ network.last + network.last_bias == pytest.approx(outputs, abs=1e-4)
    assert outputs.shape == (1 + len(POSITIONS) + len(KINDS),)
    np.testing.assert_allclose(outputs, plain_outputs(cells, network), rtol=1e-4, atol=1e-4)


def test_the_network_of_the_package_finds_where_two_pure_segments_meet() -> None:
    reader = Reader.of(analyser_of())
    for place in (0.27, 0.35, 0.44, 0.62, 0.7):
        measures, _, _ = reader.alone(analyser_of().analyse(touched(place)))
        assert measures[PLACE] == pytest.approx(place, abs=0.012)
        assert measures[MASS] > 0.5
