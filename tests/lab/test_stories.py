"""What touches do over time, as a plan's groups draw it: motions, sound and labels of short sessions."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from tests.lab.tiny import LATE, quiet, session

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.lab.assignment import Assignment
from monochord.lab.offline import delays, describe, make
from monochord.lab.plan import Group
from monochord.lab.render import Rendering, render
from monochord.lab.schedule import Schedule, schedule
from monochord.physics.theory import open_frequency
from monochord.sessions import read_session
from monochord.sessions.alignment import align

HELD = Group(name="held", grid=(3, 1), forces=(0.5, 1.5), hold=(0.3, 0.8))
STORIES = (
    HELD,
    replace(HELD, name="swing", swing=(3.0, 10.0), hold=1.0),
    replace(HELD, name="steps", swing=(3.0, 10.0), steps=(0.01, 0.02), hold=1.0),
    replace(HELD, name="smooth", swing=(3.0, 10.0), smooth=True, rise=(0.3, 0.6), hold=1.0),
    replace(HELD, name="creeps", creep=(1e-4, 4e-4)),
    replace(HELD, name="strong", forces=(7.0, 10.0), hold=0.3),
    replace(HELD, name="fast", protocol="slide", grid=(2, 2), speeds=(0.1, 0.3), strokes=2, hold=0.4),
    replace(HELD, name="stops", protocol="slide", grid=(2, 1), strokes=2, hold=0.4, speeds=(0.01, 0.03),
            dwell=(0.3, 0.6)),
    replace(HELD, name="stops_creeping", protocol="slide", grid=(2, 1), strokes=2, hold=0.4,
            speeds=(0.01, 0.03), dwell=(0.3, 0.6), creep=(1e-4, 4e-4)),
    replace(HELD, name="rolled", protocol="slide", grid=(2, 1), speeds=(0.1, 0.3), strokes=2, hold=0.4,
            rolls=True),
    replace(HELD, name="taps", protocol="tap", grid=(6, 1), hold=(0.02, 0.08), pause=(0.1, 0.3)),
    replace(HELD, name="again", grid=(6, 1), hold=0.2, again=(0.03, 0.2)),
    replace(HELD, name="alone", hold=0.2, grid=(2, 1), pause=(2.0, 3.0)),
    replace(HELD, name="vibrato", vibrato=(1e-3, 3e-3), hold=1.0),
    replace(HELD, name="rolling", vibrato=(1e-3, 3e-3), hold=1.0, rolls=True),
    replace(HELD, name="together", second=(5e-3, 6e-2)),
    replace(HELD, name="in_turn", second=(5e-3, 6e-2), in_turn=(0.1, 0.4), hold=1.0, pause=0.8),
    replace(HELD, name="dies", driver_dies=(0.3, 0.6)),
    replace(HELD, name="on_touched", on_touched=(0.0, 0.2)),
    replace(HELD, name="speech", music="synthetic speech", snr=(0.0, 10.0)),
    replace(HELD, name="songs", music="drawn", snr=(0.0, 10.0)),
)  # fmt: skip


def of(name: str, **changes: object) -> Assignment:
    return session(f"{name}_000", quiet(groups=STORIES, **changes))


@cache
def performed(name: str) -> tuple[Schedule, Rendering]:
    """Return a session of `STORIES`, to be read alone."""
    return schedule(of(name)), render(of(name))


def between(name: str) -> tuple[Floats, dict[str, Floats]]:
    """Return times and labels of a session while the drivers are on."""
    timing, sound = performed(name)
    on = (sound.label_time > timing.on) & (sound.label_time < timing.off)
    return sound.label_time[on], {label: values[on] for label, values in sound.labels.items()}


def lengths(flags: np.ndarray, time: Floats) -> Floats:
    """Return how long each stretch of true flags lasts that begins and ends within."""
    steps = np.diff(flags.astype(int))
    begins = np.flatnonzero(steps == 1)
    ends = np.flatnonzero(steps == -1)
    ends = ends[ends > begins[0]]
    return time[ends] - time[begins[: ends.size]]


def held(name: str, kind: str = "hold") -> list[dict[str, Floats]]:
    """Return the labels of each phase of a kind, 20 ms from its ends."""
    timing, sound = performed(name)
    phases = [phase for phase in timing.motion.phases if phase.kind == kind]
    masks = [
        (sound.label_time > phase.start + 0.02) & (sound.label_time < phase.stop - 0.02) for phase in phases
    ]
    return [{label: values[mask] for label, values in sound.labels.items()} for mask in masks]


def test_holds_are_drawn_from_their_range() -> None:
    phases = performed("held")[0].motion.phases
    holds = [phase.stop - phase.start for phase in phases if phase.kind == "hold"]
    assert len(holds) == len(set(holds)) == 3
    assert 0.3 <= min(holds) < max(holds) <= 0.8


def test_a_force_swings_at_its_rate_without_sliding() -> None:
    timing, _ = performed("swing")
    keys = timing.motion.keys
    legs = [
        (before, after)
        for phase in timing.motion.phases
        if phase.kind == "hold"
        for before, after in pairwise(keys)
        if before.time == phase.start and after.time == phase.stop
    ]
    assert len(legs) >= 6
    for before, after in legs[1:]:
        # The first leg of a touch begins where the built string answered the press.
        assert 2.7 <= abs(after.force - before.force) / (after.time - before.time) <= 11.0
        assert abs(after.force - before.force) > 0.2
    for phase in [phase for phase in timing.motion.phases if phase.kind == "settle"]:
        time = performed("swing")[1].label_time
        after = (time > phase.stop + 0.02) & (time < phase.stop + 0.8)
        touched, slipped, forces = (
            performed("swing")[1].labels[label][after] for label in ("contact", "slip", "force")
        )
        assert touched.min() == 1.0
        assert slipped.mean() < 0.02
        assert np.ptp(forces) > 0.2
        expected = np.interp(time[after], [key.time for key in keys], [key.force for key in keys])
        assert np.abs(forces - expected).max() < 0.05


def test_a_force_may_swing_in_the_steps_of_a_controller() -> None:
    timing, sound = performed("steps")
    pairs = [(one, other) for one, other in pairwise(timing.motion.keys) if other.force > 0.1 < one.force]
    rests = [other.time - one.time for one, other in pairs if one.force == other.force]
    steps = [
        (other.time - one.time, abs(other.force - one.force))
        for one, other in pairs
        if one.force != other.force
    ]
    assert len(rests) > 100
    assert 0.001 < np.median(rests) < 0.02
    assert 0.001 < np.median([time for time, _ in steps]) < 0.02
    assert np.median([size for _, size in steps]) < 0.25
    pressed = sound.labels["force"] > 0.3
    assert sound.labels["slip"][pressed].mean() < 0.02


def test_a_force_may_rise_slowly_and_swing_as_a_sine_does() -> None:
    timing, sound = performed("smooth")
    rises = [phase for phase in timing.motion.phases if phase.kind == "press"]
    slow = [phase.stop - phase.start for phase in rises if phase.stop - phase.start > 0.2]
    assert len(slow) == 3
    assert 0.3 <= min(slow) < max(slow) <= 0.6
    legs = [phase for phase in timing.motion.phases if phase.kind == "hold"]
    keys = {key.time: key.force for key in timing.motion.keys}
    changes = np.abs([keys[leg.stop] - keys[leg.start] for leg in legs]).reshape(-1, 8)
    turns = np.sin(np.pi * (np.arange(8) + 0.5) / 8.0)
    shares = changes[1:] / changes[1:].sum(axis=1, keepdims=True)
    np.testing.assert_allclose(shares, np.tile(turns / turns.sum(), (len(shares), 1)), atol=0.06)
    assert sound.labels["slip"][sound.labels["force"] > 0.3].mean() < 0.02


@pytest.mark.parametrize("name", ["creeps", "stops_creeping"])
def test_what_is_held_may_give_way_more_slowly_than_a_slip(name: str) -> None:
    motion = performed(name)[0].motion
    holds = [phase for phase in motion.phases if phase.kind == "hold"]
    long = [phase for phase in holds if phase.stop - phase.start > 0.25]
    assert len(long) >= 3
    for phase in long:
        first, last = motion.path(np.array([phase.start, phase.stop]))[:, 1]
        assert 0.9e-4 < abs(last - first) / (phase.stop - phase.start) < 4.1e-4
    for labels in held(name):
        if labels["slip"].size > 230:
            assert labels["slip"][100:].mean() < 0.05


def test_a_stroke_may_end_in_a_rest() -> None:
    timing, sound = performed("stops")
    slip, time = sound.labels["slip"], sound.label_time
    rests = 0
    for stroke, rest in pairwise(timing.motion.phases):
        if (stroke.kind, rest.kind) == ("slide", "hold"):
            assert 0.3 <= rest.stop - rest.start <= 0.6
            assert slip[(time > stroke.start + 0.1) & (time < stroke.stop - 0.1)].min() == 1.0
            assert slip[(time > rest.start + 0.1) & (time < rest.stop)].max() == 0.0
            rests += 1
    assert rests == 4


def test_a_press_may_have_ten_newtons() -> None:
    timing, _ = performed("strong")
    holds = [phase for phase in timing.motion.phases if phase.kind == "hold"]
    for phase, each in zip(holds, held("strong"), strict=True):
        led = next(key.force for key in timing.motion.keys if key.time == phase.stop)
        assert 6.5 < led <= 10.0
        assert each["force"] == pytest.approx(led, rel=0.02)


@pytest.mark.parametrize("name", ["fast", "rolled"])
def test_fast_strokes_reach_their_speed_and_stay_within_their_places(name: str) -> None:
    speeds = [np.abs(np.gradient(each["position"], 1e-3)) for each in held(name, "slide")]
    along = [float(speed.max()) for speed in speeds if speed.max() > 0.01]
    assert len(along) >= 4
    assert max(along) > 0.18
    _, labels = between(name)
    assert np.nanmin(labels["position"]) >= 0.05 - 1e-4
    assert np.nanmax(labels["position"]) <= 0.15 + 1e-4
    slip = np.concatenate([each["slip"] for each in held(name, "slide")])
    assert slip.mean() > 0.8 if name == "fast" else slip.mean() < 0.05


def test_taps_touch_for_20_to_80_ms() -> None:
    timing, _ = performed("taps")
    time, labels = between("taps")
    touched = lengths(labels["contact"] > 0.0, time)
    whole = touched[touched > 5e-3]  # the string's vibration may interrupt the first and last instant
    assert len(whole) == 6
    assert 0.01 < whole.min() < whole.max() < 0.09
    assert sum(phase.kind == "touch" for phase in timing.motion.phases) == 6
    assert len(timing.taps) == 6  # those that align the streams


def test_a_touch_comes_again_after_its_time_at_the_same_place_or_another() -> None:
    timing, _ = performed("again")
    gaps = [phase.stop - phase.start for phase in timing.motion.phases if phase.kind == "hop"]
    assert len(gaps) == 6
    assert 0.03 <= min(gaps) < max(gaps) <= 0.2
    time, labels = between("again")
    free = lengths(labels["contact"] <= 0.0, time)
    assert sum((free > 0.02) & (free < 0.25)) >= 6
    ends = [
        timing.motion.path(np.array([phase.start, phase.stop]))[:, 0]
        for phase in timing.motion.phases
        if phase.kind == "hop"
    ]
    moved = np.array([abs(first - last) for first, last in ends])
    assert (moved == 0.0).any()
    assert (moved > 1e-3).any()


def test_a_released_string_is_left_alone_for_its_pause() -> None:
    rests = [phase for phase in performed("alone")[0].motion.phases if phase.kind == "rest"]
    assert sum(2.0 <= rest.stop - rest.start <= 3.0 for rest in rests) == 2
    time, labels = between("alone")
    assert max(lengths(labels["contacts"] == 0.0, time)) > 2.0


@pytest.mark.parametrize(("name", "slides"), [("vibrato", True), ("rolling", False)])
def test_a_vibrato_moves_the_place_and_slides_or_rolls(name: str, *, slides: bool) -> None:
    for each in held(name, "sway"):
        place = each["position"] - each["position"].mean()
        assert 0.9e-3 < np.abs(place).max() < 3.2e-3
        crossings = np.sum(np.diff(np.sign(place)) != 0)
        assert 4 <= crossings <= 15  # 3 to 7 Hz in a second
        assert each["slip"].mean() > 0.6 if slides else each["slip"].mean() < 0.1
    _, labels = between(name)
    assert 0.05 - 1e-4 <= np.nanmin(labels["position"]) < np.nanmax(labels["position"]) <= 0.15 + 1e-4


def test_two_at_once_have_their_own_places_and_no_common_one() -> None:
    apart = list[float]()
    for each in held("together"):
        assert (each["contacts"] == 2.0).mean() > 0.99
        assert np.isnan(each["position"]).all()
        first, second = (np.nanmean(each[name]) for name in ("position_1", "position_2"))
        apart.append(float(abs(first - second)))
    assert 4e-3 < min(apart) < max(apart) < 6.2e-2
    assert np.ptp(apart) > 1e-3


def test_a_second_object_comes_later_and_goes_before_or_after() -> None:
    time, labels = between("in_turn")
    one = (labels["contacts"] == 1.0) & np.isfinite(labels["position"])
    two = labels["contacts"] == 2.0
    assert one.sum() > 300
    assert two.sum() > 300
    np.testing.assert_array_equal(labels["contact"], labels["contacts"] > 0.0)
    assert np.isnan(labels["position"][two]).mean() > 0.97
    first, second = np.isfinite(labels["position_1"]), np.isfinite(labels["position_2"])
    np.testing.assert_array_equal(labels["position"][one & first], labels["position_1"][one & first])
    np.testing.assert_array_equal(labels["position"][one & second], labels["position_2"][one & second])
    for phase in performed("in_turn")[0].motion.phases:
        if phase.kind == "press":
            after = (time > phase.start) & (time < phase.start + 0.6)
            came = time[after & second][0] - time[after & first][0]
            assert 0.05 < came < 0.45
    assert np.nanmax(labels["force"]) > 1.2 * np.nanmax(labels["force"][one])


def test_a_driver_dies_and_stays_dead() -> None:
    timing, sound = performed("dies")
    assert timing.death is not None
    time, driver = timing.death
    assert timing.on < time < timing.off
    (fault,) = [event for event in sound.events if event.kind == "fault"]
    assert (fault.time, fault.data) == (time, {"driver": driver})
    whole = performed("held")[1]
    plain = render(replace(of("dies"), group=replace(of("dies").group, driver_dies=None)))
    frame = round(time * sound.sample_rate)
    np.testing.assert_array_equal(sound.microphones[:, :frame], plain.microphones[:, :frame])
    assert not np.array_equal(sound.microphones[:, frame:], plain.microphones[:, frame:])
    assert [event for event in whole.events if event.kind == "fault"] == []


def test_drivers_come_on_while_the_string_is_touched() -> None:
    timing, sound = performed("on_touched")
    at = np.searchsorted(sound.label_time, timing.on + 0.02)
    assert sound.labels["contact"][at - 200 : at + 200].mean() > 0.3
    contact = next(p.start for p in timing.motion.phases if p.kind == "press")
    assert 0.0 <= timing.on - contact <= 0.2
    later = performed("held")[0]
    assert next(p.start for p in later.motion.phases if p.kind == "press") > later.on + 1.0


@pytest.mark.parametrize("name", ["speech", "songs"])
def test_speech_and_songs_are_the_sessions_own_and_last_throughout(name: str) -> None:
    timing, sound = performed(name)
    one = of(name)
    silent = render(replace(one, group=replace(one.group, music="")))
    added = (sound.microphones - silent.microphones).astype(float)
    on, off = (round(time * sound.sample_rate) for time in (timing.on, timing.off))
    np.testing.assert_array_equal(added[:, :on], 0.0)
    parts = np.array_split(added[:, on + 4410 : off - 4410], 4, axis=1)
    assert all(np.sqrt(np.mean(part**2)) > 1e-3 for part in parts)
    other = render(session(f"{name}_000", quiet(groups=STORIES), seed=1))
    assert not np.array_equal(other.microphones[:, on : on + 44100], sound.microphones[:, on : on + 44100])


def test_strings_are_tuned_anywhere_in_their_range_and_say_so() -> None:
    group = replace(HELD, name="detuned", sessions=12, grid=(12, 1), detuned=(-0.25, 0.25), builds=(1,))
    plan = quiet(groups=(group,), world="plausible")
    plain = quiet(groups=(replace(group, detuned=None),), world="plausible")
    changes = list[float]()
    for i in range(12):
        detuned, tuned = (session(f"detuned_{i:03d}", each) for each in (plan, plain))
        f, g = (
            open_frequency(replace(one.string, tension=one.string.tension + one.drift))
            for one in (detuned.sensor(), tuned.sensor())
        )
        changes.append(f / g - 1.0)
        assert changes[-1] == pytest.approx(float(describe(detuned).more["tuning"]), abs=1e-9)
        assert describe(detuned).string == describe(tuned).string  # what the design says
    assert -0.25 <= min(changes) < -0.1 < 0.1 < max(changes) <= 0.25


@pytest.mark.parametrize("name", ["in_turn", "dies", "on_touched"])
def test_a_story_is_a_session_that_aligns_and_has_its_labels(name: str, tmp_path: Path) -> None:
    one = of(name, delays=LATE)
    recorded = read_session(make(one, tmp_path).path)
    assert align(recorded).flags == ()
    timing, sound = performed(name)
    for label in ("contact", "contacts"):
        np.testing.assert_array_equal(recorded.labels.columns[label], sound.labels[label])
    late = delays(one)["wrench"]
    faults = [(event.time - late, event.data) for event in recorded.events if event.kind == "fault"]
    deaths = [] if timing.death is None else [(pytest.approx(timing.death[0]), {"driver": timing.death[1]})]
    assert faults == deaths


@pytest.mark.parametrize(
    "options",
    [
        {"protocol": "slide", "swing": (1.0, 2.0)},
        {"approach": "hand", "vibrato": (1e-3, 2e-3)},
        {"dwell": (0.1, 0.2)},
        {"steps": (0.01, 0.02)},
        {"smooth": True},
        {"swing": (1.0, 2.0), "steps": (0.01, 0.02), "smooth": True},
        {"swing": (1.0, 2.0), "creep": (1e-4, 2e-4)},
        {"protocol": "slide", "creep": (1e-4, 2e-4)},
        {"approach": "hand", "rise": (0.1, 0.2)},
        {"second": 0.02, "in_turn": (0.1, 0.2), "hold": 1.0, "pause": 1.0},
        {"second": (0.01, 0.02), "in_turn": (0.1, 0.6), "hold": 1.0, "pause": 2.0},
        {"second": (0.01, 0.02), "in_turn": (0.1, 0.4), "hold": 1.0},
        {"second": (0.01, 0.02), "again": (0.1, 0.2)},
        {"hold": (2.0, 1.0)},
        {"detuned": (-0.5, 0.0)},
    ],
)
def test_stories_that_cannot_be(options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        Group(name="a", **options)  # pyright: ignore[reportArgumentType]
