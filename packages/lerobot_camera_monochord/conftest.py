"""What needs LeRobot is collected only where that is installed."""

from importlib.util import find_spec

collect_ignore = (
    []
    if find_spec("lerobot")
    else [
        "src/lerobot_camera_monochord/config_monochord.py",
        "src/lerobot_camera_monochord/monochord.py",
    ]
)
