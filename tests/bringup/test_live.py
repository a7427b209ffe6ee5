"""A bring-up over a real JACK server, which another client plays into."""

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
import soundfile
from tests.waiting import wait_for

from monochord.bringup import STEPS, Live
from monochord.bringup.web import BringUpPage
from monochord.capture.jack.server import JackServer
from monochord.capture.sources import SOURCES


@pytest.mark.slow
@pytest.mark.jack
@pytest.mark.real_time
def test_a_page_hears_a_real_server_between_the_steps(
    jack_server: JackServer, play: Callable[..., psutil.Process], tmp_path: Path
) -> None:
    tone = 0.1 * np.sin(2 * np.pi * 1000.0 * np.arange(120 * 44100) / 44100)
    soundfile.write(tmp_path / "tone.wav", np.stack([tone, 0.1 * tone], axis=1), 44100, subtype="FLOAT")
    play(tmp_path / "tone.wav")
    options = {"ports": "player:out_1,player:out_2", "server": jack_server.name, "client_name": "doctor"}
    page = BringUpPage("prototype", STEPS)
    live = Live(source=SOURCES.build("jack", options), name="jack", on_audio=page.on_audio)
    for _ in range(2):
        ended = threading.Event()
        thread = threading.Thread(target=live.listen, args=(ended,))
        thread.start()
        wait_for(lambda: page.meter()["levels"], 60.0)
        levels = page.meter()["levels"]
        ended.set()
        thread.join(30.0)
        assert not thread.is_alive()
        assert [rms for rms, _ in levels] == pytest.approx([-23.0, -43.0], abs=1.0)
        before = page.meter()["seconds"]
        take = live.take(replace(STEPS[0], seconds=1.0))
        assert take.samples.shape[1] >= 44100
        assert page.meter()["seconds"] == pytest.approx(before + 1.0, abs=0.15)
