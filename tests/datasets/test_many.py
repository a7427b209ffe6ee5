"""A dataset of many sessions: cost grows as their number, and a limit of the machine is no damage."""

import resource
import time
from collections.abc import Generator
from pathlib import Path

import numpy as np
import pytest
from tests.datasets.conftest import RATE, made

from monochord.core.errors import DeviceError
from monochord.datasets.audit import audit
from monochord.datasets.build import named_sessions
from monochord.datasets.duplicates import COMPARED, find_duplicates
from monochord.datasets.split import split_dataset
from monochord.datasets.store import Dataset, open_dataset

SESSIONS = 80
SECOND = np.ones((2, RATE), np.float32)


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """As many short sessions as a process of `few_files` may not open at once."""
    rng = np.random.default_rng(0)
    sounds = {f"take{number}": 0.1 * rng.normal(size=SECOND.shape) for number in range(SESSIONS)}
    takes = {name: {"samples": sound.astype(np.float32)} for name, sound in sounds.items()}
    return made(tmp_path_factory.mktemp("many"), takes)


@pytest.fixture
def few_files() -> Generator[None]:
    """A process that may open few files, though more than Python and the test have open."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    opened = len(list(Path("/proc/self/fd").iterdir()))
    resource.setrlimit(resource.RLIMIT_NOFILE, (opened + 64, hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.usefixtures("few_files")
def test_more_sessions_than_files_may_be_open(many: Dataset) -> None:
    dataset = open_dataset(many.path)
    assert all(dataset.window(row).any() for row in range(0, len(dataset), 5))
    dataset.verify()


@pytest.mark.usefixtures("few_files")
def test_a_limit_of_the_machine_is_not_called_damage(many: Dataset) -> None:
    dataset = open_dataset(many.path)
    with pytest.raises(DeviceError, match=r"npy \(Too many open files\): a limit of this machine; .*ulimit"):
        _ = [dataset.window(row) for row in range(len(dataset))]  # which keeps every file open


def test_many_sessions_are_split_and_audited_without_a_leak(many: Dataset) -> None:
    assert audit(many, split_dataset(many)).clean


def test_names_are_counted_once() -> None:
    paths = [Path(f"{number % 100}/take{number}.mcap") for number in range(25_000)]
    began = time.process_time()
    assert len(named_sessions(paths)) == len(paths)
    assert time.process_time() - began < 5.0  # by comparing each name with each: 10 s


def test_a_thousand_copies_are_detected_without_their_half_a_million_pairs() -> None:
    sound = 0.1 * np.random.default_rng(1).normal(size=SECOND.shape).astype(np.float32)
    parts = [1] * 500 + [2] * 500
    copies = find_duplicates(lambda _number: sound, parts)
    assert all(each.first < 500 <= each.second for each in copies)
    assert {each.second - each.first for each in copies} == set(range(1, COMPARED + 1))
    assert {each.lag for each in copies} == {0}
