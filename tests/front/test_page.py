"""The sink `web` with what the command line hands it: recordings, guided steps, and the page of a design."""

from pathlib import Path
from typing import Any

import pytest
from tests.live.web.test_server import SIGNAL, free, get, live, messages_of, update
from tests.waiting import wait_for

from monochord.front.page import with_page
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Run, Sink


@pytest.mark.parametrize("whole", [True, False])
def test_a_page_has_the_tasks_that_are_handed_to_it(tmp_path: Path, *, whole: bool) -> None:
    sinks: list[Sink] = [
        SINKS.build("web", {"at": str(free()), "folder": str(tmp_path)}),
        SINKS.build("udp"),
    ]
    page, other = with_page(sinks) if whole else sinks
    assert other is sinks[1]
    with page.ahead() as ahead, ahead.open(Run(signal=SIGNAL)) as writer:
        begun: Any = ahead
        server = begun.server
        assert get(server, "/design").status == (200 if whole else 404)
        assert (b"Design</a>" in get(server, "/").body) == whole  # pyright: ignore[reportAttributeAccessIssue]
        with live(server) as client:
            messages_of(client, "hello")
            client.send('{"do":"record","on":true}')
            wait_for(lambda: server.counts["ignored"] == (0 if whole else 1))
            writer.write(update(0))
            moment = messages_of(client, "moment")[0]
            assert ("tasks" in moment) == whole
    assert len([*tmp_path.iterdir()]) == whole  # a recording without a window is a session, too
