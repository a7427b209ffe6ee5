"""The simulated string as a source."""

import time
from typing import Any

import numpy as np
import pytest

from monochord.capture.sources._script import ScriptedTouch
from monochord.capture.sources.split_string import SplitStringSource
from monochord.core.errors import InputError
from monochord.core.labels import SETTLED
from monochord.core.types import Audio, Contact, Truth
from monochord.physics.split_string.feedback import lines
from monochord.physics.theory import mixing_matrix, segment_frequencies

RATE = 44100
SCRIPT = (ScriptedTouch(start=0.5, position=0.25, force=1.5, seconds=0.6),)


def audio(**options: Any) -> Audio:
    with SplitStringSource(speed=0.0, **options).open() as stream:
        return np.concatenate([block.samples for block in stream], axis=1)


def truths(at: list[tuple[float, float]], **options: Any) -> list[Truth]:
    with SplitStringSource(speed=0.0, **options).open() as stream:
        assert sum(block.samples.shape[1] for block in stream) > 0
        return [stream.truth(round(a * RATE), round(b * RATE)) for a, b in at]


def test_a_seed_fixes_everything_and_another_changes_it() -> None:
    options: dict[str, Any] = {"duration": 0.5, "hold": 0.1}
    first, again, other = (audio(seed=seed, **options) for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert np.abs(first - other).max() > 0.01


def test_the_sound_is_that_of_the_scripted_touch() -> None:
    sound = audio(duration=1.1, script=SCRIPT)
    with SplitStringSource().open() as stream:
        string = stream.signal.string
    assert string is not None
    expected = segment_frequencies(string, Contact(position=0.25, force=1.5))
    ratios = lines(sound[:, round(0.8 * RATE) :].astype(np.float64), RATE)[0] / expected
    assert ratios / np.round(ratios) == pytest.approx([1.0, 1.0], rel=1e-3)


def test_the_truth_tells_the_touch_and_whether_it_has_settled() -> None:
    ranges = [(0.1, 0.2), (0.45, 0.55), (0.6, 0.7), (0.66, 0.76), (1.3, 1.4)]
    before, onset, early, settled, after = truths(ranges, duration=1.5, script=SCRIPT)
    free = {"contact": 0.0, "transition": 0.0}
    # It has been plucked at 0 s, and settles 0.15 s later.
    assert before == free | {"settled": pytest.approx(0.5, abs=0.01)}
    assert onset == {"transition": 1.0, "settled": pytest.approx(0.5, abs=0.01)}
    touched = {
        "contact": 1.0,
        "transition": 0.0,
        "position": pytest.approx(0.25),
        "force": pytest.approx(1.5),
        "force_std": pytest.approx(0.0, abs=1e-6),
    }
    assert early == touched | {"settled": pytest.approx(0.5, abs=0.01)}
    assert settled == touched | {"settled": pytest.approx(1.0)}
    assert after == free | {"settled": pytest.approx(1.0)}


def test_random_touches_keep_to_their_ranges() -> None:
    at = [(0.1 * k, 0.1 * k + 0.1) for k in range(60)]
    seen = truths(at, duration=6.0, hold=0.15, places=(0.4, 0.6), forces=(0.5, 0.7), block=4096)
    touched = [t for t in seen if t.get("contact")]
    assert 5 < len(touched) < len(seen) - 5
    assert all(0.4 * 0.65 <= t["position"] <= 0.6 * 0.65 and 0.5 <= t["force"] <= 0.7 for t in touched)
    assert len({t["position"] for t in touched}) > 4


def test_the_pace_is_that_of_the_clock() -> None:
    with SplitStringSource(duration=0.3).open() as stream:
        began = time.monotonic()
        blocks = list(stream)
        assert time.monotonic() - began > 0.29
    times = [b.adc_time for b in blocks]
    assert (times[0] or 0.0) >= began - 0.05
    assert times[-1] == pytest.approx((times[0] or 0.0) + blocks[-1].start / RATE, abs=1e-9)


def test_a_reader_that_dawdles_sees_what_is_pending() -> None:
    with SplitStringSource(duration=10.0, block=256).open() as stream:
        next(iter(stream))
        time.sleep(0.1)
        assert 0.08 * RATE < stream.pending < 10.0 * RATE
        assert stream.pending % 256 == 0


@pytest.mark.parametrize("preset", ["prototype", "bass_100"])
def test_every_string_has_about_the_given_level(preset: str) -> None:
    sound = audio(preset=preset, level=0.1, duration=1.0, script=(ScriptedTouch(start=5.0, position=0.1),))
    assert np.abs(sound).max(axis=1) == pytest.approx([0.1, 0.1], rel=0.6)
    assert np.abs(sound[:, -4410:]).max(axis=1) == pytest.approx([0.1, 0.1], rel=0.3)


def test_noise_has_the_given_level() -> None:
    quiet, noisy = (audio(duration=0.2, noise=noise, script=SCRIPT) for noise in (0.0, 0.01))
    assert np.std(noisy - quiet) == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ({"preset": "apendix"}, "apendix"),
        ({"speed": -1.0}, "-1"),
        ({"duration": float("nan")}, "nan"),
        ({"block": 0}, "0"),
        ({"hold": 0.0}, "0"),
        ({"forces": (2.0, 1.0)}, "2 to 1"),
        ({"places": (0.0, 0.5)}, r"places.* 0"),
        ({"sample_rate": 1}, "1"),
        ({"script": (ScriptedTouch(position=0.7),)}, "0.7"),
        ({"script": (ScriptedTouch(start=-1.0, position=0.2),)}, "-1"),
        ({"script": (ScriptedTouch(position=0.2, force=-1.0),)}, "-1"),
        ({"script": (ScriptedTouch(position=0.2, across=0.01),)}, "across"),
        ({"script": (ScriptedTouch(start=2.0, position=0.2), ScriptedTouch(position=0.2))}, "order"),
    ],
)
def test_options_that_cannot_be_used_are_refused(options: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given), SplitStringSource(**options).open():
        pass


def harmonics(strike: float) -> list[float]:
    """Which harmonic each side sounds at, over some touches."""
    ratios: list[float] = []
    with SplitStringSource(speed=0.0, duration=15.0, seed=3, strike=strike, block=4410).open() as stream:
        string = stream.signal.string
        assert string is not None
        for block in stream:
            truth = stream.truth(block.start, block.start + 4410)
            if truth.get("contact") and truth["settled"] >= SETTLED and block.samples.shape[1] == 4410:
                contact = Contact(position=truth["position"], force=truth["force"])
                unmixed = np.linalg.inv(mixing_matrix(0.85, 0.85)).astype(np.float64) @ block.samples
                ratios += list(lines(unmixed, RATE)[0] / segment_frequencies(string, contact))
    return ratios


def test_a_struck_string_sounds_at_its_fundamentals_and_a_stroked_one_as_history_has_it() -> None:
    struck, stroked = harmonics(3.0), harmonics(0.0)
    assert len(struck) > 50
    assert struck == pytest.approx([1.0] * len(struck), abs=0.01)
    assert max(stroked) > 1.9
