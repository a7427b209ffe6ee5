"""The contract of an export: frozen options, and one method that writes sessions in another form."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from monochord.sessions import Session


class Export(ABC):
    """Options of an export, as a frozen keyword-only dataclass."""

    @abstractmethod
    def write(self, sessions: Sequence[Session], out: Path) -> list[Path]:
        """Write sessions below the folder `out`, which is made, and return what was written.

        Raises `InputError` where `out` holds something already or a session lacks what the form needs.
        """
