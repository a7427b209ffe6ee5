import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.errors import DeviceError, InputError, MonochordError, did_you_mean


@given(st.text(), st.text(), st.text())
def test_an_input_error_is_one_line(given_: str, expected: str, remedy: str) -> None:
    assert len(str(InputError(given_, expected, remedy)).splitlines()) <= 1


def test_the_line_says_what_was_given_what_was_expected_and_what_to_do() -> None:
    parts = ("length 0 m", "more than 0 m", "give the scale length")
    error = InputError(*parts)
    assert str(error) == "length 0 m: expected more than 0 m; give the scale length"
    assert (error.given, error.expected, error.remedy) == parts
    assert str(InputError(given=parts[0], expected=parts[1])) == "length 0 m: expected more than 0 m"


def test_the_old_name_of_what_was_expected_still_reads() -> None:
    assert InputError("force -1 N", "0 N or more").allowed == "0 N or more"


@pytest.mark.parametrize(("kind", "builtin"), [(InputError, ValueError), (DeviceError, RuntimeError)])
def test_ours_can_be_caught_as_ours_or_as_the_builtin(kind: type, builtin: type) -> None:
    assert issubclass(kind, MonochordError)
    assert issubclass(kind, builtin)


def test_an_input_error_crosses_to_another_process() -> None:
    error = InputError("force -1 N", "0 N or more", "press")
    copy = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert (type(copy), str(copy), vars(copy)) == (InputError, str(error), vars(error))


words = st.text("abcdefghij_", min_size=3, max_size=10)


@given(words, st.lists(words, min_size=1))
def test_a_suggestion_is_always_one_of_the_choices(word: str, choices: list[str]) -> None:
    suggestion = did_you_mean(word, choices)
    assert not suggestion or any(f"'{choice}'" in suggestion for choice in choices)


@given(words, st.lists(words))
def test_the_word_itself_is_the_best_suggestion(word: str, others: list[str]) -> None:
    assert f"'{word}'" in did_you_mean(word, [*others, word])


def test_nothing_is_suggested_for_what_resembles_nothing() -> None:
    assert did_you_mean("qqqq", ["source", "sink"]) == ""
