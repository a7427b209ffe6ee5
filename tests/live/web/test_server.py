"""The page's server: what it serves, whom it lets in, and that no client delays anything."""

import http.client
import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
from tests.live.sinks.made import window_update
from tests.live.web.run_server import RunServer
from tests.waiting import wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from monochord.capture.sources.base import Controls, ControlSetting
from monochord.core.errors import DeviceError, InputError
from monochord.core.reasons import Reason
from monochord.core.types import Contact, Estimate, Signal, StringParams
from monochord.live.events import Event
from monochord.live.guides.run_tasks import RunTasks
from monochord.live.health import Note
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Run as SinkRun
from monochord.live.update import Update
from monochord.live.web import messages
from monochord.live.web.run_page import FILES, View
from monochord.page.clients import RATE
from monochord.page.server import MAX_MESSAGE, SHARED, Server
from monochord.perception.watching import Condition
from monochord.physics.sensors import load_sensor, with_sensor
from monochord.sessions import read_session

LENGTH, TOKEN = 0.2, "right"
SIGNAL = Signal(
    sample_rate=44100,
    channels=2,
    string=StringParams(length=LENGTH, linear_density=4e-4, tension=65.0),
)
TONE = np.stack([np.sin(2 * np.pi * 1000.0 * np.arange(4410) / 44100)] * 2).astype(np.float32)


def update(number: int) -> Update:
    place = Estimate(value=1e-5 * number, std=1e-4, unit="m")
    estimates = {"position": place, "force": Estimate.abstain("N", Reason.OUTSIDE_RANGE)}
    return window_update(
        number,
        estimates,
        TONE,
        truth={"contact": 1.0},
        events=(Event(name="contact", on=True, time=0.1, delay=0.02, confidence=0.9),) if number == 5 else (),
        notes=(
            Note(key="settling", level="info", sentence="It settles.", remedy="Wait.", since=number / 100),
            Note(key="hum", level="warning", sentence="It hums.", remedy="Ground it.", since=0.0),
        ),
        decided={"contact": True},
        condition=Condition(open_frequency=Estimate(value=322.4, std=0.5, unit="Hz"), deviation=0.03),
    )


OUTSIDE = (
    "/static/../server.py", "/static/%2e%2e/server.py", "/static/", "/etc/passwd", "//etc/passwd",
    "/static/..%2fserver.py", "/static/uplot/../../server.py",
)  # fmt: skip


class Keep(Controls):
    """Controls that keep what was asked."""

    def __init__(self) -> None:
        self.asked: list[Any] = []

    @property
    def positions(self) -> tuple[float, float]:
        return 0.0, LENGTH

    @property
    def forces(self) -> tuple[float, float]:
        return 0.0, 2.0

    @property
    def settings(self) -> tuple[ControlSetting, ...]:
        return (ControlSetting(name="noise", choices=("none", "10 dB"), value="none"),)

    def touch(self, contact: Contact) -> None:
        self.asked.append((contact.position, contact.force))

    def release(self) -> None:
        self.asked.append("release")

    def change(self, name: str, value: str) -> None:
        if name != "noise":
            raise InputError(f"setting '{name}'", "noise")
        self.asked.append((name, value))


class Run:
    """A run that hands over a hundred updates a second, from a thread of its own."""

    def __init__(self, writer: View, string: str = "") -> None:
        self._writer, self._string, self._ended = writer, string, threading.Event()
        self.longest = 0.0
        self.written = 0
        self._thread = threading.Thread(target=self._write)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _write(self) -> None:
        while not self._ended.wait(0.01):
            begin = time.perf_counter()
            self._writer.write(replace(update(self.written), string=self._string))
            self.longest = max(self.longest, time.perf_counter() - begin)
            self.written += 1


@contextmanager
def running(
    controls: Controls | None = None, token: str = "", folder: Path = Path()
) -> Generator[tuple[Server, Run]]:
    tasks = RunTasks(SIGNAL, LENGTH, folder, "")
    with (
        RunServer(port=free(), token=token) as server,
        server.show(SIGNAL, LENGTH, controls, tasks=tasks) as writer,
        Run(writer) as run,
    ):
        yield server, run


def free() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def get(server: Server, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=30)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    answer.body = answer.read()  # pyright: ignore[reportAttributeAccessIssue]
    connection.close()
    return answer


def live(server: Server, **options: Any) -> ClientConnection:
    return connect(f"ws://127.0.0.1:{server.port}/live", open_timeout=30, close_timeout=0.5, **options)


def messages_of(client: ClientConnection, kind: str, count: int = 1) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    while len(found) < count:
        content = client.recv(30)
        if isinstance(content, str) and (message := json.loads(content))["type"] == kind:
            found.append(message)
    return found


def test_the_page_is_there_before_there_is_sound() -> None:
    with RunServer(port=free()) as server:
        assert get(server, "/").status == 200
        with live(server) as client:
            assert json.loads(client.recv(30))["type"] == "waiting"
            with server.show(SIGNAL, LENGTH, None) as writer:
                writer.write(update(0))
                assert messages_of(client, "hello")[0]["length"] == LENGTH
                writer.write(update(1))
                messages_of(client, "moment")


def test_every_file_of_the_page_is_served_and_nothing_else() -> None:
    with RunServer(port=free()) as server:
        for path in ("/", *(f"/static/{name}" for name in (*SHARED, *FILES))):
            answer = get(server, path)
            assert (answer.status, answer.getheader("x-content-type-options")) == (200, "nosniff"), path
            assert "default-src 'none'" in (answer.getheader("content-security-policy") or "")
        page = get(server, "/").body.decode()  # pyright: ignore[reportAttributeAccessIssue]
        assert "http" not in page.replace("http-equiv", "")  # it needs nothing from anywhere
        for path in OUTSIDE:
            assert get(server, path).status == 404, path


def test_another_name_or_another_page_is_refused() -> None:
    with RunServer(port=free()) as server:
        assert get(server, "/", Host="evil.example").status == 421
        assert get(server, "/", Host=f"localhost:{server.port + 1}").status == 200  # the end of a tunnel
        assert get(server, "/", Origin="http://evil.example").status == 403
        for headers in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Host": "evil.example"}):
            with pytest.raises(InvalidStatus), live(server, additional_headers=headers):
                pass
        with live(server, additional_headers={"Origin": f"http://127.0.0.1:{server.port}"}):
            pass


def test_where_a_token_is_needed_none_or_a_wrong_one_is_refused() -> None:
    with running(token=TOKEN) as (server, _):
        assert server.address.endswith(f"/?token={TOKEN}")
        assert [
            get(server, path).status for path in ("/", "/?token=wrong", "/?token=", "/static/page.js")
        ] == [401] * 4
        with pytest.raises(InvalidStatus), live(server):
            pass
        answer = get(server, f"/?token={TOKEN}")
        assert (answer.status, answer.getheader("location")) == (303, "./")
        cookie = answer.getheader("set-cookie") or ""
        assert "HttpOnly" in cookie
        assert "SameSite=Strict" in cookie
        mine = {"Cookie": cookie.partition(";")[0]}
        assert get(server, "/", **mine).status == 200
        with live(server, additional_headers=mine) as client:
            messages_of(client, "moment")
        assert get(server, "/", Cookie='monochord="\x01;;=').status == 401


def test_beyond_this_machine_there_is_always_a_token(capsys: pytest.CaptureFixture[str]) -> None:
    for options in ({"at": "0.0.0.0:0"}, {"allow_host": ["lab"]}):
        with SINKS.build("web", options).ahead():
            assert len(capsys.readouterr().out.strip().partition("?token=")[2]) > 16
    with SINKS.build("web", {"stderr": True}).ahead():
        told = capsys.readouterr()
        assert told.out == ""
        assert told.err.startswith("page: http://127.0.0.1:")
        assert "token" not in told.err


def test_an_address_that_is_taken_or_none_is_refused() -> None:
    with RunServer(port=free()) as server, pytest.raises(DeviceError, match=str(server.port)):
        RunServer(port=server.port)
    with (
        pytest.raises(InputError, match="'seven'"),
        SINKS.build("web", {"at": "seven"}).open(SinkRun(signal=SIGNAL)),
    ):
        pass


def test_a_page_is_told_what_is_estimated_and_what_happened() -> None:
    with running() as (server, _), live(server) as client:
        hello = messages_of(client, "hello")[0]
        assert (hello["length"], hello["channels"], hello["controls"]) == (LENGTH, 2, None)
        assert hello["speed"] == pytest.approx((65.0 / 4e-4) ** 0.5)
        assert (hello["range"], hello["drivers"]) == (None, [])  # of a sensor that is not known
        told = messages_of(client, "moment", 20)[-1]
        assert told["window"]["position"]["unit"] == "m"
        assert told["truth"] == {"contact": 1.0}
        assert [note["key"] for note in told["notes"]] == ["hum"]  # without a brief info
        assert told["notes"][0]["sentence"]
        pitch = {"frequency": 322.4, "std": 0.5, "deviation": 0.03, "follows": True}
        assert told["pitch"] == pitch
        assert told["levels"][0] == pytest.approx([-3.0, 0.0], abs=0.1)
        assert told["clips"][0]
        assert (told["window"]["position"]["key"], told["window"]["force"]["key"]) == (
            "none",
            "outside_range",
        )
        assert [event["name"] for event in told["events"]] == ["contact"]
    with running() as (server, _):
        time.sleep(0.5)
        with live(server) as client:  # opened again, it knows what was before
            history = messages_of(client, "hello")[0]["history"]
        assert len(history) > 3
        assert history[0][0] < history[-1][0]
        time_, _, _, *quantities = history[-1][:7]
        assert quantities == [pytest.approx(1e-3 * time_, abs=1e-5), 1e-4, None, None]  # position, force
        assert history[0][-6:] == [1.0, None, None, None, 1.0, None]  # truth, and what is decided


def test_a_page_learns_the_sensing_range_and_the_drivers_of_a_known_sensor() -> None:
    signal = Signal(sample_rate=44100, channels=2)
    for name, drivers in (
        ("prototype", ((0.015, 0.028), (0.178, 0.189))),
        ("prototype_one_driver", ((0.015, 0.028),)),
    ):
        told = messages.hello(with_sensor(signal, load_sensor(name)), 0.2, simulated=True, controls=None)
        assert (told["range"], told["drivers"]) == ((0.05, 0.15), drivers)


def test_a_tone_stands_in_the_spectrum_where_it_is() -> None:
    content = messages.spectrum(TONE, 44100)
    top = struct.unpack("<f", content[4:8])[0]
    rows = np.frombuffer(content[8:], np.uint8).reshape(content[0], -1)
    assert rows.shape == (2, messages.BARS)
    for row in rows:
        assert (row.argmax() + 0.5) / row.size * top == pytest.approx(1000.0, abs=top / row.size)
        assert row.max() >= 253  # full scale is 0 dB
    for strange in (np.full((2, 441), np.nan), np.full((1, 441), np.inf), np.zeros((9, 5))):
        messages.spectrum(strange.astype(np.float32), 16000)


def test_it_sends_no_more_than_its_pace_and_the_newest() -> None:
    with running() as (server, run), live(server) as client:
        messages_of(client, "moment")
        begin = time.monotonic()
        told = messages_of(client, "moment", 45)
        assert 45 / (time.monotonic() - begin) < 1.2 * RATE
        assert run.written - 100 * told[-1]["time"] < 500


def test_what_a_page_asks_is_done_and_what_is_nonsense_is_counted() -> None:
    keep = Keep()
    nonsense: list[str | bytes] = [
        "", "{", "null", "[]", "7", '{"do":"touch"}', '{"do":"dance"}', "[" * 900, b"\xff\xfe", '"\\ud800"',
        '{"do":"touch","position":"0.1","force":1}', '{"do":"touch","position":1e999,"force":1}',
        '{"do":"change","name":"colour","value":"red"}', '{"do":"touch","position":0.1,"force":1,"more":1}',
        '{"do":"touch","position":NaN,"force":1}', '{"do":7}', '{"do":"record","on":false}',
        '{"do":"record","on":true,"path":"/tmp/mine.mcap"}', '{"do":"record","on":"../mine.mcap"}',
        '{"do":"calibrate","touches":6}', '{"do":"calibrate","touches":1e9}', '{"do":"tune","out":"/etc/x"}',
        '{"do":"hold","position":0.1,"force":1}', '{"do":"hold","position":null,"force":1,"unit":"kg"}',
        '{"do":"label","touches":0}', '{"do":"step","act":"finish"}', '{"do":"step","act":"undo"}',
    ]  # fmt: skip
    with running(keep) as (server, _), live(server) as client:
        for each in nonsense:
            client.send(each)
        client.send('{"do":"touch","position":0.06,"force":1.5}')
        client.send('{"do":"change","name":"noise","value":"10 dB"}')
        client.send('{"do":"release"}')
        wait_for(lambda: "release" in keep.asked)
        assert keep.asked == [(0.06, 1.5), ("noise", "10 dB"), "release"]
        assert server.counts["ignored"] == len(nonsense)
        client.send("x" * (MAX_MESSAGE + 1))
        with pytest.raises(ConnectionClosed):
            messages_of(client, "never")
        with live(server) as another:
            messages_of(another, "moment")
    with running() as (server, _), live(server) as client:  # nothing can be touched here
        client.send('{"do":"release"}')
        wait_for(lambda: server.counts["ignored"] == 1)


def told(client: ClientConnection, condition: Callable[[Any], Any]) -> dict[str, Any]:
    """What the page is told of its tasks once something is so."""
    deadline = time.monotonic() + 60
    while not condition(tasks := messages_of(client, "moment")[0]["tasks"]):
        assert time.monotonic() < deadline, tasks
    return tasks


def test_a_session_is_recorded_from_the_page(tmp_path: Path) -> None:
    with running(folder=tmp_path) as (server, _), live(server) as client:
        client.send('{"do":"record","on":true}')
        path = told(client, lambda tasks: tasks.get("recording", {}).get("seconds", 0.0) > 0.5)
        assert Path(path["recording"]["path"]).parent == tmp_path
        with live(server) as another:  # whoever looks sees it, and may end it
            another.send('{"do":"record","on":false}')
            told(another, lambda tasks: path["recording"]["path"] in tasks["saved"])
        client.send('{"do":"record","on":true}')
        told(client, lambda tasks: "recording" in tasks)
    first, second = sorted(tmp_path.iterdir())  # the end of the run completes what is being recorded
    assert path["recording"]["path"] == str(first)
    session = read_session(first)
    assert session.complete
    assert read_session(second).complete
    assert session.description.string == SIGNAL.string
    assert session.audio.samples.shape[1] > 0.5 * 44100
    assert session.audio.gaps == ()  # it begins with its first window, not with the run
    assert "estimates" in session.streams


def test_a_recording_that_cannot_be_made_is_said_and_the_page_goes_on(tmp_path: Path) -> None:
    with running(folder=tmp_path / "gone") as (server, _), live(server) as client:
        client.send('{"do":"record","on":true}')
        assert "gone" in told(client, lambda tasks: tasks["saved"])["saved"]
        messages_of(client, "moment", 3)


def test_a_page_chooses_among_strings_for_itself() -> None:
    with (
        RunServer(port=free(), first="ring") as server,
        server.show(SIGNAL, LENGTH, None, string="thumb") as thumb,
        server.show(replace(SIGNAL, channels=1), 2 * LENGTH, None, string="ring") as ring,
        Run(thumb, "thumb"),
        Run(ring, "ring"),
        live(server) as client,
        live(server) as other,
    ):
        assert messages_of(client, "hello")[0]["length"] == 2 * LENGTH
        told = messages_of(client, "moment", 10)[-1]
        assert told["string"] == "ring"
        assert [each["name"] for each in told["strings"]] == ["thumb", "ring"]
        assert {"contact", "position", "force", "note"} <= told["strings"][0].keys()
        assert told["strings"][0]["note"] == "warning"
        client.send(json.dumps({"do": "show", "string": "nobody"}))
        client.send(json.dumps({"do": "show", "string": "thumb"}))
        assert messages_of(client, "hello")[0]["length"] == LENGTH
        assert {each["string"] for each in messages_of(client, "moment", 10)} == {"thumb"}
        assert {each["string"] for each in messages_of(other, "moment", 10)} == {"ring"}
        assert server.counts["ignored"] == 1


def test_a_page_that_goes_away_or_falls_silent_lets_go_of_the_string() -> None:
    for leave in (True, False):
        keep = Keep()
        with running(keep) as (server, _), live(server) as client:
            client.send('{"do":"touch","position":0.06,"force":1.0}')
            wait_for(lambda keep=keep: keep.asked)
            if leave:
                client.close()
            wait_for(lambda keep=keep: keep.asked[-1] == "release")


def test_bytes_that_are_no_http_harm_nobody() -> None:
    rng = np.random.default_rng(3)
    with running() as (server, _):
        for _ in range(30):
            with socket.create_connection(("127.0.0.1", server.port), 30) as sock:
                sock.sendall(rng.bytes(int(rng.integers(1, 3000))))
                if rng.integers(2):
                    sock.sendall(b"GET /live HTTP/1.1\r\nUpgrade: websocket\r\nConnection: upgrade\r\n\r\n")
        assert get(server, "/").status == 200


def raw_client(server: Server) -> socket.socket:
    """A WebSocket client that never reads."""
    sock = socket.socket()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    sock.settimeout(30)
    sock.connect(("127.0.0.1", server.port))
    sock.sendall(
        b"GET /live HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    return sock


@pytest.mark.slow
@pytest.mark.real_time
def test_two_hundred_clients_and_some_that_never_read_delay_nobody() -> None:
    with ExitStack() as stack:
        server, run = stack.enter_context(running())
        for _ in range(195):
            stack.enter_context(raw_client(server))
        client = stack.enter_context(live(server))
        wait_for(lambda: server.counts["clients"] == 196)
        before = run.written
        begin = time.monotonic()
        told = messages_of(client, "moment", 20)
        passed = time.monotonic() - begin
        assert 20 / passed > 2.0
        assert run.written - before > 50 * passed  # the run keeps its pace of 100 a second
        assert run.longest < 0.25
        assert run.written - 100 * told[-1]["time"] < 100


def test_it_ends_whoever_is_connected() -> None:
    with ExitStack() as clients:
        with running() as (server, _):
            clients.enter_context(raw_client(server))
            client = clients.enter_context(live(server))
            messages_of(client, "moment")
            port = server.port
        with pytest.raises(ConnectionClosed):
            messages_of(client, "never")
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 5):
        pytest.fail("somebody still listens")
