"""What is on its way to the disk: a queue with room for so many bytes."""

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Inbox(Generic[T]):
    """Takes batches from many threads for one that writes them.

    Whoever finds it full waits; nothing is dropped. One batch is taken however large it is, if there is no
    other.

    >>> inbox = Inbox[str](room=100)
    >>> inbox.put("batch", size=60), inbox.take(), inbox.take()
    (True, ['batch'], [])
    """

    def __init__(self, room: int) -> None:
        self._room = room
        self._items: list[T] = []
        self._size = 0
        self._closed = False
        self._changed = threading.Condition()

    @property
    def filled(self) -> float:
        """Share of the room that is taken."""
        return self._size / self._room

    def put(self, item: T, size: int) -> bool:
        """Add a batch of `size` bytes, waiting for room; false where the inbox was closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or not self._size or self._size + size <= self._room)
            if self._closed:
                return False
            self._items.append(item)
            self._size += size
            return True

    def take(self) -> list[T]:
        """Return all that waits, oldest first, without waiting."""
        with self._changed:
            items, self._items, self._size = self._items, [], 0
            self._changed.notify_all()
            return items

    def close(self) -> None:
        """Let go of those who wait, and take nothing any more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
