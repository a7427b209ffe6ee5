"""A server on loopback that weights can be fetched from, by TLS, with a certificate of its own."""

import shutil
import ssl
import subprocess
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

Serve = Callable[..., str]


@pytest.fixture(scope="session")
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
