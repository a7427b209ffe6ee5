"""The page of a bring-up: what it says and takes over real sockets, and that a guide may skip and repeat."""

import http.client
import json
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.live.web.test_server import TOKEN, free, get
from tests.waiting import wait_for
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

import monochord as mc
from monochord.bringup import END, RECORD, SKIP, STEPS, BringUp, Guide, Step, Take, Virtual, bring_up, write
from monochord.bringup.web import BringUpPage
from monochord.core.errors import DeviceError
from monochord.front.page import design_page
from monochord.page.server import Server
from monochord.physics.sensors import load_sensor

RATE = 44100
QUIET, PLUCK, TAP = STEPS[:3]


class Hum:
    """A source that hums at -23 dB of full scale, and fails in steps that are told."""

    def __init__(self, on_audio: Any = lambda *_: None, failing: Sequence[str] = ()) -> None:
        self.on_audio, self.failing, self.taken = on_audio, [*failing], list[str]()
        tone = 0.1 * np.sin(2 * np.pi * 1000.0 * np.arange(2 * RATE) / RATE)
        self.sound = np.tile(tone, (2, 1)).astype(np.float32)

    def take(self, step: Step) -> Take:
        self.taken.append(step.name)
        if step.name in self.failing:
            self.failing.remove(step.name)
            raise DeviceError("device 'USB Audio' is lost")
        return Take(samples=self.sound, sample_rate=RATE)

    def listen(self, ended: threading.Event) -> None:
        while not ended.wait(0.02):
            self.on_audio(self.sound[:, :2205], RATE)


class Simulated(Hum):
    """The virtual sensor, beside the hum between the steps."""

    def take(self, step: Step) -> Take:
        return Virtual(sensor=load_sensor("prototype"), seed=3).take(step)


class Choosing(Guide):
    """Chooses in order, and ends."""

    def __init__(self, *choices: str) -> None:
        self.choices, self.asked = [*choices], list[str]()

    def choose(self, step: Step | None, result: BringUp | None) -> str:
        self.asked.append(step.name if step else "")
        return self.choices.pop(0) if self.choices else END


@pytest.mark.parametrize(
    ("choices", "asked", "taken"),
    [
        ((RECORD, RECORD, RECORD), ["quiet", "pluck", "tap", ""], ["quiet", "pluck", "tap"]),
        ((RECORD, SKIP, RECORD), ["quiet", "pluck", "tap", ""], ["quiet", "tap"]),
        ((RECORD, "quiet", RECORD, SKIP), ["quiet", "pluck", "quiet", "pluck", "tap"], ["quiet", "quiet"]),
        (
            (SKIP, RECORD, SKIP, "quiet", RECORD),
            ["quiet", "pluck", "tap", "", "quiet", ""],
            ["pluck", "quiet"],
        ),
    ],
)
def test_a_guide_records_skips_and_repeats(choices: Any, asked: list[str], taken: list[str]) -> None:
    guide, source = Choosing(*choices), Hum()
    result = bring_up("prototype", source, (QUIET, PLUCK, TAP), guide)
    assert guide.asked == asked
    assert source.taken == taken
    assert {*result.takes} == {*taken}


def test_a_bring_up_without_a_step_is_refused() -> None:
    with pytest.raises(mc.InputError, match="no step"):
        bring_up("prototype", Hum(), STEPS, Choosing(SKIP, END))


class Running:
    """A bring-up in a thread, its page, and one open browser's connection."""

    def __init__(self, server: Server, page: BringUpPage, client: ClientConnection) -> None:
        self.server, self.page, self.client = server, page, client
        self.state: dict[str, Any] = {}
        self.meter: dict[str, Any] = {}
        self.refused: list[str] = []

    def wait(self, **wanted: Any) -> dict[str, Any]:
        """Return the state once it has these values."""
        deadline = time.monotonic() + 120.0
        while any(self.state.get(name) != value for name, value in wanted.items()):
            assert time.monotonic() < deadline, self.state
            self.read()
        return self.state

    def read(self) -> None:
        message = json.loads(self.client.recv(60))
        if message["type"] == "state":
            self.state = message
        elif message["type"] == "meter":
            self.meter = message
        else:
            self.refused.append(message["line"])

    def send(self, do: str, step: str = "") -> None:
        self.client.send(json.dumps({"do": do, "step": step}))

    def status(self) -> dict[str, str]:
        return {each["name"]: each["status"] for each in self.state["steps"]}


@contextmanager
def running(source: Hum, out: Path | None = None, token: str = "") -> Generator[Running]:
    page = BringUpPage(
        "prototype", (QUIET, PLUCK, TAP), write=None if out is None else lambda result: write(result, out)
    )
    source.on_audio = page.on_audio

    def work() -> None:
        with suppress(mc.InputError):  # no step was recorded
            bring_up("prototype", source, (QUIET, PLUCK, TAP), page.guide(source))

    thread = threading.Thread(target=work, daemon=True)
    headers = {"Cookie": f"monochord={token}"} if token else {}
    with Server([page.page, design_page()], port=free(), token=token) as server:
        thread.start()
        address = f"ws://127.0.0.1:{server.port}/bring-up-live"
        try:
            with connect(address, open_timeout=30, close_timeout=0.5, additional_headers=headers) as client:
                yield Running(server, page, client)
        finally:
            while thread.is_alive():  # once for the steps, once for the page: Control-C in the command
                page._choices.put(END)  # pyright: ignore[reportPrivateUsage]
                thread.join(0.5)


def test_a_page_leads_through_the_steps_and_gives_the_files(tmp_path: Path) -> None:
    out = tmp_path / "mine.toml"
    with running(Simulated(), out) as run:
        assert get(run.server, "/sensor.toml").status == get(run.server, "/report.html").status == 404
        assert run.wait(step="quiet", phase="ready")["steps"][0]["instruction"] == QUIET.instruction
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready")
        assert any(each["step"] == "quiet" for each in run.state["checks"])
        assert {each["step"] for each in run.state["checks"]} <= {"quiet", "loopback"}
        run.send("record", "pluck")
        run.wait(step="tap", phase="ready")
        run.send("skip", "tap")
        state = run.wait(step=None, phase="done", paths=[str(out), str(out.with_suffix(".html"))])
        assert run.status() == {"quiet": "passed", "pluck": "passed", "tap": "skipped"}
        assert (state["simulated"], "Simulated" in state["verdict"]) == (True, True)
        pitch = next(each for each in state["checks"] if each["name"] == "open pitch")
        assert (pitch["value"], pitch["passed"]) == ("1011 Hz", True)
        answer = get(run.server, "/sensor.toml")
        assert "mine.toml" in (answer.getheader("content-disposition") or "")
        assert answer.body.decode() == out.read_text(encoding="utf-8")  # pyright: ignore[reportAttributeAccessIssue]
        assert mc.load_sensor(str(out)).string.tension == pytest.approx(65.0, rel=0.01)
        report = get(run.server, "/report.html")
        assert b"<svg" in report.body  # pyright: ignore[reportAttributeAccessIssue]
        policies = [value for name, value in report.getheaders() if name.lower() == "content-security-policy"]
        assert len(policies) == 1
        assert "script-src" not in policies[0]
        assert "default-src 'none'" in policies[0]


def test_any_step_is_repeated_even_at_the_end() -> None:
    source = Hum()
    with running(source) as run:
        run.wait(step="quiet", phase="ready")
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready")
        run.send("repeat", "quiet")
        run.wait(step="quiet", phase="ready")
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready")
        run.send("end", "pluck")
        run.wait(phase="done")
        run.send("repeat", "quiet")
        run.wait(step="quiet", phase="ready")
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready")
    assert source.taken == ["quiet"] * 3


def test_a_lost_device_is_said_and_the_step_is_asked_again() -> None:
    source = Hum(failing=["quiet"])
    with running(source) as run:
        run.wait(step="quiet", phase="ready", error="")
        run.send("record", "quiet")
        run.wait(step="quiet", phase="ready", error="device 'USB Audio' is lost")
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready", error="")


def test_a_device_that_is_missing_between_the_steps_is_said_until_it_is_heard() -> None:
    class Missing(Hum):
        plugged_in = False

        def listen(self, ended: threading.Event) -> None:
            if not self.plugged_in:
                raise DeviceError("no device 'USB Audio'")
            super().listen(ended)

    source = Missing()
    with running(source) as run:
        run.wait(step="quiet", phase="ready", error="no device 'USB Audio'")
        source.plugged_in = True
        run.wait(step="quiet", phase="ready", error="")


def test_files_that_cannot_be_written_are_said_and_still_downloaded(tmp_path: Path) -> None:
    with running(Simulated(), tmp_path / "gone" / "mine.toml") as run:
        run.wait(step="quiet", phase="ready")
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready")
        run.send("end", "pluck")
        state = run.wait(phase="done", paths=[])
        assert "mine.html" in state["error"]
        assert get(run.server, "/report.html").status == 200


def test_the_meter_shows_what_is_heard_between_the_steps() -> None:
    with running(Hum()) as run:
        while not run.meter.get("levels"):
            run.read()
        assert run.meter["levels"] == [pytest.approx([-23.0, -20.0], abs=0.1)] * 2
        assert run.meter["clips"] == [False, False]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("nonsense", "request"),
        ('{"do": "destroy"}', "request"),
        ('{"do": "record", "step": NaN}', "request"),
        ("[" * 900, "request"),
        ('{"do": "record", "step": "tap"}', "Another page"),
        ('{"do": "repeat", "step": "both"}', "expected quiet, pluck, tap"),
        ('{"do": "repeat", "step": "../../etc"}', "expected quiet, pluck, tap"),
    ],
)
def test_a_bad_request_gets_one_line_and_the_bring_up_goes_on(text: str, line: str) -> None:
    with running(Hum()) as run:
        run.wait(step="quiet", phase="ready")
        run.client.send(text)
        while not run.refused:
            run.read()
        assert line in run.refused[0]
        assert "\n" not in run.refused[0]
        run.send("record", "quiet")
        run.wait(step="pluck", phase="ready")


def test_pages_of_others_and_those_without_the_token_are_refused() -> None:
    with running(Hum(), token=TOKEN) as run:
        run.wait(step="quiet")
        for path in ("/bring-up", "/sensor.toml", "/report.html", "/static/bring_up.js"):
            assert get(run.server, path).status == 401
            assert get(run.server, path, Origin="http://evil.example").status == 403
        for headers in ({}, {"Origin": "http://evil.example", "Cookie": f"monochord={TOKEN}"}):
            address = f"ws://127.0.0.1:{run.server.port}/bring-up-live"
            with pytest.raises(InvalidStatus), connect(address, additional_headers=headers):
                pass


def test_the_page_is_there_with_its_tabs_and_files() -> None:
    with running(Hum()) as run:
        wait_for(lambda: get(run.server, "/").status == 303, 10.0)
        assert get(run.server, "/").getheader("location") == "bring-up"
        page = get(run.server, "/bring-up").body.decode()  # pyright: ignore[reportAttributeAccessIssue]
        assert '<a href="bring-up" aria-current="page">Bring-up</a><a href="design">Design</a>' in page
        assert "http" not in page
        connection = http.client.HTTPConnection("127.0.0.1", run.server.port, timeout=30)
        connection.request("GET", "/static/bring_up.js")
        assert connection.getresponse().getheader("content-type", "").startswith("text/javascript")
        connection.close()
