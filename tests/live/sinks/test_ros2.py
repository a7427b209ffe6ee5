"""What the sink publishes, as readers of another participant take it, and as rosbags decodes the bytes."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.live.sinks.made import SIGNAL, update
from tests.waiting import wait_for

from monochord.capture.dds.participant import Participant
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Estimate, Tracked
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Run, Update
from monochord.live.sinks.ros2 import TOPICS, Ros2
from monochord.sessions.codec import decode, nanoseconds

pytestmark = pytest.mark.real_time
DOMAIN = 1 + os.getpid() % 99  # another run of the tests has another one
TOUCHED = {
    "contact": Estimate(value=0.98, std=0.01, unit="1"),
    "position": Estimate(value=0.08, std=2e-4, unit="m"),
    "force": Estimate(value=0.7, std=0.1, unit="N"),
    "slip": Estimate(value=0.1, std=0.05, unit="1"),
}
UNTOUCHED = {
    "contact": Estimate(value=0.01, std=0.01, unit="1"),
    **{name: Estimate.abstain("", "no contact") for name in ("position", "force", "slip")},
}
UNKNOWN = {name: Estimate.abstain("", "gap") for name in TOUCHED}


def published(*updates: Update, **options: Any) -> dict[str, list[Any]]:
    """Return the messages by topic that a subscriber takes of these updates."""
    sink = Ros2(domain=DOMAIN, namespace="/lab/left", **options)
    received: dict[str, list[Any]] = {topic: [] for topic in (*TOPICS, "diagnostics")}
    with Participant(domain=DOMAIN) as here, sink.open(Run(signal=SIGNAL)) as writer:
        readers = [
            here.reader(f"/lab/left/{topic}", kind, lambda message, _, to=received[topic]: to.append(message))
            for topic, kind in TOPICS.items()
        ]
        take = received["diagnostics"].append
        readers.append(here.reader("/diagnostics", "DiagnosticArray", lambda message, _: take(message)))
        wait_for(lambda: all(reader.writers for reader in readers))
        time.sleep(0.3)  # until the writers know the readers, too
        for each in updates:
            writer.write(each)
        wait_for(lambda: len(received["estimates"]) == len(updates) and received["diagnostics"])
        time.sleep(0.1)
    return received


def test_a_touch_is_on_every_topic() -> None:
    captured, wall = time.monotonic() - 1000.1, time.time() - 1000.0
    messages = published(update(TOUCHED, adc_time=captured), frame="nut")
    (point,), (wrench,) = messages["touch"], messages["wrench"]
    assert (point.point.x, point.point.y, point.point.z) == (0.08, 0.0, 0.0)
    assert (wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z) == (0.0, 0.0, 0.7)
    assert [(m.data) for m in (*messages["contact"], *messages["slip"])] == [True, False]
    for message in (point, wrench, messages["estimates"][0]):
        assert message.header.frame_id == "nut"
        assert nanoseconds(message.header.stamp) * 1e-9 == pytest.approx(wall, abs=0.5)


def test_nothing_touches_is_no_force_and_no_position() -> None:
    messages = published(update(UNTOUCHED))
    assert [len(messages[topic]) for topic in ("touch", "wrench", "contact", "slip")] == [0, 1, 1, 1]
    assert messages["wrench"][0].wrench.force.z == 0.0
    assert (messages["contact"][0].data, messages["slip"][0].data) == (False, False)


def test_what_is_not_known_is_silent_with_its_reason_in_the_message_of_all() -> None:
    messages = published(update(UNKNOWN))
    assert [len(messages[topic]) for topic in ("touch", "wrench", "contact", "slip")] == [0, 0, 0, 0]
    (touch,) = messages["estimates"]
    each = (touch.contact, touch.position, touch.force, touch.slip)
    assert [(estimate.valid, estimate.why_not) for estimate in each] == [(False, "gap")] * 4
    assert math.isnan(touch.force.value)
    assert (touch.touched, touch.slides) == (-1, -1)


@pytest.mark.parametrize("tracked", [True, False])
def test_what_is_followed_over_time_is_preferred(*, tracked: bool) -> None:
    over_time = {"position": Estimate(value=0.09, std=1e-4, unit="m")}
    given = update(TOUCHED, tracked=Tracked(estimates=over_time), decided={"contact": True, "slip": True})
    messages = published(given, tracked=tracked)
    assert messages["touch"][0].point.x == (0.09 if tracked else 0.08)
    assert messages["slip"][0].data is tracked
    touch = messages["estimates"][0]
    assert (touch.position.value, touch.tracked_position.value) == (0.08, 0.09)
    assert (touch.touched, touch.slides) == (1, 1)
    assert not touch.tracked_force.valid


def test_a_diagnosis_has_the_worst_note_and_the_counters() -> None:
    notes = (
        Note(key="hum", level="warning", sentence="Mains hum.", remedy="Ground the frame.", since=0.0),
        Note(key="driver", level="error", sentence="A driver is silent.", remedy="Turn it on.", since=0.0),
    )
    (status,) = published(update(TOUCHED, notes=notes))["diagnostics"][0].status
    assert (status.level, status.name, status.message) == (2, "lab/left: sensor", "A driver is silent.")
    values = {pair.key: pair.value for pair in status.values}
    assert values["driver"] == "A driver is silent. Turn it on."
    assert (values["gaps"], values["dropped"], values["skipped"]) == ("1", "64", "3")
    assert values["latency median in ms"] == "2.00"


def test_an_event_is_stamped_by_its_onset() -> None:
    onset = Event(name="contact", on=True, time=0.09, delay=0.02, confidence=0.97)
    messages = published(update(TOUCHED, events=(onset,), adc_time=time.monotonic() - 0.1))
    (event,), (touch,) = messages["events"], messages["estimates"]
    assert event.kind == "contact_begins"
    assert json.loads(event.data) == {"delay": 0.02, "confidence": 0.97}
    stamps = [nanoseconds(message.header.stamp) for message in (event, touch)]
    assert stamps[1] - stamps[0] == pytest.approx(0.02e9, abs=10)  # the window ends at 0.11 s
    assert decode("monochord_msgs/msg/Event", event.serialize()).kind == "contact_begins"


def test_rosbags_decodes_the_message_of_all() -> None:
    (touch,) = published(replace(update(TOUCHED), decided={"contact": True}))["estimates"]
    message = decode("monochord_msgs/msg/Touch", touch.serialize())
    assert (message.start, message.window, message.latency) == (441, 0.1, 0.002)
    assert (message.position.value, message.position.std, message.position.valid) == (0.08, 2e-4, True)
    assert (message.touched, message.slides) == (1, -1)
    assert message.tracked_force.why_not == "not tracked"


SUBSCRIBE = """
import sys, time
from monochord.capture.dds.participant import Participant
with Participant(domain=int(sys.argv[1])) as here:
    reader = here.reader("monochord/estimates", "Touch", lambda message, now: None)
    while not reader.writers:
        time.sleep(0.01)
    print("ready", flush=True)
    time.sleep(60.0)
"""


@pytest.mark.parametrize("fate", [signal.SIGSTOP, signal.SIGKILL])
def test_a_subscriber_that_stalls_or_dies_delays_nothing(fate: signal.Signals) -> None:
    spans: list[float] = []
    with Ros2(domain=DOMAIN).open(Run(signal=SIGNAL)) as writer:
        command = [sys.executable, "-c", SUBSCRIBE, str(DOMAIN)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout
            assert process.stdout.readline() == "ready\n"
            process.send_signal(fate)
            for _ in range(300):
                begin = time.perf_counter()
                writer.write(update(TOUCHED))
                spans.append(time.perf_counter() - begin)
                time.sleep(0.002)
            process.kill()
    assert np.median(spans) < 5e-3


@pytest.mark.parametrize(
    ("options", "error", "given"),
    [
        ({"domain": 233}, InputError, "233"),
        ({"namespace": "/two words"}, InputError, "two words"),
        ({"interface": "not an interface"}, InputError, "'not an interface'"),
        ({"interface": "absent0"}, DeviceError, "'absent0'"),
    ],
)
def test_an_option_that_cannot_be_used_is_refused(
    options: dict[str, Any], error: type[Exception], given: str
) -> None:
    sink = SINKS.build("ros2", {"domain": DOMAIN, **options})
    with pytest.raises(error, match=given), sink.open(Run(signal=SIGNAL)):
        pass
