"""Installs the node, its launch file and its parameters."""

from setuptools import setup

NAME = "monochord_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/sensor.launch.py"]),
        (f"share/{NAME}/config", ["config/sensor.yaml", "config/strings.rviz"]),
    ],
    install_requires=["setuptools"],
    description="Runs a Monochord sensor as a node with parameters and a launch file.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"sensor = {NAME}.sensor:main"]},
)
