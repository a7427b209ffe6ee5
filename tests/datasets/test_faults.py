import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.datasets.faults import FAULTS, Fault


@pytest.fixture
def windows() -> Audio:
    return (0.1 * np.random.default_rng(0).normal(size=(8, 2, 2000))).astype(np.float32)


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_depends_on_seed_epoch_and_row_alone(windows: Audio, kind: str) -> None:
    fault, rows = Fault(kind=kind), np.arange(8)
    spoilt = fault(windows, rows, seed=3, epoch=2)
    np.testing.assert_array_equal(fault(windows[5:6], [5], seed=3, epoch=2)[0], spoilt[5])
    assert spoilt.dtype == np.float32
    assert np.isfinite(spoilt).all()
    assert np.abs(spoilt).max() <= 1.0
    if kind != "microphones swapped":
        assert not np.array_equal(fault(windows, rows, seed=4, epoch=2), spoilt)


def test_a_dead_microphone_is_far_below_the_other(windows: Audio) -> None:
    for number in (1, 2):
        spoilt = Fault(kind=f"microphone {number} dead")(windows, np.arange(8))
        rms = np.sqrt(np.mean(spoilt**2, axis=2))
        assert (rms[:, number - 1] < 0.2 * rms[:, 2 - number]).all()
        np.testing.assert_array_equal(spoilt[:, 2 - number], windows[:, 2 - number])


def test_swapped_microphones_are_exchanged(windows: Audio) -> None:
    spoilt = Fault(kind="microphones swapped")(windows, np.arange(8))
    np.testing.assert_array_equal(spoilt, windows[:, ::-1])


def test_clipping_and_hum_cover_the_string(windows: Audio) -> None:
    clipped = Fault(kind="clipping")(windows, np.arange(8))
    assert (np.mean(np.abs(clipped) == 1.0, axis=(1, 2)) > 0.01).all()
    hum = Fault(kind="hum")(windows, np.arange(8))
    assert (np.mean((hum - windows) ** 2, axis=(1, 2)) > 0.5 * np.mean(windows**2, axis=(1, 2))).all()


def test_a_second_string_adds_lines_elsewhere() -> None:
    sine = (0.1 * np.sin(2.0 * np.pi * 1000.0 / 44100.0 * np.arange(4410))).astype(np.float32)
    spoilt = Fault(kind="second string")(np.stack([[sine, sine]] * 8), np.arange(8))
    power = np.abs(np.fft.rfft(spoilt * np.hanning(4410))) ** 2
    own, others = power[:, :, 98:103].sum(axis=2), power.copy()
    others[:, :, 98:103] = 0.0
    second = others.argmax(axis=2) * 10.0
    assert (others.sum(axis=2) > 0.1 * own).all()
    assert (np.abs(second / 1000.0 - 1.0) > 0.02).all()
    assert (np.abs(second / 1000.0 - 1.0) < 0.4).all()


def test_an_unknown_fault_is_refused() -> None:
    with pytest.raises(InputError, match="did you mean"):
        Fault(kind="microphone 3 dead")
