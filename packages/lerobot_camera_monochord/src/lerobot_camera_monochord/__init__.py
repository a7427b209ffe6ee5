"""Touches of a Monochord sensor in LeRobot: a picture of places over time, and numbers.

LeRobot imports this package by its name, and then knows cameras of the type ``monochord``. The touches come
as datagrams of ``monochord live --sink udp``, so that LeRobot's environment needs no Monochord.

Without LeRobot, the modules `touches` and `datagrams` can be used alone.
"""

from importlib.util import find_spec

if find_spec("lerobot"):
    from lerobot_camera_monochord.config_monochord import MonochordCameraConfig
    from lerobot_camera_monochord.monochord import MonochordCamera

    __all__ = ["MonochordCamera", "MonochordCameraConfig"]
