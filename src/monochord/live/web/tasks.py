"""What a page can ask for beside touches: recordings and guided steps, as whoever runs it registers them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.update import Update
from monochord.page.commands import Handlers


class Tasks(ABC):
    """The tasks of a page, for one string of a run.

    Updates come in the sink's thread, commands in the server's.
    """

    @property
    @abstractmethod
    def commands(self) -> Handlers:
        """What a page can ask, by type of request."""

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
