"""What is closed as its context is left."""

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self


class Closing(ABC):
    """Something open that `close` ends; as a context it yields itself, and is closed as that is left."""

    @abstractmethod
    def close(self) -> None:
        """Release everything; what is closed already stays so."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
