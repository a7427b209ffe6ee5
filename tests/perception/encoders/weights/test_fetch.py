from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from monochord.core.errors import DeviceError, InputError
from monochord.perception.encoders.weights import KnownWeights, load_known
from monochord.perception.encoders.weights.fetch import PIECE, describe, fetch

CONTENT = bytes(range(256)) * (PIECE // 100)
Serve = Callable[..., str]


def known(url: str, **more: Any) -> KnownWeights:
    return replace(load_known("yamnet"), url=url, **{"sha256": sha256(CONTENT).hexdigest(), **more})


def test_what_is_fetched_is_whole_and_its_sum_is_kept(tmp_path: Path, serve: Serve) -> None:
    path, seen = tmp_path / "new" / "file", list[tuple[int, int]]()
    own = fetch(known(serve(CONTENT)), path, lambda done, due: seen.append((done, due)))
    assert path.read_bytes() == CONTENT
    assert own == sha256(CONTENT).hexdigest()
    assert (tmp_path / "new" / "file.sha256").read_text(encoding="ascii") == f"{own}\n"
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert len(seen) >= 3


def test_a_local_file_is_taken(tmp_path: Path) -> None:
    (tmp_path / "published").write_bytes(CONTENT)
    fetch(known((tmp_path / "published").as_uri()), tmp_path / "file", lambda *_: None)
    assert (tmp_path / "file").read_bytes() == CONTENT


def test_without_a_known_sum_it_is_said_with_the_one_that_came(
    tmp_path: Path, serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    own = fetch(known(serve(CONTENT)), tmp_path / "pinned", lambda *_: None)
    assert not caplog.messages
    fetch(known(serve(CONTENT), sha256=""), tmp_path / "file", lambda *_: None)
    (line,) = caplog.messages
    assert f"not pinned: any file would have been taken; what came has {own}" in line
    assert f"monochord weights get yamnet --sha256 {own}" in line


def refused(tmp_path: Path, weights: KnownWeights, kind: type[Exception], match: str) -> None:
    with pytest.raises(kind, match=match) as caught:
        fetch(weights, tmp_path / "file", lambda *_: None)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir()), "something was left behind"


def test_another_file_is_refused(tmp_path: Path, serve: Serve) -> None:
    refused(tmp_path, known(serve(b"<html>sign in</html>")), InputError, "with SHA-256 .* allowed is")


def test_what_does_not_read_is_refused(tmp_path: Path, serve: Serve) -> None:
    weights = known(
        serve(b"<html>sign in</html>"), sha256="", reader="monochord.perception.encoders.ast.network"
    )
    refused(tmp_path, weights, InputError, r"file\.part")


def test_a_server_that_has_not_got_it_is_told_of(tmp_path: Path, serve: Serve) -> None:
    weights = known(serve(b"", status=404))
    refused(tmp_path, weights, DeviceError, "answers 404 Not Found; fetch yamnet.* MONOCHORD_YAMNET")


def test_a_server_that_breaks_off_is_told_of(tmp_path: Path, serve: Serve) -> None:
    weights = known(serve(CONTENT, promised=len(CONTENT) + 7))
    refused(tmp_path, weights, DeviceError, "broke off 7 bytes before its end|no answer")


@pytest.mark.parametrize("promised", [None, -1, 7])
def test_more_than_they_may_have_is_not_read(tmp_path: Path, serve: Serve, promised: int | None) -> None:
    weights = known(serve(CONTENT, promised=promised), max_bytes=PIECE)
    if promised == 7:  # the library reads no more than was promised, and what it read is not the file
        refused(tmp_path, weights, InputError, "with SHA-256")
    else:
        refused(tmp_path, weights, InputError, f"allowed is {PIECE} bytes")


def test_a_file_without_end_is_cut_off(tmp_path: Path) -> None:
    refused(tmp_path, known("file:///dev/zero", max_bytes=3 * PIECE), InputError, f"{3 * PIECE} bytes")


@pytest.mark.parametrize("scheme", ["http", "ftp", "data", "file://elsewhere"])
def test_other_addresses_are_refused(tmp_path: Path, serve: Serve, scheme: str) -> None:
    address = serve(CONTENT, plain=True).replace("http", scheme, 1)
    refused(tmp_path, known(address), InputError, "allowed is one of https")


def test_a_redirection_is_followed_to_https_alone(tmp_path: Path, serve: Serve) -> None:
    fetch(known(serve(b"", to=serve(CONTENT))), tmp_path / "file", lambda *_: None)
    assert (tmp_path / "file").read_bytes() == CONTENT
    for file in tmp_path.iterdir():
        file.unlink()
    (tmp_path.parent / "local").write_bytes(CONTENT)
    for to in (serve(CONTENT, plain=True), (tmp_path.parent / "local").as_uri(), "ftp://127.0.0.1/weights"):
        refused(tmp_path, known(serve(b"", to=to)), DeviceError, "http|file|ftp")


def test_a_server_that_nobody_vouches_for_is_refused(
    tmp_path: Path, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = serve(CONTENT)
    monkeypatch.delenv("SSL_CERT_FILE")
    refused(tmp_path, known(address), DeviceError, "certificate")


def test_an_interruption_leaves_nothing(tmp_path: Path, serve: Serve) -> None:
    def interrupted(done: int, due: int) -> None:
        if done > PIECE:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch(known(serve(CONTENT)), tmp_path / "file", interrupted)
    assert not list(tmp_path.iterdir())


def test_no_server_is_told_of(tmp_path: Path) -> None:
    refused(tmp_path, known("https://127.0.0.1:9/weights"), DeviceError, "no answer .*refused")


def test_a_folder_that_cannot_be_made_is_told_of(tmp_path: Path, serve: Serve) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="--folder"):
        fetch(known(serve(CONTENT)), tmp_path / "file" / "below", lambda *_: None)


def test_where_there_is_no_reader_the_title_tells_what_they_hold(tmp_path: Path) -> None:
    assert describe(load_known("yamnet"), tmp_path).startswith("YAMNet")
