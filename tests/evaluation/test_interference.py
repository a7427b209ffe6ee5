"""Interference is mixed in at the ratio that was asked for."""

from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation.realstrings import Interferer, recorded_interference
from monochord.evaluation.realstrings import Protocol


@pytest.mark.parametrize("per", ["window", "take"])
def test_the_ratio_is_what_was_asked_for(per: str) -> None:
    rng = np.random.default_rng(0)
    decay = np.exp(-3.0 * np.arange(66150) / 44100)
    take = (decay * rng.standard_normal(66150)).astype(np.float32)[np.newaxis]
    sound = rng.standard_normal(88200).astype(np.float32)
    interferer = Interferer(sound=sound, ratio=10.0, per="window" if per == "window" else "take")
    added = interferer.mixer(0.3, Protocol())(take) - take
    for start in (6615, 30870, 55125) if per == "window" else (0,):
        stop = start + 4410 if per == "window" else 66150
        ratio = np.mean(take[:, start:stop] ** 2) / np.mean(added[:, start:stop] ** 2)
        assert 10.0 * np.log10(ratio) == pytest.approx(10.0, abs=0.7)


def test_a_short_recording_goes_round() -> None:
    take = np.ones((2, 1000), np.float32)
    mixed = Interferer(sound=np.ones(300, np.float32), ratio=0.0, per="take").mixer(0.5, Protocol())(take)
    assert mixed.shape == (2, 1000)
    assert np.all(mixed == 2.0)


def test_without_recordings_it_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    with pytest.raises(InputError, match="MONOCHORD_REALSTRINGS"):
        recorded_interference()
