"""Finding the real recordings, with and without them."""

from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.evaluation import realstrings

HEADER = "file,string,kind,x_over_L,f0_measured_hz\n"


@pytest.fixture
def recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "lute").mkdir()
    soundfile.write(tmp_path / "lute" / "b.wav", np.zeros((100, 2)), 22050)
    (tmp_path / "manifest.csv").write_text(
        HEADER + "lute/b.wav,G,plucked,0.25,146.7\nlute/a.wav,,slide,,\nlute/c.wav,G,plucked,,110.0\n",
        encoding="utf-8",
    )
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    return tmp_path


def test_none_where_the_folder_has_no_manifest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MONOCHORD_REALSTRINGS", str(tmp_path))
    assert realstrings.folder() is None
    assert realstrings.takes() == []


@pytest.mark.usefixtures("recordings")
def test_takes_are_filtered_and_in_order() -> None:
    assert [take.path.stem for take in realstrings.takes()] == ["a", "b", "c"]
    assert [take.path.stem for take in realstrings.takes(kind="plucked")] == ["b", "c"]
    (take,) = realstrings.takes(kind="plucked", labelled=True)
    assert take.position == pytest.approx(0.1625)
    assert take.frequency == 146.7
    assert take.instrument == "lute"


@pytest.mark.usefixtures("recordings")
def test_a_take_reads_channel_first() -> None:
    samples, rate = realstrings.takes(labelled=True)[0].read()
    assert samples.shape == (2, 100)
    assert samples.dtype == np.float32
    assert rate == 22050


def test_onset_is_the_first_loud_frame() -> None:
    samples = np.zeros((2, 50), np.float32)
    samples[0, 20:] = 0.05
    samples[0, 30] = -0.8
    assert realstrings.onset(samples) == 30
