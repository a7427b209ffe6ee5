"""What a page can ask for beside touches: recordings and guided steps, as whoever runs it registers them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

from monochord.core.types import Signal
from monochord.core.units import Metres, Newtons
from monochord.live.update import Update

Act: TypeAlias = Literal["announce", "undo", "skip"]
"""What a person may do with a touch beside giving its position and force."""


class Tasks(ABC):
    """The commands of a page, for one string of a run; each returns whether it had an effect.

    Updates come in the sink's thread, commands in the server's.
    """

    @abstractmethod
    def record(self, *, on: bool) -> bool:
        """Start or end a recording."""

    @abstractmethod
    def tune(self) -> bool:
        """Start a tuning."""

    @abstractmethod
    def calibrate(self, count: int) -> bool:
        """Start a calibration with a number of touches."""

    @abstractmethod
    def label(self, count: int) -> bool:
        """Start to record a number of labelled touches."""

    @abstractmethod
    def hold(self, position: Metres, force: Newtons) -> bool:
        """Give the present touch's position and force."""

    @abstractmethod
    def touch(self, act: Act) -> bool:
        """Announce, undo or skip a touch."""

    @abstractmethod
    def cancel(self) -> bool:
        """End a guided step."""

    @abstractmethod
    def take(self, update: Update) -> None:
        """Add an update of the run."""

    @abstractmethod
    def state(self) -> Mapping[str, Any]:
        """Return what the page shows of them, which says why a command had no effect."""

    @abstractmethod
    def close(self) -> None:
        """Complete what is under way; nothing new starts."""


MakeTasks: TypeAlias = Callable[[Signal, Metres, Path, str, Mapping[str, Any]], Tasks]
"""Makes a string's tasks.

From its signal, its length in m, the folder of their files, the model that they adapt (empty for none), and
options of a session's `Description`.
"""
