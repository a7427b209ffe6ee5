"""Who is let in to the page: tokens of any characters, cookies of several pages, other names of it."""

import http.client
import re
import socket
import threading
import time
from urllib.parse import quote, urlsplit

import pytest
from tests.live.web.run_server import RunServer
from tests.live.web.test_server import SIGNAL, TOKEN, free, get, live, messages_of, running, update
from websockets.exceptions import InvalidStatus

from monochord.core.errors import InputError
from monochord.live.web.run_page import RunPage
from monochord.page.guard import FREE, INTERVAL, MAX_ATTEMPTS, page_name
from monochord.page.server import Server


def cookie_of(server: Server, **headers: str) -> str:
    """Return the cookie that a browser has once it opened the link."""
    link = urlsplit(server.address)
    answer = get(server, f"{link.path}?{link.query}", **headers)
    assert answer.status == 303, answer.status
    return (answer.getheader("set-cookie") or "").partition(";")[0]


@pytest.mark.parametrize("token", ["a&b#c+d e", "äß€ 😀 100%41", 'x;y,z=:q"u\\o\t\n'])
def test_a_token_of_any_characters_is_that_of_the_link_and_of_the_cookie(token: str) -> None:
    with running(token=token) as (server, _):
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w.~%-]+", server.address, re.ASCII)
        cookie = cookie_of(server)
        assert get(server, "/", Cookie=cookie).status == 200
        for known in (cookie, f"monochord={quote(token, safe='')}"):  # a browser's, and a program's
            with live(server, additional_headers={"Cookie": known}) as client:
                messages_of(client, "moment")
        for other in (token[:-1], f"{token}x", quote(token, safe="") + "x"):
            assert get(server, f"/?token={quote(other, safe='')}").status == 401


def test_two_pages_of_a_host_do_not_log_each_other_out() -> None:
    with running(token="one") as (first, _), running(token="two") as (second, _):  # noqa: S106
        jar = dict(cookie_of(server).split("=", 1) for server in (first, second))
        cookies = "; ".join(f"{name}={value}" for name, value in jar.items())
        assert [get(server, "/", Cookie=cookies).status for server in (first, second)] == [200, 200]
        assert f"monochord_{first.port}" in jar
    with running(token="one") as (first, _):  # noqa: S106  (two tunnels to the same port of two machines)
        names = {cookie_of(first, Host=f"localhost:{port}").partition("=")[0] for port in (9000, 9001)}
        assert len(names) == 2


def test_what_else_a_host_keeps_in_its_cookies_is_no_matter() -> None:
    with running(token=TOKEN) as (server, _):
        others = 'settings={"a": [1, 2]}; bare; x="\x01; session=a/b?c@d'
        assert get(server, "/", Cookie=f"{others}; {cookie_of(server)}").status == 200


def test_a_browser_stays_let_in_where_the_run_is_started_anew_with_its_token() -> None:
    with running(token=TOKEN) as (server, _):
        port, cookie = server.port, cookie_of(server)
    with RunServer(port=port, token=TOKEN) as server:
        assert get(server, "/static/page.js", Cookie=cookie).status == 200
        again = get(server, "/", Cookie=cookie)
        assert again.status == 200
        assert again.getheader("set-cookie")
        with live(server, additional_headers={"Cookie": cookie}):
            pass
    with RunServer(port=port, token="other") as server:  # noqa: S106
        assert get(server, "/", Cookie=cookie).status == 401


def tried(server: Server, token: str, source: str = "127.0.0.1") -> int:
    """Return the status of a link that is opened from one of this machine's addresses."""
    address = ("127.0.0.1", server.port)
    connection = http.client.HTTPConnection(*address, timeout=30, source_address=(source, 0))
    connection.request("GET", f"/?token={token}")
    status = connection.getresponse().status
    connection.close()
    return status


@pytest.mark.slow
@pytest.mark.real_time
def test_wrong_tokens_are_slowed_down_and_lock_nobody_out() -> None:
    with running(token=TOKEN) as (server, _):
        cookie = cookie_of(server)
        begin = time.monotonic()
        assert {tried(server, f"wrong{number}") for number in range(FREE)} == {401}
        assert time.monotonic() - begin < FREE * INTERVAL  # who mistypes waits for nothing
        for number in range(10):
            assert tried(server, f"wrong{number}") == 401
        assert time.monotonic() - begin > 9 * INTERVAL

        ended, answers = threading.Event(), list[int]()

        def guess() -> None:
            while not ended.is_set():
                answers.append(tried(server, f"guess{len(answers)}"))

        threads = [threading.Thread(target=guess) for _ in range(8)]
        begin = time.monotonic()
        for thread in threads:
            thread.start()
        try:
            for source in ("127.0.0.1", "127.0.0.2", "127.0.0.3"):
                asked = time.monotonic()
                assert tried(server, TOKEN, source) == 303
                assert time.monotonic() - asked < 0.5, source
            asked = time.monotonic()
            assert get(server, "/", Cookie=cookie).status == 200
            with live(server, additional_headers={"Cookie": cookie}) as client:
                messages_of(client, "moment")
            assert time.monotonic() - asked < 1.0
            time.sleep(1.0)
        finally:
            ended.set()
            for thread in threads:
                thread.join()
        assert len(answers) < (time.monotonic() - begin) / INTERVAL + FREE + 2
        assert set(answers) == {401}


@pytest.mark.slow
def test_so_many_tokens_at_once_that_they_would_wait_for_long_are_refused() -> None:
    with running(token=TOKEN) as (server, _):
        answers = list[int]()
        threads = [
            threading.Thread(target=lambda: answers.append(tried(server, "wrong")))
            for _ in range(MAX_ATTEMPTS + FREE + 20)
        ]
        for thread in threads:
            thread.start()
        time.sleep(0.5)
        asked = time.monotonic()
        assert [tried(server, TOKEN) for _ in range(6)] == [303] * 6
        assert tried(server, TOKEN, "127.0.0.2") == 303
        assert time.monotonic() - asked < 2.0
        for thread in threads:
            thread.join()
        assert set(answers) == {401, 429}
        assert tried(server, TOKEN) == 303


def test_a_name_of_the_page_is_allowed_and_a_refusal_says_how(capsys: pytest.CaptureFixture[str]) -> None:
    names = ("lab.example.org", "proxy:8443")
    with RunServer(port=free(), names=names) as server, server.show(SIGNAL, 0.2, None) as writer:
        writer.write(update(0))
        for host in (*names, "LAB.example.org:80", "lab.example.org.", "proxy", "127.0.0.1"):
            assert get(server, "/", Host=host).status == 200, host
        answer = get(server, "/", Host="other.example.org:8420")
        assert answer.status == 421
        assert b"other.example.org" in answer.body  # pyright: ignore[reportAttributeAccessIssue]
        for host in ("evil<b>", "", "a b", "x" * 300, "lab.example.org.evil.org", "[::1"):
            answer = get(server, "/", Host=host)
            assert answer.status in (400, 421), host
            assert b"<" not in answer.body  # pyright: ignore[reportAttributeAccessIssue]
        # Behind a proxy that calls the server by its own name, the page is the proxy's.
        for origin in ("https://lab.example.org", "http://proxy:8443", "https://proxy:8443"):
            with live(server, additional_headers={"Origin": origin}):
                pass
        assert capsys.readouterr().err == ""
        for origin in ("https://lab.example.org:8443", "https://proxy", "https://evil.org", "null"):
            with pytest.raises(InvalidStatus), live(server, additional_headers={"Origin": origin}):
                pass
        (told,) = capsys.readouterr().err.splitlines()
        assert "lab.example.org:8443" in told
        assert get(server, "/", **{"X-Forwarded-Host": "lab.example.org"}).status == 200
        assert get(server, "/", **{"X-Forwarded-Host": "other"}).status == 421


def test_beyond_this_machine_the_page_has_its_name_and_any_address() -> None:
    machine = socket.gethostname()
    short = machine.partition(".")[0]
    for host, status in (("127.0.0.1", 421), ("0.0.0.0", 200)):  # noqa: S104
        with Server([RunPage().page], host, free()) as server:
            for name in (machine, short, f"{short}.local", "10.1.2.3"):
                assert get(server, "/", Host=f"{name}:{server.port}").status == status, (host, name)
            assert get(server, "/", Host="evil.example").status == 421


def test_a_name_that_is_none_is_refused() -> None:
    assert page_name("Bücher.example:8443") == "xn--bcher-kva.example:8443"
    assert page_name("fd00::1") == page_name("[fd00::1]:443") == "[fd00::1]"
    for name in ("", "*", "https://lab", "lab/page", "a b", "lab:x", "lab:99999", "u@lab", "a..b", "[::1"):
        with pytest.raises(InputError):
            page_name(name)


@pytest.mark.parametrize(("path", "location"), [("/", "./"), ("/static/page.js", None)])
def test_the_link_leads_to_the_folder_in_which_a_proxy_serves_the_page(
    path: str, location: str | None
) -> None:
    with running(token=TOKEN) as (server, _):
        answer = get(server, f"{path}?token={TOKEN}")
        assert answer.getheader("location") == location
        if location:
            assert "path" not in (answer.getheader("set-cookie") or "").lower()
        page = get(server, "/", Cookie=cookie_of(server)).body.decode()  # pyright: ignore[reportAttributeAccessIssue]
        assert not re.findall(r'(?:href|src)="/', page)
