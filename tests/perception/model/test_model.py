"""The model on streams: the same bits however it is fed, and one clear line where it cannot serve."""

import dataclasses
from collections.abc import Callable, Iterable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Estimates, Signal, Window
from monochord.perception.model import Model
from monochord.perception.model.context import Memory
from monochord.physics.strings import load_string

Sound = Callable[..., Window]


def words(told: Iterable[Estimates]) -> list[str]:
    """Return estimates as text that tells every bit of them: a number that is none equals itself there."""
    return [str(dict(each)) for each in told]


def test_equal_streams_give_equal_bits(drawn: Model, signal: Signal, sound: Sound) -> None:
    first, second = drawn.open(signal), drawn.open(signal)
    told = [first.predict(sound(k)) for k in range(30)]
    assert any(each["contact"].value < 0.1 for each in told)
    assert words(second.predict(sound(k)) for k in range(30)) == words(told)


def test_state_passed_is_state_kept(drawn: Model, signal: Signal, sound: Sound) -> None:
    prepared, listening, memory = drawn.prepare(signal), drawn.open(signal), Memory()
    for k in range(12):
        memory, told = prepared.perceive(memory, sound(k))
        assert words([listening.predict(sound(k))]) == words([told])


def test_what_was_heard_before_matters(drawn: Model, signal: Signal, sound: Sound) -> None:
    prepared, window = drawn.prepare(signal), sound(40)
    quiet = Memory(middle=np.zeros(10, np.float32), rows=(np.zeros(10, np.float32),))
    alone, after = (dict(prepared.answers(memory, window)[1]) for memory in (Memory(), quiet))
    assert alone["contact"] == after["contact"]
    assert alone["force"] != after["force"]


def test_a_window_that_does_not_follow_begins_another_stream(
    drawn: Model, signal: Signal, sound: Sound
) -> None:
    listening = drawn.open(signal)
    told = [listening.predict(sound(k)) for k in range(20)]
    assert words(listening.predict(sound(k)) for k in range(20)) == words(told)


def test_a_gap_or_silence_is_an_abstention_and_forgets_nothing(
    drawn: Model, signal: Signal, sound: Sound
) -> None:
    prepared, memory = drawn.prepare(signal), Memory()
    for k in range(5):
        memory, _ = prepared.perceive(memory, sound(k))
    silent = dataclasses.replace(sound(5), samples=np.zeros((2, 800), np.float32))
    broken = dataclasses.replace(sound(5), samples=np.full((2, 800), np.nan, np.float32))
    told = dataclasses.replace(drawn.definition, quietest=1e-3)
    prepared = dataclasses.replace(prepared, definition=told)
    faint = dataclasses.replace(sound(5), samples=5e-3 * sound(5).samples)
    for window, why in (
        (faint, "silence"),
        (sound(5, has_gap=True), "gap"),
        (silent, "silence"),
        (broken, "samples that are not numbers"),
    ):
        after, told = prepared.perceive(memory, window)
        assert {each.why_not for each in told.values()} == {why}
        assert after is memory


@pytest.mark.parametrize(
    ("other", "line"),
    [
        (Signal(sample_rate=44100, channels=2), "sound at 44100 Hz for a model: allowed is 8000 Hz"),
        (Signal(sample_rate=8000, channels=1), r"sound of 1 channel\(s\) for a model: allowed is 2"),
    ],
)
def test_another_signal_is_refused_in_a_line(drawn: Model, other: Signal, line: str) -> None:
    with pytest.raises(InputError, match=line):
        drawn.open(other)


def test_another_string_is_refused(drawn: Model, signal: Signal) -> None:
    own = load_string("prototype").string
    known = dataclasses.replace(drawn, definition=dataclasses.replace(drawn.definition, string=own))
    known.open(dataclasses.replace(signal, string=dataclasses.replace(own, tension=1.01 * own.tension)))
    with pytest.raises(InputError, match=r"a string of 0.65 m for a model: allowed is 0.2 m"):
        known.open(dataclasses.replace(signal, string=load_string("appendix").string))


def test_windows_of_another_length_are_refused(drawn: Model, signal: Signal, sound: Sound) -> None:
    short = dataclasses.replace(sound(0), samples=sound(0).samples[:, :700])
    with pytest.raises(InputError, match=r"700 frames for a model: allowed is 800 frames; take --window 0.1"):
        drawn.open(signal).predict(short)


def test_a_feature_that_is_not_what_it_was_is_refused(drawn: Model, signal: Signal) -> None:
    told = drawn.definition
    fewer = dataclasses.replace(told.feature, options={"count": 23})
    line = "feature 'bands' of 48 columns: allowed is the 50 columns that were trained with"
    with pytest.raises(InputError, match=line):
        dataclasses.replace(drawn, definition=dataclasses.replace(told, feature=fewer)).open(signal)
