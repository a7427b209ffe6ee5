"""The markers of two strings as rclpy receives them, drawn with matplotlib.

Makes `docs/figures/ros_markers.png` in half a minute, after ``make ros``, whose Python has rclpy and is
started: ``python -m studies.ros_scene --out docs/figures/ros_markers.png``.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies._command import draw

from monochord import Run, Update, VirtualSensor, listen
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Signal
from monochord.core.units import Metres, Seconds
from monochord.figures import style
from monochord.figures.base import Figure, require_matplotlib
from monochord.live.delivery import Delivery
from monochord.live.sinks import SINKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

DOMAIN, NAMESPACE, LINK = 79, "/hand", "finger"
READER = Path(__file__).with_name("_ros_scene.py")
SIGNAL = Signal(sample_rate=44100, channels=2)
HOP: Seconds = 0.01
FINDING: Seconds = 1.5
"""Time in which ROS finds the topics."""
LINE_STRIP, SPHERE, ARROW, TEXT = 4, 2, 0, 9
DELETE = 2
APART: Metres = 0.05
"""Distance of the strings on their link."""
ACROSS, UP = 0.55, 0.6
"""How far y leads to the right and up in the picture, and z up is 1."""
GROUND = "#303030"
WINDOWS = 400
LEFT: Mapping[int, Callable[[VirtualSensor], object]] = {
    100: lambda twin: twin.press(0.08, 0.9),
    250: lambda twin: twin.slide(1.4, along=0.02, across=0.1),
}
RIGHT: Mapping[int, Callable[[VirtualSensor], object]] = {250: lambda twin: twin.press(0.02, 0.8)}
"""What happens to each string, by the number of the window."""
POSES = {"left_string": (0.0,) * 6, "right_string": (0.0, APART, 0.0, 0.0, 0.0, 0.0)}


@dataclass(frozen=True, slots=True, kw_only=True)
class RosScene(Figure):
    """Three moments of two virtual sensors: untouched, one held, one sliding beside a withheld position.

    Parameters
    ----------
    python
        Interpreter with rclpy and visualization_msgs.
    """

    python: str = str(Path(".venv-ros", "bin", "python"))

    def draw(self) -> Canvas:
        """Send, receive and draw."""
        require_matplotlib()
        strings = {"left": _updates(1, LEFT), "right": _updates(2, RIGHT)}
        arrays = [array for array in scene(self.python, strings)["markers"] if _is_whole(array)]
        figure = style.canvas(34.0)
        titles = "untouched", "one string held", "one slides, one touched outside its range"
        for axes, title, share in zip(figure.subplots(1, 3), titles, (0.2, 0.55, 0.95), strict=True):
            _draw(axes, arrays[round(share * (len(arrays) - 1))], title)
        return figure


def scene(
    python: str, strings: Mapping[str, Sequence[Update]], environment: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Return what rclpy reads of a sink that publishes the updates of some strings, a hundred a second.

    The reader comes after the sink has begun.
    """
    if not Path(python).is_file():
        raise InputError(f"python {python} (does not exist)", "an interpreter with rclpy", "run: make ros")
    ros = {
        "ROS_DOMAIN_ID": str(DOMAIN),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    command = [python, str(READER), NAMESPACE, *(f"{NAMESPACE}/{name}" for name in strings)]
    run = Run(signal=SIGNAL, strings=dict.fromkeys(strings, SIGNAL), length=0.2)
    options = {"namespace": NAMESPACE, "domain": DOMAIN, "link": LINK, "poses": POSES}
    sink = SINKS.build("ros2", options)
    pipe, environment = subprocess.PIPE, {**(environment or os.environ), **ros}
    with (
        Delivery([sink], run, paced=True) as delivery,
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment) as process,  # noqa: S603  (the Python that the user named)  # nosec B603
    ):
        if process.stdout is None or process.stdout.readline() != "ready\n":
            process.kill()
            raise DeviceError("the reader of the scene did not start")
        time.sleep(FINDING)
        due = time.monotonic()
        for together in zip(*strings.values(), strict=True):
            for name, update in zip(strings, together, strict=True):
                delivery.hand_over(replace(update, string=name))
            due += HOP
            time.sleep(max(due - time.monotonic(), 0.0))
        return json.loads(process.communicate(timeout=30)[0])


def _updates(seed: int, moves: Mapping[int, Callable[[VirtualSensor], object]]) -> list[Update]:
    """Return the updates of a virtual sensor that is moved at some windows."""
    twin = VirtualSensor("prototype", seed=seed)

    def moved() -> Iterator[Update]:
        for number, update in enumerate(islice(listen(twin, model="demo"), WINDOWS)):
            yield update
            moves.get(number, lambda _: None)(twin)

    return list(moved())


def _is_whole(array: list[dict[str, Any]]) -> bool:
    return len({marker["frame"] for marker in array}) == len(POSES)


def _draw(axes: Axes, array: list[dict[str, Any]], title: str) -> None:
    """Draw an array of markers as received, y of the link to the back."""
    from matplotlib.patches import Ellipse  # noqa: PLC0415

    axes.set_facecolor(GROUND)
    for marker in array:
        if marker["action"] == DELETE:
            continue
        offset = POSES[marker["frame"]][1]
        colour, (x, y) = marker["colour"], _seen(marker["at"], offset)
        points = [_seen(point, offset) for point in marker["points"]]
        if marker["type"] == LINE_STRIP:
            axes.plot(*zip(*points, strict=True), color=colour, linewidth=1.8, solid_capstyle="round")
        elif marker["type"] == SPHERE:
            wide, _, high = (1e3 * each for each in marker["size"])
            axes.add_patch(Ellipse((x, y), wide, high, color=colour, linewidth=0.0, zorder=3))
        elif marker["type"] == ARROW:
            shape = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", points[1], points[0], arrowprops=shape, zorder=4)
        elif marker["type"] == TEXT:
            axes.text(x, y, marker["text"], color=colour, fontsize=style.TICK - 1.0, ha="center", va="center")
    axes.set_xlim(-12.0, 240.0)
    axes.set_ylim(-30.0, 75.0)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(title, fontsize=style.LABEL, color=style.INK, pad=4)


def _seen(point: list[float], offset: Metres) -> tuple[float, float]:
    """Return where a point of a string's frame is in the picture, in mm."""
    x, y, z = point
    return 1e3 * (x + ACROSS * (y + offset)), 1e3 * (z + UP * (y + offset))


if __name__ == "__main__":
    draw(RosScene)
