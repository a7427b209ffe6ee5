"""The two-sided form on sound whose lines are known, and why a window cannot be used."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import OUTSIDE_RANGE, Audio, Contact, Estimates, Floats, Signal, Window
from monochord.perception.closed_form.two_segments import TwoSegments
from monochord.perception.closed_form.usable import CLIPPED_SHARE, unusable_reason
from monochord.perception.features import FEATURES
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency, segment_frequencies

RATE, SIZE = 44100, 4410
STRING = load_string("appendix").string
FORM = TwoSegments(string=STRING, law="linear", most_force=2.5)
TONE = 0.3 * np.sin(0.2 * np.arange(2.0 * SIZE)).reshape(2, SIZE)


def window(samples: Audio | Floats, *, has_gap: bool = False) -> Window:
    return Window(samples=np.asarray(samples, np.float32), start=0, sample_rate=RATE, has_gap=has_gap)


def sound(frequencies: tuple[float, float], *, noise: float = 1e-4) -> Floats:
    """Three partials of each segment, stronger at its own microphone."""
    time = np.arange(SIZE) / RATE
    own = [sum(np.sin(2.0 * np.pi * n * f * time + n) / n**2 for n in (1, 2, 3)) for f in frequencies]
    both = 0.2 * np.stack((own[0] + 0.2 * own[1], own[1] + 0.2 * own[0]))
    return both + noise * np.random.default_rng(1).standard_normal(both.shape)


def estimated(
    contact: Contact, *, noise: float = 1e-4, shift: float = 0.0, form: TwoSegments = FORM
) -> Estimates:
    f1, f2 = segment_frequencies(STRING, contact)
    return form.prepare(RATE, SIZE)(window(sound((f1 * (1.0 + shift), f2 * (1.0 + shift)), noise=noise)))


@pytest.mark.parametrize(("position", "reason"), [(0.14, OUTSIDE_RANGE), (0.23, ""), (0.5, OUTSIDE_RANGE)])
def test_outside_the_sensing_range_contact_alone_is_told(position: float, reason: str) -> None:
    form = replace(FORM, sensing_range=(0.16, 0.48))
    estimates = estimated(Contact(position=position, force=1.0), form=form)
    assert estimates["contact"].value == 1.0
    assert {estimates[name].reason for name in ("position", "force", "tension")} == {reason}


def test_the_lower_of_both_is_the_frequency() -> None:
    for position, lower in ((0.2, "frequency_2"), (0.45, "frequency_1")):
        estimates = estimated(Contact(position=position, force=1.0))
        assert estimates["frequency"] == estimates[lower]


def test_errors_are_within_four_standard_errors() -> None:
    contact = Contact(position=0.23, force=1.0)
    estimates = estimated(contact, noise=0.02)
    for name, truth in (("position", contact.position), ("force", contact.force)):
        estimate = estimates[name]
        assert estimate.valid
        assert abs(estimate.value - truth) < 4.0 * estimate.std


@pytest.mark.parametrize("shift", [-0.12, 0.25])
def test_a_tension_that_no_force_explains_is_no_reading_of_this_touch(shift: float) -> None:
    position = estimated(Contact(position=0.23, force=1.0), shift=shift)["position"]
    assert not position.valid or abs(position.value - 0.23) > 5e-3


def test_the_estimator_and_the_feature_read_the_same() -> None:
    string = load_string("prototype").string
    nominal = open_frequency(string) * string.length
    touch = sound((nominal / 0.08, nominal / 0.12), noise=1e-3).astype(np.float32)
    estimates = TwoSegments(string=string, law="geometric", most_force=2.5).prepare(RATE, SIZE)(window(touch))
    signal = Signal(sample_rate=RATE, channels=2, string=string)
    extract = FEATURES.build("closed_form").prepare(signal, SIZE)
    row = dict(zip(extract.columns, extract(touch[np.newaxis])[0].tolist(), strict=True))
    for name in ("position", "tension"):
        assert estimates[name].value == pytest.approx(row[name], rel=1e-6)


class TestUsable:
    def test_a_tone_is_usable_without_a_gap(self) -> None:
        assert unusable_reason(window(TONE)) == ""
        assert unusable_reason(window(TONE, has_gap=True)) == "gap"

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_one_sample_that_is_not_a_number_is_enough(self, bad: float) -> None:
        samples = TONE.copy()
        samples[1, 4000] = bad
        assert unusable_reason(window(samples)) == "samples that are not numbers"

    def test_silence_is_judged_about_the_mean_and_by_the_louder_channel(self) -> None:
        unit = TONE / TONE.std()
        assert unusable_reason(window(0.5 + 0.9 * SILENT_LEVEL * np.sign(TONE))) == "silence"
        assert unusable_reason(window(0.5 + 1.5 * SILENT_LEVEL * unit)) == ""
        assert unusable_reason(window(np.stack((np.zeros(SIZE), TONE[1])))) == ""

    @pytest.mark.parametrize("top", [1.0, 0.4])
    def test_clipping_at_any_level(self, top: float) -> None:
        unit = TONE / 0.3
        for share, reason in ((1.3, "clipped"), (0.7, "")):
            peak = np.cos(0.5 * np.pi * share * CLIPPED_SHARE)
            assert unusable_reason(window(top * np.clip(unit / peak, -1.0, 1.0))) == reason
