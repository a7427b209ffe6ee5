import errno
import threading
from pathlib import Path

import pytest

from monochord.capture.recording.disk import free_bytes, refuse_place, space, written_through
from monochord.core.errors import InputError


def test_the_time_left_follows_from_the_rate_so_far(tmp_path: Path) -> None:
    free = free_bytes(tmp_path)
    left = space(tmp_path, size=1e6, elapsed=2.0, reserve=0.25 * free)
    assert left.left == pytest.approx(0.75 * free / 5e5, rel=0.05)
    assert space(tmp_path, size=1e6, elapsed=2.0, reserve=2.0 * free).left == 0.0
    assert space(tmp_path, size=1e3, elapsed=0.3, reserve=0.0).left == float("inf"), "too soon to tell"


def test_places_that_will_not_do_are_refused(tmp_path: Path) -> None:
    refuse_place(tmp_path / "new.mcap", 0.0)
    (tmp_path / "old.mcap").write_bytes(b"precious")
    for path, min_free in (
        (tmp_path / "old.mcap", 0.0), (tmp_path / "absent" / "new.mcap", 0.0), (tmp_path / "new.mcap", 1e18),
    ):  # fmt: skip
        with pytest.raises(InputError):
            refuse_place(path, min_free)
    assert (tmp_path / "old.mcap").read_bytes() == b"precious"


def test_syncing_goes_on_beside_and_stops_at_the_first_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monochord.capture.recording.disk.SYNC_INTERVAL", 0.01)
    calls, thrice = list[str](), threading.Event()

    def sync() -> None:
        calls.append(threading.current_thread().name)
        if len(calls) == 3:
            thrice.set()
            raise OSError(errno.EIO, "broken")

    with written_through(sync) as errors:
        assert thrice.wait(5.0)
    assert calls == ["record sync"] * 3
    assert [error.errno for error in errors] == [errno.EIO]


def test_a_sync_that_hangs_delays_only_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monochord.capture.recording.disk.SYNC_INTERVAL", 0.01)
    entered, let_go = threading.Event(), threading.Event()

    def sync() -> None:
        entered.set()
        assert let_go.wait(10.0)

    with written_through(sync):
        assert entered.wait(5.0)
        let_go.set()
    assert not [t for t in threading.enumerate() if t.name == "record sync"]
