"""Helpers do pieces that the one whom they help then finds done."""

import multiprocessing
import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from monochord.perception.training.shared_work import helped

PIECES = 6


def kept_in(folder: Path) -> Callable[[int], str]:
    """Return work that takes a while and keeps who did it in a file for each piece."""

    def work(number: int) -> str:
        file = folder / str(number)
        if not file.exists():
            time.sleep(0.1)
            file.write_text(str(os.getpid()))
        return file.read_text()

    return work


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="one core: allowed are two or more for help")
def test_another_process_does_some_of_the_pieces(tmp_path: Path) -> None:
    work = kept_in(tmp_path)
    with helped(work, PIECES):
        assert multiprocessing.active_children()
        done_by = [work(number) for number in range(PIECES)]
    assert done_by[0] == str(os.getpid())
    assert len(set(done_by)) > 1
    assert not multiprocessing.active_children()


def test_without_pieces_there_is_no_helper(tmp_path: Path) -> None:
    with helped(kept_in(tmp_path), 0):
        assert not multiprocessing.active_children()


def test_a_helper_that_fails_leaves_the_piece_to_the_one_it_helps(tmp_path: Path) -> None:
    own = os.getpid()

    def work(number: int) -> str:
        if os.getpid() != own:
            raise RuntimeError(number)
        return kept_in(tmp_path)(number)

    with helped(work, PIECES):
        assert {work(number) for number in range(PIECES)} == {str(own)}


def test_helpers_end_with_an_error_of_the_one_whom_they_help(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), helped(kept_in(tmp_path), PIECES):
        raise KeyboardInterrupt
    assert not multiprocessing.active_children()
