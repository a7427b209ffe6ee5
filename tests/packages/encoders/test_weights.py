"""Weights: where they are looked for, how they are pinned, and their download from a server by TLS."""

import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from monochord.core.errors import DeviceError, InputError
from monochord_encoders.weights import (
    KnownWeights,
    checked_sum,
    find_weights,
    load_known,
    weight_names,
)
from monochord_encoders.weights.fetch import CHUNK_BYTES, describe, fetch

CONTENT = bytes(range(256)) * (CHUNK_BYTES // 100)
Serve = Callable[..., str]


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A certificate and its key for 127.0.0.1, in one file."""
    if not shutil.which("openssl"):
        pytest.skip("openssl is not installed (Debian: apt install openssl)")
    file = tmp_path_factory.mktemp("tls") / "server.pem"
    about = ["-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"]
    new = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2"]
    into = ["-keyout", str(file), "-out", str(file.with_name("public.pem"))]
    subprocess.run(["openssl", "req", "-x509", *new, *about, *into], check=True, capture_output=True)
    public = file.with_name("public.pem").read_text(encoding="ascii")
    file.write_text(file.read_text(encoding="ascii") + public, encoding="ascii")
    return file


@pytest.fixture
def serve(certificate: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Serve]:
    """Return the function that serves bytes and returns their address.

    `promised` bytes are announced, nothing where it is -1; `to` is where it redirects; `plain`: no TLS.
    """
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate.with_name("public.pem")))
    running: list[tuple[ThreadingHTTPServer, Thread]] = []

    def start(
        content: bytes, *, status: int = 200, promised: int | None = None, to: str = "", plain: bool = False
    ) -> str:
        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(302 if to else status)
                if promised != -1:
                    self.send_header("Content-Length", str(len(content) if promised is None else promised))
                if to:
                    self.send_header("Location", to)
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002
                """Keep quiet."""

        class Server(ThreadingHTTPServer):
            def handle_error(self, request: object, client_address: object) -> None:
                """Keep quiet of clients that hang up."""

        server = Server(("127.0.0.1", 0), Handler)
        if not plain:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(certificate)
            server.socket = context.wrap_socket(server.socket, server_side=True)
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        running.append((server, thread))
        return f"{'http' if plain else 'https'}://127.0.0.1:{server.server_port}/weights"

    yield start
    for server, thread in running:
        server.shutdown()
        server.server_close()
        thread.join()


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("MONOCHORD_AST", raising=False)
    monkeypatch.setenv("MONOCHORD_WEIGHTS", str(tmp_path / "weights"))
    return tmp_path / "weights"


@pytest.mark.parametrize("name", weight_names())
def test_known_weights_have_address_source_and_licence(name: str) -> None:
    known = load_known(name)
    assert known.url.startswith("https://")
    assert known.url.endswith(known.file)
    assert known.source
    assert known.licence
    assert known.sha256 or known.reader, "neither a checksum nor a reader"


def test_a_mistyped_name_is_answered_with_it() -> None:
    with pytest.raises(InputError, match=r"'sat'.*'ast'"):
        load_known("sat")


def test_the_path_comes_before_the_variable_and_the_folder(
    own_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = load_known("ast")
    with pytest.raises(InputError, match=r"'monochord weights get ast'.*MONOCHORD_AST"):
        find_weights(known)
    usual = own_folder / "ast" / known.file
    usual.parent.mkdir(parents=True)
    usual.touch()
    assert find_weights(known) == usual
    other = tmp_path / "other"
    other.mkdir()
    (other / known.file).touch()
    monkeypatch.setenv("MONOCHORD_AST", str(other))
    assert find_weights(known) == other / known.file
    (tmp_path / "mine.safetensors").touch()
    assert find_weights(known, str(tmp_path / "mine.safetensors")) == tmp_path / "mine.safetensors"
    with pytest.raises(InputError, match="gone"):
        find_weights(known, str(tmp_path / "gone"))


def test_the_default_folder_is_the_users_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MONOCHORD_WEIGHTS")
    monkeypatch.setenv("XDG_DATA_HOME", "/somewhere")
    assert load_known("ast").usual_path == Path("/somewhere/monochord/weights/ast/model.safetensors")


def test_unpinned_weights_are_warned_of_with_the_way_to_pin_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file, known = tmp_path / "my weights", replace(load_known("ast"), sha256="")
    file.write_bytes(b"numbers")
    actual = checked_sum(known, file)
    (line,) = caplog.messages
    assert actual in line
    subprocess.run(line.partition("pin it: ")[2], shell=True, check=True)  # noqa: S602
    checked_sum(known, file)
    assert len(caplog.messages) == 1
    file.write_bytes(b"others")
    with pytest.raises(InputError, match="weights get ast"):
        checked_sum(known, file)


def test_the_checksum_is_compared_with_the_known_and_the_pinned_one(tmp_path: Path) -> None:
    file = tmp_path / "weights"
    file.write_bytes(b"numbers")
    actual = sha256(b"numbers").hexdigest()
    known = replace(load_known("ast"), sha256="")
    assert checked_sum(known, file) == actual
    assert checked_sum(replace(known, sha256=actual), file) == actual
    with pytest.raises(InputError, match=rf"{actual[:12]}.*000000000000"):
        checked_sum(replace(known, sha256=64 * "0"), file)
    (tmp_path / "weights.sha256").write_text(f"{actual}\n", encoding="ascii")
    file.write_bytes(b"other numbers")
    with pytest.raises(InputError, match=rf"{actual[:12]}.*weights get ast"):
        checked_sum(known, file)


def served(url: str, **more: Any) -> KnownWeights:
    known = replace(load_known("ast"), reader="", url=url)
    return replace(known, **{"sha256": sha256(CONTENT).hexdigest(), **more})


def test_a_download_is_complete_and_its_checksum_is_written(tmp_path: Path, serve: Serve) -> None:
    path, seen = tmp_path / "new" / "file", list[tuple[int, int]]()
    actual = fetch(served(serve(CONTENT)), path, lambda done, due: seen.append((done, due)))
    assert path.read_bytes() == CONTENT
    assert actual == sha256(CONTENT).hexdigest()
    assert (tmp_path / "new" / "file.sha256").read_text(encoding="ascii") == f"{actual}\n"
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert len(seen) >= 3


def test_without_a_known_checksum_the_warning_has_the_actual_one(
    tmp_path: Path, serve: Serve, caplog: pytest.LogCaptureFixture
) -> None:
    actual = fetch(served(serve(CONTENT)), tmp_path / "pinned", lambda *_: None)
    assert not caplog.messages
    fetch(served(serve(CONTENT), sha256=""), tmp_path / "file", lambda *_: None)
    (line,) = caplog.messages
    assert f"monochord weights get ast --sha256 {actual}" in line


def refused(tmp_path: Path, weights: KnownWeights, kind: type[Exception], match: str | None = None) -> None:
    with pytest.raises(kind, match=match):
        fetch(weights, tmp_path / "file", lambda *_: None)
    assert not list(tmp_path.iterdir()), "something was left behind"


READER = {"sha256": "", "reader": "monochord_encoders.network"}
SMALL = {"max_bytes": CHUNK_BYTES}


@pytest.mark.parametrize(
    ("answer", "known", "kind"),
    [
        ({"content": b"<html>sign in</html>"}, {}, InputError),
        ({"content": b"<html>sign in</html>"}, READER, InputError),
        ({"content": b"", "status": 404}, {}, DeviceError),
        ({"content": CONTENT, "promised": len(CONTENT) + 7}, {}, DeviceError),
        ({"content": CONTENT}, SMALL, InputError),
        ({"content": CONTENT, "promised": -1}, SMALL, InputError),
        # The library reads no more than the promised bytes, which are not the file.
        ({"content": CONTENT, "promised": 7}, SMALL, InputError),
    ],
    ids=["other file", "unreadable", "404", "breaks off", "too large", "length unknown", "too short"],
)
def test_a_bad_download_is_refused(
    tmp_path: Path, serve: Serve, answer: dict[str, Any], known: dict[str, Any], kind: type[Exception]
) -> None:
    refused(tmp_path, served(serve(**answer), **known), kind)


def test_an_endless_file_is_cut_off(tmp_path: Path) -> None:
    refused(tmp_path, served("file:///dev/zero", **SMALL), InputError, f"{CHUNK_BYTES} bytes")


def test_other_addresses_are_refused(tmp_path: Path, serve: Serve) -> None:
    address = serve(CONTENT, plain=True)
    for scheme in ("http", "ftp", "data", "file://elsewhere"):
        refused(tmp_path, served(address.replace("http", scheme, 1)), InputError)


def test_a_redirection_is_followed_to_https_alone(tmp_path: Path, serve: Serve) -> None:
    fetch(served(serve(b"", to=serve(CONTENT))), tmp_path / "file", lambda *_: None)
    assert (tmp_path / "file").read_bytes() == CONTENT
    for file in tmp_path.iterdir():
        file.unlink()
    (tmp_path.parent / "local").write_bytes(CONTENT)
    for to in (serve(CONTENT, plain=True), (tmp_path.parent / "local").as_uri(), "ftp://127.0.0.1/weights"):
        refused(tmp_path, served(serve(b"", to=to)), DeviceError)


def test_an_untrusted_certificate_is_refused(
    tmp_path: Path, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = serve(CONTENT)
    monkeypatch.delenv("SSL_CERT_FILE")
    refused(tmp_path, served(address), DeviceError, "certificate")


def test_an_interruption_leaves_nothing(tmp_path: Path, serve: Serve) -> None:
    def interrupted(done: int, due: int) -> None:
        if done > CHUNK_BYTES:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch(served(serve(CONTENT)), tmp_path / "file", interrupted)
    assert not list(tmp_path.iterdir())


def test_a_missing_server_is_reported(tmp_path: Path) -> None:
    refused(tmp_path, served("https://127.0.0.1:9/weights"), DeviceError, "127.0.0.1:9")


def test_a_folder_that_cannot_be_made_is_reported(tmp_path: Path, serve: Serve) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="--folder"):
        fetch(served(serve(CONTENT)), tmp_path / "file" / "below", lambda *_: None)


def test_without_a_reader_the_title_describes_them(tmp_path: Path) -> None:
    known = replace(load_known("ast"), reader="")
    assert describe(known, tmp_path).startswith("Audio Spectrogram Transformer")


@pytest.fixture
def stuck(certificate: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., str]]:
    """Return the function that starts a server which sends some bytes, then one now and then, or none."""
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate.with_name("public.pem")))
    listener, ended = socket.create_server(("127.0.0.1", 0)), Event()
    threads: list[Thread] = []

    def start(beginning: bytes | None, every: float | None) -> str:
        def serve() -> None:
            plain, _ = listener.accept()
            with plain, suppress(OSError):
                if beginning is None:  # it accepts, and is silent
                    ended.wait()
                    return
                context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
                context.load_cert_chain(certificate)
                with context.wrap_socket(plain, server_side=True) as client:
                    client.sendall(beginning)
                    while not ended.wait(every):
                        client.sendall(b"a")

        threads.append(Thread(target=serve))
        threads[0].start()
        return f"https://127.0.0.1:{listener.getsockname()[1]}/weights"

    yield start
    ended.set()
    for thread in threads:
        thread.join()
    listener.close()


HEAD = b"HTTP/1.1 200 OK\r\nContent-Length: 3000000\r\n\r\n"


@pytest.mark.parametrize(
    ("beginning", "every"),
    [
        (None, None),
        (b"", None),
        (b"HTTP/1.1 200 OK\r\n", None),
        (b"HTTP/1.1 200 OK\r\nX: ", 0.05),
        (HEAD, None),
        (HEAD + bytes(100_000), None),
        (HEAD + bytes(100_000), 0.05),
    ],
)
def test_a_server_that_is_stuck_is_given_up(
    tmp_path: Path,
    stuck: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    beginning: bytes | None,
    every: float | None,
) -> None:
    monkeypatch.setattr("monochord_encoders.weights.fetch.TIMEOUT", 0.5)
    begin = time.monotonic()
    refused(tmp_path, served(stuck(beginning, every)), DeviceError, "127.0.0.1")
    assert time.monotonic() - begin < 3.0
