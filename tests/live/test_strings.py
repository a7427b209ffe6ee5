"""Several strings of one source: each as it is alone, by its name, in every sink."""

import itertools
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source, Stream
from monochord.core.errors import InputError
from monochord.core.types import Audio, Block, Signal
from monochord.live import LiveRun, run
from monochord.live.settings import StringSettings
from monochord.live.sinks.base import Listener, Update
from monochord.perception.estimators.model import ModelEstimator

RATE, SIZE = 44100, 4410
DEMO = ModelEstimator(path=Path("demo"))


TOUCH = {"start": 0.25, "position": 0.07, "force": 1.0}


class Sound(Source, Stream):
    """Samples (channels, n) as a source, which a clock seems to pace where `late` windows are pending."""

    def __init__(self, samples: Audio, late: frozenset[int] = frozenset()) -> None:
        self.samples, self.late, self.given = samples, late, 0

    @contextmanager
    def open(self) -> Generator[Stream]:
        yield self

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=RATE, channels=len(self.samples))

    @property
    def pending(self) -> int:
        return SIZE if self.given in self.late else 0

    def __iter__(self) -> Iterator[Block]:
        for start in range(0, self.samples.shape[1], 441):
            self.given = start // 441
            yield Block(samples=self.samples[:, start : start + 441], start=start)


class Kept(Listener):
    def __init__(self) -> None:
        self.updates: list[Update] = []

    def write(self, update: Update) -> None:
        self.updates.append(update)

    def told(self, string: str = "") -> list[str]:
        """Return all that is said of a string but how long it took, exactly."""
        return [
            repr((replace(m.prediction, latency=0.0), m.tracked, m.decided, m.events, m.notes, m.skipped))
            for m in self.updates
            if m.string == string
        ]


def lived(source: Source, strings: Mapping[str, StringSettings], sensor: str = "", **more: Any) -> Kept:
    kept = Kept()
    run(LiveRun(source=source, estimator=DEMO, sinks=(kept,), strings=strings, sensor=sensor, **more))
    return kept


@pytest.fixture(scope="module")
def three() -> list[Audio]:
    """A touched string; the same with its microphones exchanged, one of which dies; one with lost samples."""
    options = {"speed": 0.0, "world": "plausible", "build": 131, "script": [TOUCH]}
    with SOURCES.build("twin", options).open() as stream:
        blocks = itertools.takewhile(lambda block: block.start < 0.7 * RATE, stream)
        whole = np.concatenate([block.samples for block in blocks], axis=1)
    dying, torn = whole[::-1].copy(), whole.copy()
    dying[1, RATE // 2 :] = 0.0
    torn[:, RATE // 4 : RATE // 4 + 100] = np.nan
    return [whole, dying, torn]


def test_each_of_several_strings_is_estimated_as_it_is_alone(three: list[Audio]) -> None:
    names = ("thumb", "index", "ring")
    late = frozenset({20, 21, 50})
    both = lived(
        Sound(np.concatenate(three), late),
        {name: StringSettings(sensor="prototype") for name in names},
    )
    assert [m.string for m in both.updates[:6]] == [*names, *names]
    for name, samples in zip(names, three, strict=True):
        alone = lived(Sound(samples, late), {}, "prototype")
        assert both.told(name) == alone.told()
        assert len(alone.updates) > 50
        assert alone.updates[-1].skipped == 3
    assert any(m.prediction.estimate("position").valid for m in both.updates if m.string == "thumb")


def test_a_string_has_the_channels_that_are_named(three: list[Audio]) -> None:
    crossed = np.stack([three[0][1], three[1][0], three[0][0]])
    settings = {"left": StringSettings(channels=(3, 1), sensor="prototype")}
    kept, alone = (
        lived(Sound(crossed), settings, seconds=0.3),
        lived(Sound(three[0]), {}, "prototype", seconds=0.3),
    )
    assert kept.told("left") == alone.told()


@pytest.mark.parametrize(
    ("strings", "channels", "given"),
    [
        ({}, 4, "4 channels"),
        ({"a": {}, "b": {}}, 3, "4"),
        ({"a": {}, "b": {"channels": [2]}}, 4, "2"),
        ({"a": {"channels": [1, 2, 3]}}, 4, "1, 2, 3"),
        ({"a": {"channels": [0]}}, 4, "0"),
        ({"a/b": {}}, 4, "'a/b'"),
        ({"a": {"sensor": "prototipe"}}, 4, "prototipe"),
    ],
)
def test_strings_that_a_source_does_not_have_are_refused(
    strings: dict[str, Any], channels: int, given: str
) -> None:
    silence = Sound(np.zeros((channels, RATE), np.float32))
    tree = {"source": {"name": "twin"}, "strings": strings, "sinks": {}}
    with pytest.raises(InputError, match=given):
        lived(silence, LiveRun.read(tree).strings)


def test_a_source_is_asked_for_the_channels_of_all_strings(tmp_path: Path) -> None:
    tree = {"source": {"name": "jack"}, "strings": {"a": {}, "b": {"channels": [7, 8]}}}
    resolved = LiveRun.read(tree).resolved()
    assert resolved["source"]["channels"] == 8
    assert LiveRun.read(resolved).resolved() == resolved
    assert LiveRun.read({**tree, "strings": {"a": {}}}).resolved()["source"]["channels"] == 2
