"""The closed-form estimator: both forms against exact physics, and its abstentions."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from tests.perception.windows import RATE, SIZE, cut

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Contact, Estimate, Signal, StringParams, Window
from monochord.perception.estimators.closed_form import ClosedForm
from monochord.physics.sensors import load_sensor
from monochord.physics.split_string import SplitString, simulate
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies
from monochord.physics.twin.virtual_sensor import VirtualSensor

MONO = Signal(sample_rate=RATE, channels=1)
APPENDIX = load_string("appendix").string


def note(f0: float, *, inharmonicity: float = 1e-4, level: float = 0.3, every: int = 1) -> Audio:
    time = np.arange(SIZE) / RATE
    n = np.arange(1.0, 13.0, every)[:, np.newaxis]
    partial = np.sin(2.0 * np.pi * f0 * n * np.sqrt(1.0 + inharmonicity * n * n) * time + n) / n
    hiss = 1e-5 * np.random.default_rng(2).standard_normal(SIZE)
    return (level * partial.sum(axis=0) + hiss)[np.newaxis].astype(np.float32)


def window(samples: Audio, *, has_gap: bool = False) -> Window:
    return Window(samples=samples, start=0, sample_rate=RATE, has_gap=has_gap)


def far(samples: Audio, **options: object) -> dict[str, Estimate]:
    estimator = ClosedForm(length=0.65, open_frequency=110.0, **options)  # pyright: ignore[reportArgumentType]
    return dict(estimator.prepare(MONO, SIZE)(window(samples)))


class TestFarSegment:
    @pytest.mark.parametrize("position", [0.0, 0.01, 0.2, 0.5])
    def test_position_is_that_of_the_clamp(self, position: float) -> None:
        estimates = far(note(110.0 * 0.65 / (0.65 - position)))["position"]
        assert estimates.value == pytest.approx(position, abs=5e-4)
        assert 0.5e-3 < estimates.std < 4e-3

    def test_a_known_string_needs_no_options(self) -> None:
        signal = Signal(sample_rate=RATE, channels=1, string=APPENDIX)
        estimates = ClosedForm().prepare(signal, SIZE)(window(note(243.25 / 0.8)))
        assert estimates["position"].value == pytest.approx(0.13, abs=5e-4)

    def test_calibration_learns_what_pressing_does(self) -> None:
        def pressed(position: float) -> float:
            return 110.0 * 1.006 * 0.65 / (0.65 - position)

        truth = 0.2
        plain = far(note(pressed(truth)))["position"]
        takes = tuple((pressed(p), p) for p in (0.1, 0.3))
        helped, other = (
            far(note(pressed(truth)), calibration=each)["position"] for each in (takes, takes[::-1])
        )
        assert other.value == pytest.approx(helped.value, abs=1e-9), "in whatever order they were taken"
        assert abs(plain.value - truth) > 2e-3
        assert abs(helped.value - truth) < 0.4e-3
        assert helped.std < 0.5 * plain.std

    def test_a_take_at_the_nut_is_the_open_note(self) -> None:
        estimates = far(note(112.0 * 0.65 / 0.5), calibration=((112.0, 0.0),))["position"]
        assert estimates.value == pytest.approx(0.15, abs=5e-4)

    @pytest.mark.parametrize(
        ("samples", "reason"),
        [
            (np.zeros((1, SIZE), np.float32), Reason.SILENCE),
            (np.full((1, SIZE), 0.5, np.float32), Reason.SILENCE),
            (np.full((1, SIZE), np.nan, np.float32), Reason.NOT_NUMBERS),
            (np.clip(40.0 * note(150.0), -1.0, 1.0), Reason.CLIPPED),
            (
                0.1 * np.random.default_rng(1).standard_normal((1, SIZE)).astype(np.float32),
                Reason.NO_STRUCTURE,
            ),
            (0.5 * (note(150.0) + note(163.0)), Reason.TWO_NOTES),
        ],
    )
    def test_abstains_with_a_reason(self, samples: Audio, reason: Reason) -> None:
        estimates = far(samples)
        assert all(not estimate.valid for estimate in estimates.values())
        assert Reason.of(estimates["position"].reason) is reason
        assert np.isnan(estimates["position"].value)

    @pytest.mark.parametrize("ratio", [0.33, 0.5, 2 / 3, 0.97, 6.0, 9.0])
    def test_a_note_outside_the_strings_range_is_not_taken_for_its_octave(self, ratio: float) -> None:
        estimates = far(note(110.0 * ratio))["position"]
        assert not estimates.valid

    @pytest.mark.parametrize("ratio", [1.12, 1.5])
    def test_two_strings_at_once_are_no_place_between(self, ratio: float) -> None:
        estimates = far(0.5 * (note(122.2) + note(122.2 * ratio)))["position"]
        assert Reason.of(estimates.reason) in (Reason.TWO_NOTES, Reason.OTHER_NOTE)

    def test_of_two_strings_at_once_the_older_goes_on(self) -> None:
        estimate = ClosedForm(length=0.65, open_frequency=110.0).prepare(MONO, SIZE)
        notes = [note(122.2), note(122.2), note(122.2) + note(145.4), note(122.2)]
        places = [estimate(each) for each in cut(0.5 * np.concatenate(notes, axis=1))]
        assert [p["position"].value for p in places] == pytest.approx([0.0649] * 4, abs=1e-3)

    @pytest.mark.parametrize("position", [0.0, 0.3])
    def test_a_string_plucked_at_its_middle_is_heard(self, position: float) -> None:
        estimates = far(note(110.0 * 0.65 / (0.65 - position), every=2))["position"]
        assert estimates.value == pytest.approx(position, abs=1e-3)

    def test_a_calibration_take_that_cannot_be_is_refused(self) -> None:
        with pytest.raises(InputError, match="take"):
            far(note(150.0), calibration=((200.0, 0.6),))

    def test_a_gap_abstains(self) -> None:
        estimate = ClosedForm(length=0.65, open_frequency=110.0).prepare(MONO, SIZE)
        assert estimate(window(note(150.0), has_gap=True))["position"].reason is Reason.GAP

    @pytest.mark.parametrize(
        "options",
        [
            {"length": -1.0, "open_frequency": 110.0},
            {"length": 0.65, "open_frequency": 0.0},
            {"length": 0.65},
            {"open_frequency": 110.0},
            {"length": np.nan, "open_frequency": 110.0},
            {"length": 0.65, "open_frequency": 110.0, "calibration": ((110.0,),)},
            {"length": 0.65, "open_frequency": 110.0, "calibration": ((110.0, 0.7),)},
            {"length": 0.65, "open_frequency": 110.0, "sides": "both"},
            {"length": 0.65, "open_frequency": 110.0, "reach": 1.0},
        ],
    )
    def test_bad_options_are_refused(self, options: dict[str, float]) -> None:
        with pytest.raises(InputError):
            ClosedForm(**options).prepare(MONO, SIZE)  # pyright: ignore[reportArgumentType]


def touched(contact: Contact | None, string: StringParams = APPENDIX, at: float = 0.6) -> Window:
    sound = simulate(SplitString(string=string, contact=contact), at + 0.15, route="modal").microphones
    noise = 1e-4 * np.abs(sound).max() * np.random.default_rng(4).standard_normal(sound.shape)
    first = round(at * RATE)
    return window((0.5 * (sound + noise) / np.abs(sound).max())[:, first : first + SIZE].astype(np.float32))


class TestTwoSegments:
    signal = Signal(sample_rate=RATE, channels=2, string=APPENDIX)

    @pytest.mark.parametrize(("position", "force"), [(0.1, 1.0), (0.2275, 2.0), (0.4, 0.2), (0.55, 1.0)])
    def test_position_and_force_of_a_simulated_touch(self, position: float, force: float) -> None:
        estimates = ClosedForm().prepare(self.signal, SIZE)(touched(Contact(position=position, force=force)))
        assert estimates["contact"].value > 0.99
        assert estimates["position"].value == pytest.approx(position, abs=6e-4)
        assert estimates["force"].value == pytest.approx(force, abs=0.2)
        assert abs(estimates["force"].value - force) < estimates["force"].std
        f1, f2 = segment_frequencies(APPENDIX, Contact(position=position, force=force))
        assert estimates["frequency_1"].value == pytest.approx(f1, rel=1e-3)
        assert estimates["frequency_2"].value == pytest.approx(f2, rel=1e-3)

    def test_an_untouched_string_is_no_contact(self) -> None:
        estimates = ClosedForm().prepare(self.signal, SIZE)(touched(None))
        assert estimates["contact"].value < 0.01
        assert estimates["position"].reason is Reason.NO_CONTACT

    @pytest.mark.parametrize(
        ("n1", "n2", "resolved"),
        [(2, 1, True), (3, 1, True), (1, 3, True), (1, 2, False), (2, 3, False)],
    )
    def test_harmonic_numbers_are_resolved_or_both_readings_owned(
        self,
        n1: int,
        n2: int,
        resolved: bool,  # noqa: FBT001
    ) -> None:
        contact = Contact(position=0.21, force=0.8)
        f1, f2 = segment_frequencies(APPENDIX, contact)
        time = np.arange(SIZE) / RATE
        own_1, own_2 = np.sin(2 * np.pi * n1 * f1 * time), np.sin(2 * np.pi * n2 * f2 * time + 1.0)
        sound = np.stack([0.85 * own_1 + 0.15 * own_2, 0.15 * own_1 + 0.85 * own_2])
        noise = 1e-4 * np.random.default_rng(1).standard_normal(sound.shape)
        estimates = ClosedForm().prepare(self.signal, SIZE)(window((0.3 * sound + noise).astype(np.float32)))
        if resolved:
            assert estimates["position"].value == pytest.approx(contact.position, abs=1e-3)
            assert abs(estimates["force"].value - contact.force) < estimates["force"].std
        else:
            assert estimates["position"].reason is Reason.TWO_CANDIDATES

    @pytest.mark.parametrize("base", [50.0, 60.0])
    def test_mains_hum_changes_nothing(self, base: float) -> None:
        contact = Contact(position=0.2, force=1.0)
        plain = touched(contact)
        turns = 2.0 * np.pi * base * np.arange(1.0, 20.0, 2.0)[:, np.newaxis] * np.arange(SIZE) / RATE
        hum = (np.sin(turns) / np.arange(1.0, 20.0, 2.0)[:, np.newaxis]).sum(axis=0)
        hum *= 10.0**-0.5 * plain.samples.std() / hum.std()
        hummed = window((plain.samples + np.array([[1.0], [0.6]]) * hum).astype(np.float32))
        estimate = ClosedForm().prepare(self.signal, SIZE)
        assert estimate(hummed)["position"].value == pytest.approx(contact.position, abs=6e-4)
        assert estimate(hummed)["contact"].value > 0.99

    def test_swapping_the_channels_mirrors_the_string(self) -> None:
        seen = touched(Contact(position=0.2, force=1.0))
        estimate = ClosedForm().prepare(self.signal, SIZE)
        mirrored = estimate(window(np.ascontiguousarray(seen.samples[::-1])))
        assert mirrored["position"].value == pytest.approx(0.65 - estimate(seen)["position"].value, abs=1e-6)

    def test_it_abstains_from_all_with_one_reason(self) -> None:
        noise = 0.1 * np.random.default_rng(1).standard_normal((2, SIZE))
        for samples, reason in (
            (0.0 * noise, Reason.SILENCE),
            (np.nan * noise, Reason.NOT_NUMBERS),
            (noise, Reason.NO_STRUCTURE),
        ):
            estimates = ClosedForm().prepare(self.signal, SIZE)(window(samples.astype(np.float32)))
            (stated,) = {each.reason for each in estimates.values()}
            assert stated is reason

    def test_a_string_that_does_not_tell_force_says_so(self) -> None:
        string = StringParams(length=0.65, linear_density=6.5e-4, tension=65.0)
        signal = Signal(sample_rate=RATE, channels=2, string=string)
        estimates = ClosedForm().prepare(signal, SIZE)(touched(Contact(position=0.2, force=1.0), string))
        assert estimates["position"].value == pytest.approx(0.2, abs=5e-4)
        assert not estimates["force"].valid

    def test_the_geometric_law_tells_force_too(self) -> None:
        string = load_string("plain_010").string
        signal = Signal(sample_rate=RATE, channels=2, string=string)
        contact = Contact(position=0.25, force=1.5)
        setup = SplitString(string=string, contact=contact, tension_law="geometric")
        sound = simulate(setup, 0.75, route="modal").microphones
        cut = (0.5 * sound / np.abs(sound).max())[:, 26460 : 26460 + SIZE].astype(np.float32)
        estimates = ClosedForm(tension_law="geometric").prepare(signal, SIZE)(window(cut))
        assert estimates["position"].value == pytest.approx(0.25, abs=1e-3)
        assert abs(estimates["force"].value - 1.5) < estimates["force"].std
        # A pitch that is not measured, 2 % of the tension, is as much as a whole press raises it.
        assert 0.5 < estimates["force"].std < 2.5
        assert 1e-3 < estimates["position"].std < 3e-3


@cache
def twin_windows(ratio: float, position: float, untouched: float) -> tuple[list[Window], float]:
    """Return windows of a twin that is tuned to `ratio` times nominal: untouched for a time, then touched."""
    design = load_sensor("prototype")
    sensor = replace(design, string=replace(design.string, tension=design.string.tension * ratio**2))
    twin = VirtualSensor(sensor, seed=7)
    before = twin.advance(0.4 + untouched)[0][:, round(0.4 * RATE) :]
    twin.press(position, 0.8)
    twin.advance(0.35)
    return cut(np.concatenate((before, twin.advance(0.5)[0]), axis=1), SIZE // 2), untouched


class TestAnotherTuning:
    prototype = load_sensor("prototype").string

    @pytest.mark.parametrize("ratio", [0.91, 1.09])
    @pytest.mark.parametrize(
        "options", [{"tension_law": "geometric"}, {"length": 0.2, "open_frequency": 1010.6}]
    )
    def test_it_re_tunes_itself_by_untouched_windows(self, ratio: float, options: dict[str, Any]) -> None:
        string = None if "length" in options else self.prototype
        signal = Signal(sample_rate=RATE, channels=2, string=string)
        estimate = ClosedForm(**options).prepare(signal, SIZE)
        windows, untouched = twin_windows(ratio, 0.072, 0.5)
        for each in windows:
            position = estimate(each)["position"]
            if each.start >= untouched * RATE:
                assert position.value == pytest.approx(0.072, abs=1e-3)

    @pytest.mark.parametrize("ratio", [0.91, 0.955, 1.06])
    @pytest.mark.parametrize("known", [True, False])
    def test_without_one_it_is_right_or_abstains(self, ratio: float, *, known: bool) -> None:
        signal = Signal(sample_rate=RATE, channels=2, string=self.prototype if known else None)
        options: dict[str, Any] = {} if known else {"length": 0.2, "open_frequency": 1010.6}
        estimate = ClosedForm(**options).prepare(signal, SIZE)
        windows, _ = twin_windows(ratio, 0.072, 0.0)
        for each in windows:
            position = estimate(each)["position"]
            assert not position.valid or position.value == pytest.approx(0.072, abs=1e-3)
            assert position.valid or "run monochord tune" in position.reason

    def test_unknown_density_tells_no_force(self) -> None:
        signal = Signal(sample_rate=RATE, channels=2)
        estimate = ClosedForm(length=0.2, open_frequency=1010.6).prepare(signal, SIZE)
        windows, _ = twin_windows(1.0, 0.072, 0.5)
        *_, last = [estimate(each) for each in windows]
        assert last["position"].valid
        assert {last[name].reason for name in ("force", "tension")} == {Reason.UNKNOWN_DENSITY}
