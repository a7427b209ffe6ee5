"""A skin's file as settings of a live run."""

from pathlib import Path

from monochord.core.config import Tree, to_tree
from monochord.skin import load_skin
from monochord.skin.urdf import pose_of

ROS = "ros2"
FRAME = "string"
"""Frame of that sink, after each string's name, where none is set."""


def with_skin(tree: Tree, file: Path) -> Tree:
    """Return settings with a skin's strings; the sink `ros2` gets their link and poses where it has none.

    Raises `InputError` for a file that is no skin.
    """
    skin, sinks = load_skin(file), dict(tree.get("sinks", {}))
    if isinstance(given := sinks.get(ROS), dict):
        frame = given.get("frame", FRAME)
        poses = {f"{name}_{frame}": [*pose_of(string)] for name, string in skin.strings.items()}
        sinks[ROS] = {"link": skin.link, "poses": poses} | given
    return tree | {"strings": to_tree(skin.settings), "sinks": sinks}
