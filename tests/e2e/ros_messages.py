"""Runs under a Python that has rclpy and Monochord's messages: prints what a live sensor publishes, as JSON.

It ends after so many estimates with an event or more, or a minute after it began.
"""

import json
import sys
import time
from typing import Any


def main() -> None:
    import rclpy  # pyright: ignore[reportMissingImports]
    from monochord_msgs.msg import Event, Touch  # pyright: ignore[reportMissingImports]
    from rclpy.node import Node  # pyright: ignore[reportMissingImports]

    place, count = sys.argv[1], int(sys.argv[2])
    rclpy.init()
    node = Node("messages")
    touches: list[Any] = []
    events: list[Any] = []

    def touch(message: Any) -> None:
        stamp = message.header.stamp
        estimates = {
            name: [getattr(message, name).value, getattr(message, name).std, getattr(message, name).valid]
            for name in ("contact", "position", "force", "slip", "tracked_position", "tracked_force")
        }
        decided = {Touch.YES: True, Touch.NO: False, Touch.UNKNOWN: None}
        touches.append(
            {
                "frame": message.header.frame_id,
                "stamp": stamp.sec + 1e-9 * stamp.nanosec,
                "start": message.start,
                "window": message.window,
                "touched": decided[message.touched],
                "why_not": message.position.why_not,
                **estimates,
            }
        )

    def event(message: Any) -> None:
        stamp = message.header.stamp
        events.append([message.kind, stamp.sec + 1e-9 * stamp.nanosec, json.loads(message.data)])

    node.create_subscription(Touch, f"{place}/estimates", touch, 10)
    node.create_subscription(Event, f"{place}/events", event, 10)
    print("ready", flush=True)  # noqa: T201
    end = time.monotonic() + 60.0
    while time.monotonic() < end and (len(touches) < count or not events):
        rclpy.spin_once(node, timeout_sec=0.01)
    print(json.dumps({"touches": touches, "events": events}), flush=True)  # noqa: T201
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
