"""The node: starts ``monochord live`` with its parameters, and ends with it.

The sensor publishes over DDS by itself, below this node's name: ``~/touch``, ``~/wrench``, ``~/contact``,
``~/slip``, ``~/estimates``, ``~/events`` and ``~/markers``, and ``/diagnostics`` and ``/tf_static``. They are
topics of the node ``NAME_strings``. Monochord may be in a Python environment of its own.
"""

import shlex
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from typing import Any

PARAMETERS: Mapping[str, Any] = {
    "executable": "monochord",
    "model": "demo",
    "source": "jack",
    "input": "",
    "sensor": "",
    "frame_id": "string",
    "tracked": True,
    "interface": "lo",
    "settings": [""],
    "sinks": [""],
}
"""Parameters with their defaults; `config/sensor.yaml` describes them."""
ENDING = 8.0
"""Seconds that the sensor may take to end; `ros2 launch` kills the node 10 s after it asks it to end."""


def command(parameters: Mapping[str, Any], name: str) -> list[str]:
    """Return the command line of a sensor that publishes below a node's full name.

    >>> " ".join(command({**PARAMETERS, "source": "twin"}, "/lab/sensor")[:6])
    'monochord live demo --source twin --sink'
    """
    words = [*shlex.split(parameters["executable"]), "live"]
    words += [parameters[key] for key in ("model", "input") if parameters[key]]
    words += ["--source", parameters["source"], "--sink", f"ros2={name}"]
    words += [word for sink in parameters["sinks"] if sink for word in ("--sink", sink)]
    if parameters["sensor"]:
        words += ["--sensor", parameters["sensor"]]
    own = {
        "frame": parameters["frame_id"],
        "interface": parameters["interface"],
        "tracked": str(parameters["tracked"]).lower(),
        "node": f"{name}_strings",  # beside this one, which is of another process
    }
    settings = [
        *(f"sinks.ros2.{key}={value}" for key, value in own.items()),
        *filter(None, parameters["settings"]),
    ]
    return [*words, *(word for setting in settings for word in ("--set", setting))]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the node until the sensor ends or the node is shut down; exits with the sensor's status."""
    import rclpy  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    from rclpy.executors import ExternalShutdownException  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    from rclpy.node import Node  # pyright: ignore[reportMissingImports]  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # pyright: ignore[reportMissingImports]  # noqa: PLC0415

    # Else a signal ends what logs, before the sensor's summary.
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    # Signals end the sensor once, however many: `ros2 launch` adds SIGTERM where SIGINT takes more than 5 s.
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    node: Any = Node("sensor")
    values = {name: node.declare_parameter(name, value).value for name, value in PARAMETERS.items()}
    words = command(values, node.get_fully_qualified_name())
    node.get_logger().info(shlex.join(words))
    # A session of its own: Control-C in a terminal reaches the node alone, which ends the sensor once.
    try:
        process = subprocess.Popen(  # noqa: S603  (the person's own parameters)
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    except OSError as error:
        allowed = "a command, or its path where Monochord is in an environment of its own"
        node.get_logger().fatal(f"executable '{words[0]}' ({error.strerror}): expected {allowed}")
        sys.exit(1)
    reader = threading.Thread(target=_log, args=(process, node.get_logger()), daemon=True)
    reader.start()
    try:
        while process.poll() is None and not stop.is_set():
            rclpy.spin_once(node, timeout_sec=0.1)
    except ExternalShutdownException:
        pass
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
    reader.join(1.0)
    node.destroy_node()
    rclpy.try_shutdown()
    sys.exit(process.wait())


def _log(process: "subprocess.Popen[bytes]", logger: Any) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        logger.info(line.decode(errors="replace").rstrip())


if __name__ == "__main__":
    main()
