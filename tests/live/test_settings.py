import math
from pathlib import Path

import pytest

from monochord.core.config import dump_toml, load_toml
from monochord.core.errors import InputError
from monochord.live import LiveRun, WindowSettings

TREE = {
    "source": {"name": "wav", "path": "take.wav"},
    "estimator": {"name": "closed-form", "length": 0.65, "open_frequency": 110.0},
    "window": {"hop": 0.02},
    "sinks": {"jsonl": {"path": "out.jsonl"}, "terminal": {"plain": True}},
}


@pytest.mark.parametrize(
    ("rate", "length", "hop", "frames"),
    [(44100, 0.1, 0.01, (4410, 441)), (48000, 0.05, 0.01, (2400, 480)), (16000, 0.01, 0.001, (160, 16))],
)
def test_window_in_frames(rate: int, length: float, hop: float, frames: tuple[int, int]) -> None:
    assert WindowSettings(length=length, hop=hop).frames(rate) == frames


@pytest.mark.parametrize("span", [-1.0, 0.0009, math.nan, 61.0])
def test_impossible_windows_are_refused(span: float) -> None:
    for name in ("length", "hop"):
        with pytest.raises(InputError, match=name):
            WindowSettings(**{name: span})


def test_a_tree_becomes_plug_ins() -> None:
    session = LiveRun.read(TREE)
    assert type(session.source).__name__ == "Wav"
    assert session.window == WindowSettings(length=0.1, hop=0.02)
    assert [type(sink).__name__ for sink in session.sinks] == ["Jsonl", "Terminal"]
    assert session.seconds == math.inf


def test_the_resolved_tree_is_complete_and_means_the_same(tmp_path: Path) -> None:
    settings = LiveRun.read(TREE)
    saved = tmp_path / "run.toml"
    saved.write_text(dump_toml(settings.resolved()), encoding="utf-8")
    again = LiveRun.read(load_toml(saved))
    assert again == settings
    assert again.resolved() == settings.resolved()
    assert load_toml(saved)["window"] == {"length": 0.1, "hop": 0.02}
    assert load_toml(saved)["source"]["name"] == "wav"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sorce": {}}, "sorce.*source"),
        ({"source": {}}, "source"),
        ({"source": {"name": "wave", "path": "x"}}, "wave.*wav"),
        ({"source": {"name": "wav", "pth": "x"}}, "pth.*path"),
        ({"estimator": {"name": "closed-from"}}, "closed.from.*closed_form"),
        ({"sinks": {"json": {}}}, "json.*jsonl"),
        ({"sinks": {"jsonl": {"pth": "x"}}}, "pth.*path"),
        ({"window": {"size": 0.1}}, "window.size"),
        ({"window": {"hop": "often"}}, "hop"),
        ({"seconds": 0}, "0"),
    ],
)
def test_the_error_names_the_setting(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        LiveRun.read({**TREE, **change})
