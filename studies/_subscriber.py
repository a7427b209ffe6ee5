"""Receives the wrenches of a namespace, and prints their delays in s as a list once its input ends.

It runs as a script under a Python with rclpy, which need not have Monochord, or under Monochord's Python.
"""

import json
import sys
import threading
import time
from typing import Any

TOPIC = f"/{sys.argv[-1]}/wrench"


def main() -> None:
    """Subscribe until the input ends."""
    delays: list[float] = []
    ended = threading.Event()

    def take(message: Any) -> None:
        stamp = message.header.stamp
        delays.append(time.time() - stamp.sec - 1e-9 * stamp.nanosec)

    def follow() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=follow, daemon=True).start()
    try:
        import rclpy  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    except ImportError:
        _without_ros(take, ended)
    else:
        from geometry_msgs.msg import (  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
            WrenchStamped,
        )
        from rclpy.node import Node  # pyright: ignore[reportMissingImports]  # noqa: PLC0415

        rclpy.init()
        node = Node("subscriber")
        node.create_subscription(WrenchStamped, TOPIC, take, 10)
        _say("ready")
        while not ended.is_set():
            rclpy.spin_once(node, timeout_sec=0.1)
    _say(json.dumps(delays))


def _without_ros(take: Any, ended: threading.Event) -> None:
    from monochord.capture.dds.participant import Participant  # noqa: PLC0415

    with Participant() as here:
        here.reader(TOPIC, "WrenchStamped", lambda message, _: take(message))
        _say("ready")
        ended.wait()


def _say(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    main()
