"""The tables count each judged window once, under its truth and its answer."""

from collections.abc import Callable
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.figures.confusion import Confusion

Write = Callable[..., Path]


def test_counts_are_by_truth_and_answer(write: Write) -> None:
    told = Confusion(results=write()).numbers()
    assert told["contact"] == [[160, 0, 0], [0, 320, 0]]
    assert told["slip"] == [[120, 40, 0], [40, 120, 0]]
    assert told["simulated"] is True


def test_windows_not_told_stand_apart(write: Write) -> None:
    file = write(quiet=("contact",))
    assert Confusion(results=file).numbers()["contact"] == [[0, 0, 160], [0, 0, 320]]


def test_shares_are_of_the_truth(write: Write) -> None:
    page = Confusion(results=write()).draw()
    contact, slip = page.axes[:2]
    assert [text.get_text() for text in slip.texts[:3]] == ["120\n75.0 %", "40\n25.0 %", "0\n0.0 %"]
    assert [label.get_text() for label in contact.get_xticklabels()] == ["untouched", "touched", "not told"]
    assert page.get_suptitle() == "simulated: made up, clean"


def test_a_condition_that_is_not_there_is_refused(write: Write) -> None:
    with pytest.raises(InputError, match="condition 'noise': allowed is clean"):
        Confusion(results=write(noises=False), condition="noise").draw()
