"""Starts a sensor: ``ros2 launch monochord_ros sensor.launch.py namespace:=left params_file:=my.yaml``."""

from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory  # pyright: ignore[reportMissingImports]
from launch import LaunchDescription  # pyright: ignore[reportAttributeAccessIssue]
from launch.actions import DeclareLaunchArgument  # pyright: ignore[reportMissingImports]
from launch.substitutions import LaunchConfiguration  # pyright: ignore[reportMissingImports]
from launch_ros.actions import Node  # pyright: ignore[reportMissingImports]


def generate_launch_description() -> Any:
    """Return one node, whose namespace, name and file of parameters are arguments."""
    usual = Path(get_package_share_directory("monochord_ros")) / "config" / "sensor.yaml"
    arguments = {"namespace": "", "name": "sensor", "params_file": str(usual)}
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=value) for name, value in arguments.items()),
            Node(
                package="monochord_ros",
                executable="sensor",
                namespace=LaunchConfiguration("namespace"),
                name=LaunchConfiguration("name"),
                parameters=[LaunchConfiguration("params_file")],
                output="screen",
            ),
        ]
    )
