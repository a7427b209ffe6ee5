"""Runs under a Python that has rclpy: becomes the node of a launch file, as ``ros2 launch`` would start it.

There are no wheels of the packages ``launch`` and ``launch_ros``. Their place is taken by what a launch file
of one node needs: it runs as it is, the package index finds the package in the workspace, and the node's
command line is the one that ``launch_ros`` makes of its arguments. Called like ``ros2 launch``: package,
file, ``name:=value``.
"""

import os
import runpy
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any


@dataclass
class DeclareLaunchArgument:
    """An argument of the launch file, with its default."""

    name: str
    default_value: str


@dataclass
class LaunchConfiguration:
    """The value of an argument, known once the file runs."""

    name: str


@dataclass(kw_only=True)
class Node:
    """A node, and how it is started."""

    package: str
    executable: str
    namespace: LaunchConfiguration
    name: LaunchConfiguration
    parameters: list[LaunchConfiguration] = field(default_factory=list[LaunchConfiguration])
    output: str = "log"


STAND_INS: dict[str, dict[str, Any]] = {
    "launch": {"LaunchDescription": list},
    "launch.actions": {"DeclareLaunchArgument": DeclareLaunchArgument},
    "launch.substitutions": {"LaunchConfiguration": LaunchConfiguration},
    "launch_ros": {},
    "launch_ros.actions": {"Node": Node},
}


def main() -> None:
    from ament_index_python.packages import (  # pyright: ignore[reportMissingImports]
        get_package_prefix,
        get_package_share_directory,
    )

    package, file, *given = sys.argv[1:]
    for name, members in STAND_INS.items():
        sys.modules[name] = ModuleType(name)
        vars(sys.modules[name]).update(members)
    path = Path(get_package_share_directory(package)) / "launch" / file
    *arguments, node = runpy.run_path(str(path))["generate_launch_description"]()
    values = {argument.name: argument.default_value for argument in arguments}
    for word in given:
        name, value = word.split(":=", 1)
        assert name in values, f"{file} declares no argument {name}"
        values[name] = value
    executable = Path(get_package_prefix(node.package), "lib", node.package, node.executable)
    namespace = "/" + values[node.namespace.name].strip("/")
    words = ["-r", f"__node:={values[node.name.name]}", "-r", f"__ns:={namespace}"]
    words += [word for file in node.parameters for word in ("--params-file", values[file.name])]
    os.execv(executable, [str(executable), "--ros-args", *words])  # noqa: S606  (the node that was just built)


if __name__ == "__main__":
    main()
