"""The camera: pictures of touches where LeRobot expects those of a lens."""

from typing import Any

import numpy as np
from lerobot.cameras.camera import Camera
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from numpy.typing import NDArray

from lerobot_camera_monochord.config_monochord import MonochordCameraConfig
from lerobot_camera_monochord.datagrams import PATIENCE, Receiver
from lerobot_camera_monochord.touches import Picture, names

MILLISECOND = 1e-3


class MonochordCamera(Camera):
    """Pictures (height, width, 3) of a sensor's touches over time, and their numbers.

    Attributes
    ----------
    names
        Names of the numbers in `vector`, for a robot's features: ``dict.fromkeys(camera.names, float)``.
    vector
        The numbers of the picture that was read last: float32, one each of `names`.
    """

    def __init__(self, config: MonochordCameraConfig) -> None:
        super().__init__(config)
        self.config = config
        self._receiver: Receiver | None = None
        self.names = names(config.strings)
        self.vector = np.zeros(len(self.names), np.float32)
        self._picture()  # refuses a size that cannot be

    @property
    def is_connected(self) -> bool:
        """Whether the port is open."""
        return self._receiver is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Return none: a port does not tell who will send to it."""
        return []

    def connect(self, warmup: bool = True) -> None:  # noqa: FBT001, FBT002  (LeRobot's)
        """Open the port, and wait for the first datagram.

        Raises `ConnectionError` for a port in use, `TimeoutError` where no datagram comes within a second.
        """
        if self._receiver is not None:
            raise DeviceAlreadyConnectedError(f"{self} is connected")
        self._receiver = Receiver(self._picture(), self.config.host, self.config.port)
        if warmup:
            try:
                self.async_read()
            except Exception:
                self.disconnect()
                raise

    def read(self) -> NDArray[Any]:
        """Return the next picture, waiting for it up to a second."""
        return self.async_read()

    def async_read(self, timeout_ms: float = PATIENCE / MILLISECOND) -> NDArray[Any]:
        """Return the latest picture that was not read yet, waiting for it up to `timeout_ms`.

        Raises `TimeoutError`, with the command that starts the datagrams, where none comes.
        """
        image, self.vector = self._open().next(MILLISECOND * timeout_ms)
        return image

    def read_latest(self, max_age_ms: int = round(PATIENCE / MILLISECOND)) -> NDArray[Any]:
        """Return the latest picture at once; raises `TimeoutError` for one older than `max_age_ms`."""
        image, self.vector = self._open().latest(MILLISECOND * max_age_ms)
        return image

    def disconnect(self) -> None:
        """Release the port."""
        self._open().close()
        self._receiver = None

    def __str__(self) -> str:
        return f"MonochordCamera({self.config.host}:{self.config.port})"

    def _open(self) -> Receiver:
        if self._receiver is None:
            raise DeviceNotConnectedError(f"{self} is not connected")
        return self._receiver

    def _picture(self) -> Picture:
        config = self.config
        return Picture(
            config.height or 128,
            config.width or 128,
            length=config.length,
            force=config.force,
            strings=config.strings,
        )
