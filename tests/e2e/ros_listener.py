"""Runs under a Python that has rclpy: prints what it receives on two topics, one JSON object a line.

It ends once so many poses, wrenches and answers that somebody subscribed to have passed, or after a minute.
"""

import json
import sys
import time
from typing import Any


def main() -> None:
    import rclpy  # pyright: ignore[reportMissingImports]
    from geometry_msgs.msg import PoseStamped, WrenchStamped  # pyright: ignore[reportMissingImports]
    from rclpy.node import Node  # pyright: ignore[reportMissingImports]

    poses, wrenches, answers = map(int, sys.argv[1:])
    rclpy.init()
    node = Node("listener")
    received: list[str] = []
    counts = {"pose": 0, "wrench": 0, "answer": 0}

    def pose(message: Any) -> None:
        counts["pose"] += 1
        place, turn, stamp = message.pose.position, message.pose.orientation, message.header.stamp
        row = [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]
        received.append(
            json.dumps({"pose": row, "frame": message.header.frame_id, "stamp": [stamp.sec, stamp.nanosec]})
        )

    def wrench(message: Any) -> None:
        counts["wrench"] += 1
        force, torque = message.wrench.force, message.wrench.torque
        received.append(json.dumps({"wrench": [force.x, force.y, force.z, torque.x, torque.y, torque.z]}))

    node.create_subscription(PoseStamped, "/pose", pose, 10)
    node.create_subscription(WrenchStamped, "/wrench", wrench, 10)
    speaker = node.create_publisher(PoseStamped, "/answer", 10)
    print("ready", flush=True)  # noqa: T201
    end, count = time.monotonic() + 60.0, 0
    while time.monotonic() < end and (
        counts["pose"] < poses or counts["wrench"] < wrenches or counts["answer"] < answers
    ):
        rclpy.spin_once(node, timeout_sec=0.01)
        answer = PoseStamped()
        count += 1
        answer.header.stamp = node.get_clock().now().to_msg()
        answer.header.frame_id = "robot"
        answer.pose.position.x = float(count)
        answer.pose.orientation.w = 1.0
        speaker.publish(answer)
        counts["answer"] += speaker.get_subscription_count() > 0
    hashes = {
        info.topic_type: str(info.topic_type_hash)
        for topic in ("/pose", "/wrench")
        for info in node.get_publishers_info_by_topic(topic)
    }
    print(*received, json.dumps({"hashes": hashes}), sep="\n", flush=True)  # noqa: T201
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
