"""Takes part in a DDS domain: writers and readers of ROS 2 topics."""

import os
import re
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

from monochord.errors import DeviceError, InputError
from monochord.units import Seconds

MOST_DOMAIN = 232
DEPTH = 10  # what ROS 2 keeps of a topic
URI = "CYCLONEDDS_URI"
MOST_AT_ONCE = 256

Hear = Callable[[Any, Seconds], None]
"""Called with a message and the monotonic time at which it came, in a thread of DDS."""

_CONFIGURING = threading.Lock()


class Participant:
    """One who takes part in a domain, and with it leaves all of its writers and readers.

    Parameters
    ----------
    domain
        Number of the domain; None for ``$ROS_DOMAIN_ID``, or else 0.
    interface
        Network interface to speak over; ``lo`` keeps to this machine. ``$CYCLONEDDS_URI`` goes before it
        where it is set, and a process has one configuration for each domain: that of its first participant.

    Raises
    ------
    InputError
        If the domain is none, or there is no library to speak DDS with.
    DeviceError
        If there is no such interface.

    Examples
    --------
    >>> with Participant() as here:
    ...     here.writer("pose", "PoseStamped").listeners
    0
    """

    def __init__(self, *, domain: int | None = None, interface: str = "lo") -> None:
        self.domain = _own_domain() if domain is None else domain
        if not 0 <= self.domain <= MOST_DOMAIN:
            raise InputError(f"DDS domain {self.domain}", f"0 to {MOST_DOMAIN}")
        if not re.fullmatch(r"[\w.:-]*", interface):
            raise InputError(
                f"interface '{interface}'", "the name of a network interface, such as lo or eth0"
            )
        try:
            from cyclonedds.core import DDSException  # noqa: PLC0415
            from cyclonedds.domain import DomainParticipant  # noqa: PLC0415
        except ImportError as error:
            lacking = "DDS without the package cyclonedds"
            raise InputError(lacking, "it installed", "pip install 'monochord[ros]'") from error
        try:
            with _configured(interface):
                self._participant: Any = DomainParticipant(self.domain)
        except DDSException as error:
            raise DeviceError(
                f"DDS over '{interface}': the domain {self.domain} cannot be joined; is there such a network?"
            ) from error
        self._parts: list[Writer | Reader] = []

    def writer(self, topic: str, message: str) -> "Writer":
        """Return what writes messages of a kind of `monochord.dds.messages` to a topic of ROS 2."""
        part = Writer(self._participant, topic, message)
        self._parts.append(part)
        return part

    def reader(self, topic: str, message: str, hear: Hear) -> "Reader":
        """Return what calls `hear` with each message of a topic of ROS 2, until the participant leaves."""
        part = Reader(self._participant, topic, message, hear)
        self._parts.append(part)
        return part

    def close(self) -> None:
        """Leave the domain."""
        for part in self._parts:
            part.close()
        self._parts.clear()
        self._participant = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Writer:
    """Writes messages to a topic, reliably, as ROS 2 does unless told otherwise."""

    def __init__(self, participant: Any, topic: str, message: str) -> None:
        from cyclonedds.core import Policy, Qos  # noqa: PLC0415
        from cyclonedds.pub import DataWriter  # noqa: PLC0415

        self.message, place = _topic(participant, topic, message)
        reliable = Policy.Reliability.Reliable(max_blocking_time=100_000_000)
        told = Policy.Userdata(data=f"typehash={_hash(self.message)};".encode())
        qos = Qos(reliable, Policy.History.KeepLast(depth=DEPTH), told)
        self._writer: Any = DataWriter(participant, place, qos=qos)

    @property
    def listeners(self) -> int:
        """How many readers there are."""
        return len(self._writer.get_matched_subscriptions())

    def write(self, message: Any, nanoseconds: int) -> None:
        """Send a message, with the time since the Unix epoch at which what it says was so."""
        self._writer.write(message, nanoseconds)

    def close(self) -> None:
        """Leave the topic."""
        self._writer = None


class Reader:
    """Hears a topic: from reliable writers and from those that are not, and whatever they keep."""

    def __init__(self, participant: Any, topic: str, message: str, hear: Hear) -> None:
        from cyclonedds.core import Listener, Policy, Qos  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415

        _, place = _topic(participant, topic, message)
        qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(depth=1000))
        self._hear = hear
        self._came = 0
        self._reader: Any = DataReader(participant, place, qos=qos)
        listener: Any = Listener()
        listener.set_on_data_available(lambda _: self._take(time.monotonic()))
        listener.set_on_subscription_matched(lambda _, status: self._match(status))
        self._reader.set_listener(listener)
        self._came = max(self._came, min(self.writers, 1))  # one may have been met before it listened

    @property
    def writers(self) -> int:
        """How many writers there are."""
        return len(self._reader.get_matched_publications())

    @property
    def returns(self) -> int:
        """How often a writer came after all had gone."""
        return max(0, self._came - 1)

    def close(self) -> None:
        """Leave the topic; when this returns, nothing more is heard."""
        self._reader.set_listener(None)
        self._reader = None

    def _match(self, status: Any) -> None:
        if status.current_count == 1 and status.current_count_change > 0:
            self._came += 1

    def _take(self, now: Seconds) -> None:
        reader = self._reader
        while reader:
            messages = reader.take(MOST_AT_ONCE)
            for message in messages:
                if getattr(message.sample_info, "valid_data", False):
                    self._hear(message, now)
            if len(messages) < MOST_AT_ONCE:
                return


def _topic(participant: Any, topic: str, message: str) -> tuple[type[Any], Any]:
    from cyclonedds.topic import Topic  # noqa: PLC0415

    from monochord.dds import messages  # noqa: PLC0415

    kind: type[Any] = getattr(messages, message)
    if not all(part.replace("_", "a").isalnum() for part in topic.strip("/").split("/")):
        raise InputError(f"topic '{topic}'", "letters, digits and _, parted by /")
    return kind, Topic(participant, "rt/" + topic.strip("/"), kind)


def _hash(message: type[Any]) -> str:
    from monochord.dds.messages import TYPE_HASHES, ros_name  # noqa: PLC0415

    return TYPE_HASHES[ros_name(message)]


def _own_domain() -> int:
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal():
        raise InputError(f"ROS_DOMAIN_ID '{text}'", f"0 to {MOST_DOMAIN}")
    return int(text)


@contextmanager
def _configured(interface: str) -> Generator[None]:
    """Hand over the configuration by the environment: so the domain ends with its last participant."""
    alone = interface == "lo"
    discovery = (
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>"
        '<Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
        if alone
        else ""
    )
    multicast = "<AllowMulticast>false</AllowMulticast>" if alone else ""
    card = f'<Interfaces><NetworkInterface name="{interface}"/></Interfaces>' if interface else ""
    quiet = "<Tracing><Verbosity>none</Verbosity></Tracing>"
    with _CONFIGURING:
        if os.environ.get(URI):
            yield
            return
        os.environ[URI] = (
            f"<CycloneDDS><Domain><General>{card}{multicast}</General>{discovery}{quiet}</Domain></CycloneDDS>"
        )
        try:
            yield
        finally:
            del os.environ[URI]
