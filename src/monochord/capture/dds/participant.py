"""Joins a DDS domain, with writers and readers of ROS 2 topics."""

import ctypes
import os
import re
import socket
import struct
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from monochord.core.closing import Closing
from monochord.core.errors import DeviceError, InputError, required
from monochord.core.units import Seconds
from monochord.sessions.codec import typestore

__all__ = ["OnMessage", "Participant", "TopicReader", "TopicWriter"]

MAX_DOMAIN = 232
DEPTH = 10  # what ROS 2 keeps of a topic
URI = "CYCLONEDDS_URI"
FIRST_PORT, PORTS = 7400, 250
"""A domain's UDP ports by the DDSI standard: 250 ports starting at 7400 + 250 times the domain number."""
ATTACH_FILTER = 26  # SO_ATTACH_FILTER of asm-generic/socket.h, which Python does not name
MAX_SAMPLE_SIZE = "1 MiB"
"""Largest message that is assembled, in bytes, so that no message fills the memory."""
LINGER = "100 ms"
"""How long closing a writer waits for readers to confirm its last messages.

A killed reader never confirms, and a sensor has seven writers.
"""

NODES = "ros_discovery_info"
"""DDS topic on which each participant of ROS 2 lists its nodes with their writers and readers."""
ENCLAVE = b"enclave=/;"
"""User data by which ROS 2 takes a participant for one of its own: the enclave of its security."""

FAST_DDS = "1.15"
"""Vendor whose type descriptions are ignored.

Its sequence types lack flags that the standard requires (DDS-XTypes 1.3, 7.3.4), so a writer of such messages
would wait forever for a valid description.
"""

OnMessage = Callable[[Any, Seconds], None]
"""Called with a message and its monotonic time of arrival, in a DDS thread."""

_CONFIGURING = threading.Lock()


class Participant(Closing):
    """A participant of a domain; its writers and readers end with it.

    Parameters
    ----------
    domain
        Number of the domain; None for ``$ROS_DOMAIN_ID``, or else 0.
    interface
        Network interface; ``lo`` is this machine alone, empty lets the library choose. ``$CYCLONEDDS_URI``
        takes precedence where it is set, and a process has one configuration for each domain: that of its
        first participant. CycloneDDS binds its sockets to the wildcard address (``ss`` shows ``0.0.0.0``);
        the kernel drops packets that did not arrive over the interface or from this machine. Malformed
        packets are not logged, unless the URI enables it (``Tracing/Verbosity``).

    Raises
    ------
    InputError
        If the domain is invalid, or the DDS library is missing.
    DeviceError
        If the interface does not exist.

    Examples
    --------
    >>> with Participant() as here:
    ...     here.writer("pose", "PoseStamped").listeners
    0
    """

    def __init__(self, *, domain: int | None = None, interface: str = "lo") -> None:
        self.domain = _own_domain() if domain is None else domain
        if not 0 <= self.domain <= MAX_DOMAIN:
            raise InputError(f"DDS domain {self.domain}", f"0 to {MAX_DOMAIN}")
        if not re.fullmatch(r"[\w.:-]*", interface):
            raise InputError(
                f"interface '{interface}'", "the name of a network interface, such as lo or eth0"
            )
        with required("DDS", "cyclonedds >= 11.0", "ros"):
            from cyclonedds.core import DDSException, Policy, Qos  # noqa: PLC0415
            from cyclonedds.domain import DomainParticipant  # noqa: PLC0415
            from cyclonedds.internal import load_cyclonedds  # noqa: PLC0415
        # Its Tracing/Verbosity "none" still writes a line to stderr for each malformed packet.
        load_cyclonedds().dds_set_log_mask(0)
        try:
            with _configured(interface) as configured:
                others = _sockets()
                self._participant: Any = DomainParticipant(self.domain, Qos(Policy.Userdata(data=ENCLAVE)))
                if configured and interface:
                    _keep_to(interface, self.domain, _sockets() - others)
        except (DDSException, OSError) as error:
            question = (
                "check the interface name and the network" if not os.environ.get(URI) else f"is ${URI} right?"
            )
            line = f"DDS over '{interface}': the domain {self.domain} cannot be joined; {question}"
            raise DeviceError(line) from error
        self._parts: list[TopicWriter | TopicReader] = []
        self._nodes: Any = None

    def writer(self, topic: str, message: str, *, latched: bool = False) -> "TopicWriter":
        """Return a writer to a ROS 2 topic, for a message type of `monochord.capture.dds.messages`.

        A `latched` topic also gives its last message to readers that come later ("transient local").
        """
        part = TopicWriter(self._participant, topic, message, latched=latched)
        self._parts.append(part)
        return part

    def reader(self, topic: str, message: str, on_message: OnMessage) -> "TopicReader":
        """Return a reader that calls `on_message` with each message of a ROS 2 topic."""
        part = TopicReader(self._participant, topic, message, on_message)
        self._parts.append(part)
        return part

    def announce(self, node: str) -> None:
        """Show a node, by its full name, that has all writers and readers made so far.

        ``ros2 node list`` and ``ros2 node info`` then know it.

        >>> with Participant() as here:
        ...     here.announce("/lab/left")
        """
        from monochord.capture.dds import messages  # noqa: PLC0415

        place, _, name = ("/" + node.strip("/")).rpartition("/")
        entities = messages.NodeEntitiesInfo(
            node_namespace=place or "/",
            node_name=name,
            reader_gid_seq=[part.identity for part in self._parts if isinstance(part, TopicReader)],
            writer_gid_seq=[part.identity for part in self._parts if isinstance(part, TopicWriter)],
        )
        info = messages.ParticipantEntitiesInfo(
            gid=_identity(self._participant), node_entities_info_seq=[entities]
        )
        self._nodes = _node_writer(self._participant)
        self._nodes.write(info)

    def close(self) -> None:
        """Leave the domain."""
        for part in self._parts:
            part.close()
        self._parts.clear()
        self._nodes = None
        self._participant = None


class TopicWriter:
    """Writes messages to a topic with reliable delivery, the ROS 2 default.

    `name` is the ROS 2 name of their type; `is_read` tells whether a message would reach anybody, now or
    later.
    """

    def __init__(self, participant: Any, topic: str, message: str, *, latched: bool = False) -> None:
        from cyclonedds.core import Listener, Policy, Qos  # noqa: PLC0415
        from cyclonedds.pub import DataWriter  # noqa: PLC0415

        from monochord.capture.dds.messages import ros_name  # noqa: PLC0415

        self.message, place = _topic(participant, topic, message)
        self.name = ros_name(self.message)
        user_data = Policy.Userdata(data=f"typehash={_hash(self.message)};".encode())
        qos = Qos(*_delivery(latched=latched), user_data)
        self._latched = self.is_read = latched
        listener: Any = Listener()
        listener.set_on_publication_matched(lambda _, status: self._match(status))
        self._writer: Any = DataWriter(participant, place, qos=qos, listener=listener)
        # To serialize a message, the library walks through its type at each call. Here the bytes are made
        # before, and this message hands them over.
        self._encoded: Any = object.__new__(self.message)

    @property
    def listeners(self) -> int:
        """Number of readers."""
        return len(self._writer.get_matched_subscriptions())

    @property
    def identity(self) -> Any:
        """The writer's global identity, as ROS 2 lists it."""
        return _identity(self._writer)

    def write(self, message: Any, nanoseconds: int) -> None:
        """Send a message, with its source time since the Unix epoch."""
        self._writer.write(message, nanoseconds)

    def send(self, data: bytes, nanoseconds: int) -> None:
        """Send a message as CDR bytes with their encapsulation header; see `monochord.sessions.codec`.

        This takes a fifth of the time of `write`.
        """
        self._encoded.serialize = lambda **_: data
        self._writer.write(self._encoded, nanoseconds)

    def close(self) -> None:
        """Close the writer."""
        self._writer.set_listener(None)
        self._writer = None

    def _match(self, status: Any) -> None:
        self.is_read = self._latched or status.current_count > 0


class TopicReader:
    """Reads a topic, from both reliable and best-effort writers.

    `faulty` counts the messages that could not be decoded.
    """

    def __init__(self, participant: Any, topic: str, message: str, on_message: OnMessage) -> None:
        from cyclonedds.core import Listener, Policy, Qos  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415

        _, place = _topic(participant, topic, message)
        qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(depth=1000))
        self._on_message = on_message
        self._arrivals = 0
        self.faulty = 0
        self._reader: Any = DataReader(participant, place, qos=qos)
        listener: Any = Listener()
        listener.set_on_data_available(lambda _: self._take(time.monotonic()))
        listener.set_on_subscription_matched(lambda _, status: self._match(status))
        self._reader.set_listener(listener)
        # A writer may have matched before the listener was set.
        self._arrivals = max(self._arrivals, min(self.writers, 1))

    @property
    def writers(self) -> int:
        """Number of writers."""
        return len(self._reader.get_matched_publications())

    @property
    def identity(self) -> Any:
        """The reader's global identity, as ROS 2 lists it."""
        return _identity(self._reader)

    @property
    def returns(self) -> int:
        """Number of times that a writer reappeared after all had left."""
        return max(0, self._arrivals - 1)

    def close(self) -> None:
        """Close the reader; no call is made after this returns."""
        self._reader.set_listener(None)
        self._reader = None

    def _match(self, status: Any) -> None:
        if status.current_count == 1 and status.current_count_change > 0:
            self._arrivals += 1

    def _take(self, now: Seconds) -> None:
        from cyclonedds.core import DDSException  # noqa: PLC0415

        while reader := self._reader:
            # One by one: a message that cannot be decoded raises, and loses all that are taken with it.
            try:
                messages = reader.take(1)
            except DDSException:
                return
            except Exception:  # noqa: BLE001  (text that is not UTF-8, a sequence longer than its message)
                self.faulty += 1
                continue
            if not messages:
                return
            if getattr(messages[0].sample_info, "valid_data", False):
                self._on_message(messages[0], now)


def _topic(participant: Any, topic: str, message: str) -> tuple[type[Any], Any]:
    from cyclonedds.topic import Topic  # noqa: PLC0415

    from monochord.capture.dds import messages  # noqa: PLC0415

    kind: type[Any] = getattr(messages, message)
    if not all(part.replace("_", "a").isalnum() for part in topic.strip("/").split("/")):
        raise InputError(f"topic '{topic}'", "letters, digits and _, separated by /")
    return kind, Topic(participant, "rt/" + topic.strip("/"), kind)


def _delivery(*, latched: bool) -> list[Any]:
    """Return the policies of a writer: reliable, and `latched` for readers that come later."""
    from cyclonedds.core import Policy  # noqa: PLC0415

    last = Policy.History.KeepLast(depth=1 if latched else DEPTH)
    policies = [Policy.Reliability.Reliable(max_blocking_time=100_000_000), last]
    if latched:
        kept = Policy.DurabilityService(
            cleanup_delay=0, history=last, max_samples=-1, max_instances=-1, max_samples_per_instance=-1
        )
        policies += [Policy.Durability.TransientLocal, kept]
    return policies


def _node_writer(participant: Any) -> Any:
    """Return the writer of a participant's nodes, a topic of ROS 2 without its prefix."""
    from cyclonedds.core import Qos  # noqa: PLC0415
    from cyclonedds.pub import DataWriter  # noqa: PLC0415
    from cyclonedds.topic import Topic  # noqa: PLC0415

    from monochord.capture.dds import messages  # noqa: PLC0415

    topic = Topic(participant, NODES, messages.ParticipantEntitiesInfo)
    return DataWriter(participant, topic, qos=Qos(*_delivery(latched=True)))


def _identity(part: Any) -> Any:
    from monochord.capture.dds import messages  # noqa: PLC0415

    return messages.Gid(data=list(part.guid.bytes))


def _hash(message: type[Any]) -> str:
    """Return the hash of a type's definition (REP-2016), which ROS 2 tools compare."""
    from monochord.capture.dds.messages import ros_name  # noqa: PLC0415

    return str(typestore().hash_rihs01(ros_name(message)))


def _own_domain() -> int:
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal():
        raise InputError(f"ROS_DOMAIN_ID '{text}'", f"0 to {MAX_DOMAIN}")
    return int(text)


@contextmanager
def _configured(interface: str) -> Generator[bool]:
    """Set the configuration in the environment, so that the domain closes with its last participant.

    Yields whether the configuration is Monochord's rather than that of ``$CYCLONEDDS_URI``.
    """
    alone = interface == "lo"
    discovery = (
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>60</MaxAutoParticipantIndex>"
        '<Peers><Peer address="127.0.0.1"/></Peers></Discovery>'
        if alone
        else ""
    )
    multicast = "<AllowMulticast>false</AllowMulticast>" if alone else ""
    card = f'<Interfaces><NetworkInterface name="{interface}"/></Interfaces>' if interface else ""
    others = f"<Compatibility><IgnoreTypeInformation>{FAST_DDS}</IgnoreTypeInformation></Compatibility>"
    bounds = (
        f"<Internal><MaxSampleSize>{MAX_SAMPLE_SIZE}</MaxSampleSize>"
        f"<WriterLingerDuration>{LINGER}</WriterLingerDuration></Internal>"
    )
    with _CONFIGURING:
        if os.environ.get(URI):
            yield False
            return
        os.environ[URI] = (
            f"<CycloneDDS><Domain><General>{card}{multicast}</General>{discovery}{others}{bounds}</Domain></CycloneDDS>"
        )
        try:
            yield True
        finally:
            del os.environ[URI]


def _sockets() -> set[int]:
    """Return the descriptors of this process's sockets."""
    descriptors: set[int] = set()
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # the descriptor of the listing itself is closed by now
            if str(entry.readlink()).startswith("socket:"):
                descriptors.add(int(entry.name))
    return descriptors


def _keep_to(interface: str, domain: int, descriptors: set[int]) -> None:
    """Make the kernel drop packets to a domain's wildcard sockets unless they arrive over ``lo``.

    A classic BPF program (linux/filter.h), which needs no privileges, compares the index of the packet's
    interface. Packets from this machine to itself always arrive over ``lo``, whatever their address, and only
    these do.
    """
    load_word, equal, return_ = 0x20, 0x15, 0x06  # BPF_LD|BPF_W|BPF_ABS, BPF_JMP|BPF_JEQ|BPF_K, BPF_RET|BPF_K
    interface_index = 0xFFFFF008  # SKF_AD_OFF + SKF_AD_IFINDEX
    program = (
        (load_word, 0, 0, interface_index),
        (equal, 2, 0, socket.if_nametoindex(interface)),
        (equal, 1, 0, socket.if_nametoindex("lo")),
        (return_, 0, 0, 0),
        (return_, 0, 0, 0xFFFFFFFF),
    )
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in program))
    filter_ = struct.pack("@HP", len(program), ctypes.addressof(code))
    first = FIRST_PORT + PORTS * domain
    for descriptor in descriptors:
        with socket.socket(fileno=os.dup(descriptor)) as sock:
            if (sock.family, sock.type) != (socket.AF_INET, socket.SOCK_DGRAM):
                continue
            host, port = sock.getsockname()
            if host == "0.0.0.0" and first <= port < first + PORTS:  # noqa: S104  (compared, not bound)  # nosec B104
                sock.setsockopt(socket.SOL_SOCKET, ATTACH_FILTER, filter_)
