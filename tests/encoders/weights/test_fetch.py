from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest

from monochord.encoders.weights import KnownWeights, load_known
from monochord.encoders.weights.fetch import PIECE, describe, fetch
from monochord.errors import DeviceError, InputError

CONTENT = bytes(range(256)) * (PIECE // 100)
Serve = Callable[..., str]


def known(url: str, **more: str) -> KnownWeights:
    return replace(load_known("yamnet"), url=url, **{"sha256": sha256(CONTENT).hexdigest(), **more})


def test_what_is_fetched_is_whole_and_its_sum_is_kept(tmp_path: Path, serve: Serve) -> None:
    path, seen = tmp_path / "new" / "file", list[tuple[int, int]]()
    own = fetch(known(serve(CONTENT)), path, lambda done, due: seen.append((done, due)))
    assert path.read_bytes() == CONTENT
    assert own == sha256(CONTENT).hexdigest()
    assert (tmp_path / "new" / "file.sha256").read_text(encoding="ascii") == f"{own}\n"
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert len(seen) >= 3


def refused(tmp_path: Path, weights: KnownWeights, kind: type[Exception], match: str) -> None:
    with pytest.raises(kind, match=match) as caught:
        fetch(weights, tmp_path / "file", lambda *_: None)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir()), "something was left behind"


def test_another_file_is_refused(tmp_path: Path, serve: Serve) -> None:
    refused(tmp_path, known(serve(b"<html>sign in</html>")), InputError, "with SHA-256 .* allowed is")


def test_what_does_not_read_is_refused(tmp_path: Path, serve: Serve) -> None:
    weights = known(serve(b"<html>sign in</html>"), sha256="", reader="monochord.encoders.ast.reading")
    refused(tmp_path, weights, InputError, r"file\.part")


def test_a_server_that_has_not_got_it_is_told_of(tmp_path: Path, serve: Serve) -> None:
    weights = known(serve(b"", status=404))
    refused(tmp_path, weights, DeviceError, "answers 404 Not Found; fetch yamnet.* MONOCHORD_YAMNET")


def test_a_server_that_breaks_off_is_told_of(tmp_path: Path, serve: Serve) -> None:
    weights = known(serve(CONTENT, promised=len(CONTENT) + 7))
    refused(tmp_path, weights, DeviceError, "broke off 7 bytes before its end|no answer")


def test_no_server_is_told_of(tmp_path: Path) -> None:
    refused(tmp_path, known("http://127.0.0.1:9/weights"), DeviceError, "no answer .*refused")


def test_a_folder_that_cannot_be_made_is_told_of(tmp_path: Path, serve: Serve) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="--folder"):
        fetch(known(serve(CONTENT)), tmp_path / "file" / "below", lambda *_: None)


def test_where_there_is_no_reader_the_title_tells_what_they_hold(tmp_path: Path) -> None:
    assert describe(load_known("yamnet"), tmp_path).startswith("YAMNet")
