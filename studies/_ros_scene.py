"""Runs under a Python with rclpy: prints what it reads of a sensor's scene as one JSON object.

These are the nodes with their topics, the hashes of types, wrenches and points by stamp, all arrays of
markers, and, where the Python has tf2_msgs, the latched frames. It begins with the line ``ready`` and ends
once its input ends. Its arguments are the namespace of the markers, then those of the strings.
"""

import json
import sys
import threading
from typing import Any


def main() -> None:
    """Read until the input ends."""
    import rclpy  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    from geometry_msgs.msg import (  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
        PointStamped,
        WrenchStamped,
    )
    from rclpy.node import Node  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    from visualization_msgs.msg import MarkerArray  # pyright: ignore[reportMissingImports]  # noqa: PLC0415

    shown, *places = sys.argv[1:]
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    rclpy.init()
    node = Node("scene")
    read: dict[str, list[Any]] = {"wrenches": [], "touches": [], "markers": [], "frames": []}

    def wrench(message: Any) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        numbers = [force.x, force.y, force.z, torque.x, torque.y, torque.z]
        read["wrenches"].append([message.header.frame_id, _time(message), *numbers])

    def touch(message: Any) -> None:
        read["touches"].append([message.header.frame_id, _time(message), message.point.x])

    for place in places:
        node.create_subscription(WrenchStamped, f"{place}/wrench", wrench, 100)
        node.create_subscription(PointStamped, f"{place}/touch", touch, 100)
    node.create_subscription(
        MarkerArray,
        f"{shown}/markers",
        lambda message: read["markers"].append([_marker(each) for each in message.markers]),
        10,
    )
    _follow_frames(node, read["frames"])
    print("ready", flush=True)
    while not ended.is_set():
        rclpy.spin_once(node, timeout_sec=0.05)
    nodes = {
        f"{place.rstrip('/')}/{name}": dict(node.get_publisher_names_and_types_by_node(name, place))
        for name, place in node.get_node_names_and_namespaces()
    }
    hashes = {
        info.topic_type: str(info.topic_type_hash)
        for topic in (f"{shown}/markers", "/tf_static")
        for info in node.get_publishers_info_by_topic(topic)
    }
    print(json.dumps({**read, "nodes": nodes, "hashes": hashes}), flush=True)
    node.destroy_node()
    rclpy.shutdown()


def _follow_frames(node: Any, frames: list[Any]) -> None:
    """Read the latched frames, where the messages of tf2 are installed."""
    try:
        from tf2_msgs.msg import TFMessage  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    except ImportError:
        return
    from rclpy.qos import DurabilityPolicy, QoSProfile  # pyright: ignore[reportMissingImports]  # noqa: PLC0415

    def take(message: Any) -> None:
        for each in message.transforms:
            at, turn = each.transform.translation, each.transform.rotation
            numbers = [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w]
            frames.append([each.header.frame_id, each.child_frame_id, numbers])

    late = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(TFMessage, "/tf_static", take, late)


def _marker(each: Any) -> dict[str, Any]:
    place, size, colour = each.pose.position, each.scale, each.color
    return {
        "frame": each.header.frame_id,
        "number": each.id,
        "type": each.type,
        "action": each.action,
        "time": _time(each),
        "at": [place.x, place.y, place.z],
        "size": [size.x, size.y, size.z],
        "colour": [colour.r, colour.g, colour.b, colour.a],
        "points": [[point.x, point.y, point.z] for point in each.points],
        "text": each.text,
    }


def _time(message: Any) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


if __name__ == "__main__":
    main()
