"""The design on the page: what the server answers, whom it refuses, and that nothing stops it."""

import http.client
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import psutil
import pytest
from tests.live.web.run_server import RunServer
from tests.live.web.test_server import TOKEN, free, get
from tests.waiting import wait_for

import monochord as mc
from monochord.front.page import design_page
from monochord.page.design import MAX_REQUEST
from monochord.page.server import Server

STRING = {"gauge": 0.254e-3, "tension": 40.0, "length": 0.2}
GIVEN = b'{"do": "string", "wishes": {%s}}'


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server([design_page()], port=free()) as server:
        yield server


def post(server: Server, body: bytes, **headers: str) -> tuple[int, Any]:
    """Return status and answer of a request, asked again as long as the server says so."""
    while True:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
        connection.request("POST", "/design", body, headers)
        answer = connection.getresponse()
        status, content = answer.status, answer.read()
        connection.close()
        if status != 202:
            return status, json.loads(content) if content.startswith(b"{") else content


def ask(server: Server, do: str, **wishes: Any) -> dict[str, Any]:
    status, answer = post(server, json.dumps({"do": do, "wishes": wishes}).encode())
    assert status == 200, answer
    return answer


def test_a_string_has_the_figures_of_the_command(server: Server) -> None:
    answer, made = ask(server, "string", **STRING), mc.design(gauge=0.254e-3, tension=40.0)
    own = next(each for each in made.candidates if each.string.length == STRING["length"])
    for name in ("frequency", "force_std", "position_std", "settling", "clearance", "drift", "stress_share"):
        assert answer[name] == pytest.approx(getattr(own, name)), name
    assert answer["lacks"] == [*own.lacks]
    assert answer["squeal"] == "squeals"
    assert answer["frames"]["steel"] == {"cents": 0.0, "force": 0.0}
    assert len(answer["curves"]["lines"]) == len(answer["curves"]["positions"]) == 21
    assert 0.1 < answer["ambiguity"]["share"] < 0.4


def test_the_downloaded_file_is_a_sensor(server: Server, tmp_path: Any) -> None:
    file = tmp_path / "sensor.toml"
    file.write_text(ask(server, "string", **STRING)["toml"], encoding="utf-8")
    string = mc.load_sensor(str(file)).string
    assert (string.core_diameter, string.tension, string.length) == pytest.approx((0.254e-3, 40.0, 0.2))


def test_the_recommendation_is_that_of_the_command_whatever_string_is_looked_at(server: Server) -> None:
    answer, made = ask(server, "recommend", range=0.08, **STRING), mc.design(range=0.08)
    assert answer["reasons"] == made.reasons()
    assert answer["toml"] == made.toml()
    assert len(answer["sweep"]) == len(made.candidates)


def test_a_page_learns_what_can_be_wished(server: Server) -> None:
    about = ask(server, "about")
    assert about["limits"]["length"] == [0.08, 2.0]
    assert about["limits"]["gauge"] == [1e-4, 1.5e-3]
    assert about["string"] == pytest.approx({"gauge": 0.254e-3, "tension": 65.0, "length": 0.2})
    assert {"plastic", "wood"} < {*about["choices"]["material"]}
    assert about["choices"]["model"] == ["demo", "none"]
    answers = [ask(server, "string", **STRING, model=each) for each in about["choices"]["model"]]
    assert [each["fits_model"] for each in answers] == [False, None]


@pytest.mark.parametrize(
    ("body", "named"),
    [
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "length": 0', "length"),
        (GIVEN % b'"gauge": NaN, "tension": 40', "request"),
        (GIVEN % b'"gauge": "nan", "tension": 40', "gauge"),
        (GIVEN % b'"gauge": "thick", "tension": 40', "thick"),
        (GIVEN % b'"gauge": "", "tension": 40', "gauge"),
        (GIVEN % b'"gauge": 1e-4, "tension": 400', "bears its tension"),
        (GIVEN % b'"tension": 40', "gauge"),
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "range": 0.15', "coils need"),
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "forces": [1e-300, 1e-200]', "forces"),
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "forces": [2, 1]', "forces"),
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "material": "/etc/passwd"', "a name of the list"),
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "material": ["wood"]', "a name of the list"),
        (GIVEN % b'"gauge": 0.254e-3, "tension": 40, "model": "/etc"', "a name of the list"),
        (GIVEN % b'"gauges": 1', "did you mean 'gauge'"),
        (b'{"do": "destroy"}', "request"),
        (b"[" * 4000, "request"),
        (b"\xff\xfe", "request"),
        (b"", "request"),
        (b"null", "request"),
    ],
)
def test_bad_wishes_give_one_line_and_the_next_are_answered(server: Server, body: bytes, named: str) -> None:
    status, answer = post(server, body)
    assert status == 200
    assert [*answer] == ["error"]
    assert named in answer["error"]
    assert "\n" not in answer["error"]
    assert "Error" not in answer["error"]
    assert ask(server, "string", **STRING)["frequency"] > 0.0


def test_a_long_request_and_a_foreign_page_are_refused(server: Server) -> None:
    assert post(server, b" " * (MAX_REQUEST + 1))[0] == 413
    assert post(server, b"{}", Origin="http://evil.example")[0] == 403
    assert post(server, b"{}", Host="evil.example")[0] == 421
    with Server([design_page()], port=free(), token=TOKEN) as guarded:
        assert post(guarded, b"{}")[0] == 401
        assert get(guarded, "/design").status == 401
        assert get(guarded, "/design", Cookie=f"monochord={TOKEN}").status == 200


def test_a_process_that_dies_is_started_again(server: Server) -> None:
    ask(server, "about")
    children = psutil.Process().children()
    (worker,) = [each for each in children if any("spawn_main" in word for word in each.cmdline())]
    worker.send_signal(signal.SIGKILL)
    wait_for(lambda: not psutil.pid_exists(worker.pid))  # the server waits for its child
    assert ask(server, "string", **STRING)["frequency"] > 0.0


def test_every_wish_has_a_field_on_the_page(server: Server) -> None:
    script = get(server, "/static/design.js").body.decode()  # pyright: ignore[reportAttributeAccessIssue]
    named = {"forces": "most"}  # the least and the largest press are fields of their own
    for name in ask(server, "about")["wishes"]:
        assert f'["{named.get(name, name)}", ' in script, name


def test_many_pages_at_once_are_answered_or_told_to_wait(server: Server) -> None:
    bodies = [
        json.dumps({"do": "string", "wishes": STRING | {"tension": 30.0 + k}}).encode() for k in range(16)
    ]
    with ThreadPoolExecutor(16) as pool:
        answers = [*pool.map(lambda body: post(server, body), bodies)]
    assert {status for status, _ in answers} <= {200, 429}
    answered = [answer["string"]["tension"] for status, answer in answers if status == 200]
    assert len(answered) >= 8
    assert len({*answered}) == len(answered)


def test_every_page_leads_to_the_others(server: Server) -> None:
    assert get(server, "/").getheader("location") == "design"
    alone = get(server, "/design").body.decode()  # pyright: ignore[reportAttributeAccessIssue]
    assert '<a href="design" aria-current="page">Design</a>' in alone
    assert "Live" not in alone
    with RunServer(port=free(), pages=[design_page()]) as running:
        for path, other in (("/", "design"), ("/design", "./")):
            page = get(running, path).body.decode()  # pyright: ignore[reportAttributeAccessIssue]
            assert f'<a href="{other}">' in page


def test_the_command_serves_the_page_until_it_is_interrupted() -> None:
    command = [sys.executable, "-m", "monochord", "design", "--web", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("page: http://127.0.0.1:")
        port = int(line.rstrip("/\n").rpartition(":")[2])
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
        connection.request("POST", "/design", b'{"do": "about"}')
        assert json.loads(connection.getresponse().read())["limits"]
        connection.close()
        children = psutil.Process(process.pid).children()
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=60) == ("", "")
        assert process.returncode == 0
        wait_for(lambda: not any(each.is_running() for each in children), 10.0)
