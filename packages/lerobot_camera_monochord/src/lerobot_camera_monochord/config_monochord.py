"""Configuration of the camera, as LeRobot's command line takes it: ``{type: monochord, port: 9880}``."""

from dataclasses import dataclass, field

from lerobot.cameras.configs import CameraConfig


@CameraConfig.register_subclass("monochord")
@dataclass(kw_only=True)
class MonochordCameraConfig(CameraConfig):
    """A picture of a sensor's touches, or of several strings' below one another.

    Attributes
    ----------
    port, host
        UDP address to which the sink sends; 0.0.0.0 receives from other machines too.
    strings
        Names of the strings, for a run with several; empty for one.
    length
        Length of a string in m, which is the height of its part of the picture.
    force
        Force in N that is shown brightest.
    width, height
        Size of the picture. A column is one datagram, 10 ms by default.
    fps
        Pictures per second; LeRobot does not look at it.
    """

    port: int = 9880
    host: str = "127.0.0.1"
    strings: list[str] = field(default_factory=list)
    length: float = 0.2
    force: float = 2.0
    width: int | None = 128
    height: int | None = 128
    fps: int | None = 30
