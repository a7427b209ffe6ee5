"""Checksums of a topic's messages, one that depends on their order and one that does not."""

import hashlib
import struct

_TIMES = struct.Struct("<QQI")


class Digest:
    """SHA-256 of the messages of a topic.

    `ordered` hashes all messages in file order. `total` is the sum, modulo 2^256, of each message's hash: it
    stays the same when another program sorts the messages.

    >>> first, second = Digest(), Digest()
    >>> first.add(1, 1, 0, b"a"), first.add(2, 2, 0, b"b")
    (None, None)
    >>> second.add(2, 2, 0, b"b"), second.add(1, 1, 0, b"a")
    (None, None)
    >>> first.ordered == second.ordered, first.total == second.total
    (False, True)
    """

    def __init__(self) -> None:
        self.count = 0
        self._ordered, self._total = hashlib.sha256(), 0

    @property
    def ordered(self) -> str:
        """`ordered` as hexadecimal digits."""
        return self._ordered.hexdigest()

    @property
    def total(self) -> str:
        """`total` as hexadecimal digits."""
        return f"{self._total:064x}"

    def add(self, log_time: int, publish_time: int, sequence: int, data: bytes | memoryview) -> None:
        """Add a message: its times in ns, its sequence number, its payload."""
        head = _TIMES.pack(log_time, publish_time, sequence)
        each = hashlib.sha256(head)
        for part in (head, data):
            self._ordered.update(part)
        each.update(data)
        self._total = (self._total + int.from_bytes(each.digest(), "little")) % (1 << 256)
        self.count += 1
