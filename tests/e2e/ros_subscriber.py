"""Runs under a Python that has rclpy: prints what it receives of a live sensor as one JSON object.

It ends after so many wrenches, or a minute after it began.
"""

import json
import sys
import time
from typing import Any


def main() -> None:
    import rclpy  # pyright: ignore[reportMissingImports]
    from diagnostic_msgs.msg import DiagnosticArray  # pyright: ignore[reportMissingImports]
    from geometry_msgs.msg import PointStamped, WrenchStamped  # pyright: ignore[reportMissingImports]
    from rclpy.node import Node  # pyright: ignore[reportMissingImports]
    from std_msgs.msg import Bool  # pyright: ignore[reportMissingImports]

    count = int(sys.argv[1])
    rclpy.init()
    node = Node("subscriber")
    received: dict[str, list[Any]] = {
        name: [] for name in ("touch", "wrench", "contact", "slip", "diagnostics")
    }
    delays: list[float] = []

    def stamped(name: str, value: Any) -> Any:
        def take(message: Any) -> None:
            stamp = message.header.stamp
            delays.append(time.time() - stamp.sec - 1e-9 * stamp.nanosec)
            received[name].append([message.header.frame_id, value(message)])

        return take

    point, wrench = stamped("touch", lambda m: m.point.x), stamped("wrench", lambda m: m.wrench.force.z)
    node.create_subscription(PointStamped, "/sensor/touch", point, 10)
    node.create_subscription(WrenchStamped, "/sensor/wrench", wrench, 10)
    for name in ("contact", "slip"):
        node.create_subscription(Bool, f"/sensor/{name}", lambda m, to=received[name]: to.append(m.data), 10)
    node.create_subscription(
        DiagnosticArray,
        "/diagnostics",
        lambda m: received["diagnostics"].append([m.status[0].message, m.status[0].hardware_id]),
        10,
    )
    print("ready", flush=True)  # noqa: T201
    end = time.monotonic() + 60.0
    while time.monotonic() < end and len(received["wrench"]) < count:
        rclpy.spin_once(node, timeout_sec=0.01)
    topics = dict(node.get_topic_names_and_types())
    hashes = {
        info.topic_type: str(info.topic_type_hash)
        for topic in topics
        for info in node.get_publishers_info_by_topic(topic)
        if topic.startswith("/sensor/") or topic == "/diagnostics"
    }
    result = {"received": received, "delays": delays, "topics": topics, "hashes": hashes}
    print(json.dumps(result), flush=True)  # noqa: T201
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
