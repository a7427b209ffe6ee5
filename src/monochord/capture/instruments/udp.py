"""Any numbers as JSON datagrams: a thermometer, a motor's current, a force sensor of another make."""

import math
import re
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType

from monochord.capture.instruments._address import listening
from monochord.capture.instruments._json_feed import JsonConnection, Stamped
from monochord.capture.instruments.base import Instrument
from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Feed
from monochord.core.units import Hertz

LARGEST = 1e18
"""A value beyond it is nonsense: nothing that is measured is so large in SI units."""
KNOWN = MappingProxyType({"wrench": WRENCH, "pose": POSE})


@dataclass(frozen=True, slots=True, kw_only=True)
class Udp(Instrument):
    """Named numbers sent to `address`, each datagram a JSON object.

    A datagram is ``{"stamp": 1.5, "sequence": 7, "values": {"temperature": 293.1}}``: seconds of the
    sender's clock, its count, and values by column; stamp and sequence may be left out. A column that is
    left out is not known (NaN), a name that is no column is passed over, of a name that comes twice the last
    counts. What cannot be read counts as faulty, and so does a value beyond 1e18.

    Parameters
    ----------
    address
        Where to listen: ``HOST:PORT``, or ``PORT`` for this machine alone.
    stream
        Name of the stream in a session: small letters, digits and ``_``.
    columns
        Names of the values.
    units
        Their units in SI, one each; none where nothing is said of them.
    rate
        Readings a second that are due; 0 where that is not known.
    """

    address: str = "127.0.0.1:9872"
    stream: str = "numbers"
    columns: tuple[str, ...] = ("value",)
    units: tuple[str, ...] = ()
    rate: Hertz = 0.0

    @contextmanager
    def open(self) -> Generator["JsonConnection[_Numbers]"]:
        """Listen; raises `DeviceError` if the port is taken. That nobody sends is no error."""
        feed = self._feed()
        with listening(self.address) as sock:
            yield JsonConnection(sock, feed, _Numbers, self._values)

    def _values(self, said: "_Numbers") -> tuple[float, ...] | None:
        values = tuple(said.values.get(column, math.nan) for column in self.columns)
        return None if any(abs(value) > LARGEST for value in values) else values

    def _feed(self) -> Feed:
        if not re.fullmatch(r"[a-z][a-z0-9_]*", self.stream):
            raise InputError(f"stream '{self.stream}'", "small letters, digits and _, a letter first")
        columns = self.columns
        if not columns or not all(columns) or len(set(columns)) < len(columns):
            raise InputError(f"columns {', '.join(columns) or 'none'}", "one name or more, all different")
        if self.stream in KNOWN and columns != KNOWN[self.stream]:
            raise InputError(f"columns of the stream '{self.stream}'", ", ".join(KNOWN[self.stream]))
        if self.units and len(self.units) != len(columns):
            raise InputError(f"{len(self.units)} units for {len(columns)} columns", "one each, or none")
        if not 0.0 <= self.rate <= 100e3:
            raise InputError(f"rate of {self.rate} Hz", "0 to 100000 Hz, 0 where it is not known")
        return Feed(
            stream=self.stream,
            columns=columns,
            units=self.units or ("",) * len(columns),
            rate=self.rate,
            ticks=1e9,
            details=MappingProxyType({"address": self.address}),
        )


class _Numbers(Stamped, kw_only=True):
    values: dict[str, float]
