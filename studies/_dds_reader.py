"""Takes every message of the topics of a namespace by reliable delivery, and prints their number at the end.

It runs as a script, so that its processor time is not that of the sink: domain, then namespaces.
"""

import sys
import threading
from typing import Any

from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from monochord.capture.dds.messages import message_type
from monochord.capture.dds.participant import Participant

TOPICS = {
    "touch": "geometry_msgs/msg/PointStamped",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "contact": "std_msgs/msg/Bool",
    "slip": "std_msgs/msg/Bool",
    "estimates": "monochord_msgs/msg/Touch",
    "events": "monochord_msgs/msg/Event",
    "markers": "visualization_msgs/msg/MarkerArray",
}


def main() -> None:
    """Take messages until the input ends."""
    domain, places = int(sys.argv[1]), sys.argv[2:]
    counts = dict.fromkeys(TOPICS, 0)
    qos = Qos(Policy.Reliability.Reliable(max_blocking_time=0), Policy.History.KeepLast(depth=10))
    with Participant(domain=domain):  # sets the configuration of the process
        here = DomainParticipant(domain)
        readers: list[Any] = []

        def reader(place: str, topic: str, kind: str) -> None:
            of = Topic(here, f"rt/{place.strip('/')}/{topic}", message_type(kind))
            taken = DataReader(here, of, qos=qos)
            listener: Any = Listener()

            def take(_: Any) -> None:
                counts[topic] += len(taken.take(100))

            listener.set_on_data_available(take)
            taken.set_listener(listener)
            readers.append(taken)

        for place in places:
            for topic, kind in TOPICS.items():
                reader(place, topic, kind)
        print("ready", flush=True)
        ended = threading.Event()
        threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
        ended.wait()
        for taken in readers:
            taken.set_listener(None)
        print(min(counts[topic] for topic in ("touch", "wrench", "contact", "slip", "estimates")), flush=True)


if __name__ == "__main__":
    main()
