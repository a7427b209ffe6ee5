"""Takes with known truth: which windows are looked at, and what comes of them."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation import realstrings
from monochord.evaluation.realstrings import Protocol, located, open_note, position_errors, recorded_strings

real = pytest.mark.skipif(realstrings.folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")


def test_windows_are_counted_from_the_onset() -> None:
    take = np.zeros((1, 44100), np.float32)
    take[0, 1000:] = 1.0
    seen = Protocol(length=0.1, first=0.15, last=0.6, hop=0.1).windows(take, take, 44100)
    assert [window.start for window in seen] == [1000 + round(s * 44100) for s in (0.15, 0.25, 0.35, 0.45)]
    assert all(window.samples.shape == (1, 4410) for window in seen)


def test_windows_beyond_the_end_are_left_out() -> None:
    take = np.ones((1, 10000), np.float32)
    assert len(Protocol().windows(take, take, 44100)) == 0


@real
def test_an_open_note_is_told_from_its_audio() -> None:
    for take in recorded_strings().open_notes.values():
        ((frequency, position, stiffness),) = open_note(take, Protocol())
        assert position == 0.0
        assert frequency == pytest.approx(take.frequency, rel=2e-3)
        assert 0.0 <= stiffness < 5e-4


@real
def test_errors_are_estimate_minus_truth() -> None:
    strings = recorded_strings()
    take = strings.fretted["green_plucked B3"][-1]
    note = open_note(strings.open_notes["green_plucked B3"], Protocol())
    told = located(take, note, Protocol())
    errors = position_errors(take, told)
    assert errors[0] == pytest.approx(told[0]["position"].value - take.position)


def test_without_recordings_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    recorded_strings.cache_clear()
    with pytest.raises(InputError, match="MONOCHORD_REALSTRINGS"):
        recorded_strings()
    recorded_strings.cache_clear()
