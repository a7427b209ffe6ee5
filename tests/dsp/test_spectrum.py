"""The spectrum of a short window: power, floor and peaks."""

import numpy as np
import pytest

from monochord.core.types import Floats
from monochord.dsp.spectrum import Analyser, Peaks, noise_floor, power_spectrum

RATE, SIZE, PADDED = 44100, 4410, 16384
TAPER = np.hanning(SIZE + 1)[:-1]
SPACING = RATE / PADDED


def tones(*frequencies: float, levels: tuple[float, ...] = ()) -> Floats:
    time = np.arange(SIZE) / RATE
    amplitude = levels or (1.0,) * len(frequencies)
    return sum(
        (a * np.sin(2.0 * np.pi * f * time + f) for f, a in zip(frequencies, amplitude, strict=True)),
        start=np.zeros(SIZE),
    )


ANALYSER = Analyser(sample_rate=RATE, size=SIZE, top=6000.0)


def peaks(samples: Floats, least: float = 3.0) -> Peaks:
    power = ANALYSER.powers(samples[np.newaxis])[0]
    return ANALYSER.peaks(power, ANALYSER.salience(power), least)


def test_a_quiet_channel_counts_as_much_as_a_loud_one() -> None:
    loud, quiet = tones(500.0), 1e-3 * tones(900.0)
    power = power_spectrum(np.stack([loud, quiet]), TAPER, PADDED)
    at = [round(f / SPACING) for f in (500.0, 900.0)]
    assert power[0, at[0]] == pytest.approx(power[1, at[1]], rel=0.1)


def test_room_and_fewer_bins_change_no_number() -> None:
    sound = np.stack([tones(500.0), tones(900.0)]).astype(np.float32)
    whole = power_spectrum(sound, TAPER, PADDED)
    buffer = np.full(PADDED // 2 + 1, np.nan, np.complex128)
    assert whole.shape == (2, PADDED // 2 + 1)
    for _ in range(2):
        np.testing.assert_array_equal(power_spectrum(sound, TAPER, PADDED, 2000, buffer), whole[:, :2000])


def test_the_floor_rests_on_the_quantile_of_each_block() -> None:
    power = np.random.default_rng(4).exponential(1.0, 1000)
    lowest = np.quantile(power.reshape(10, 100), 0.15, axis=1) / -np.log1p(-0.15)
    np.testing.assert_allclose(noise_floor(power, 100)[50::100], lowest, rtol=0.2)
    one = noise_floor(power, 1000)
    np.testing.assert_allclose(one, np.quantile(power, 0.15) / -np.log1p(-0.15), rtol=1e-12)


def test_silence_has_no_power_and_no_peaks() -> None:
    power = power_spectrum(np.zeros((2, SIZE)), TAPER, PADDED)
    assert power.max() == 0.0
    assert np.isfinite(noise_floor(power[0], 186)).all()
    assert peaks(np.zeros(SIZE)).frequency.size == 0


def test_floor_is_blind_to_partials() -> None:
    noise = 0.01 * np.random.default_rng(3).standard_normal(SIZE)
    sound = noise + 0.1 * tones(*(200.0 * n for n in range(1, 20)))
    bare, full = (power_spectrum(x[np.newaxis], TAPER, SIZE)[0] for x in (noise, sound))
    scale = np.var(noise) / np.var(sound)
    ratio = noise_floor(full, 60)[50:400] / (scale * noise_floor(bare, 60)[50:400])
    assert 0.3 < np.median(ratio) < 3.0


@pytest.mark.parametrize("frequency", [82.4, 4999.9])
def test_peak_lies_on_the_tone(frequency: float) -> None:
    lines = peaks(tones(frequency))
    assert lines.frequency[np.argmax(lines.power)] == pytest.approx(frequency, abs=0.15)
    assert lines.rank[np.argmax(lines.power)] == 1.0


def test_side_lobes_are_left_out_and_weak_tones_kept() -> None:
    lines = peaks(tones(1000.0, 1600.0, levels=(1.0, 0.003)), least=1.0).frequency
    strong = lines[(lines > 950.0) & (lines < 1050.0)]
    assert strong.size == 1
    assert np.abs(lines - 1600.0).min() < 0.5
    assert lines.size < 12


def test_a_peak_of_noise_is_less_sure_than_a_tone() -> None:
    noisy = tones(1000.0) + 0.3 * np.random.default_rng(1).standard_normal(SIZE)
    lines = peaks(noisy, least=1.0)
    assert lines.variance[np.argmax(lines.power)] < 0.1 * lines.variance[np.argmin(lines.power)]
